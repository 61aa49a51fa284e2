# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``mtpgo layouts`` writes what the launch files show."""

import shlex
from pathlib import Path

import pytest

from mtpgo_core.displays.display_layouts import DisplayNames, layout_texts
from mtpgo_training.cli import main


def test_both_files_are_written_and_the_command_can_be_pasted(tmp_path, capsys):
    folder = tmp_path / "my layouts"
    given = ["--namespace", "robot1", "--frame", "odom", "--node", "p2", "--risk", "r2"]
    assert main(["layouts", *given, "-o", str(folder)]) == 0
    expected = layout_texts(DisplayNames("robot1", "p2", "odom", risk="r2"))
    assert {path.name: path.read_text() for path in folder.iterdir()} == expected
    (command,) = [line for line in capsys.readouterr().out.splitlines() if "rviz2 -d" in line]
    assert Path(shlex.split(command)[-1]) == folder / "predictor.rviz"


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        (["--namespace", "robot-1"], "the namespace is 'robot-1'"),
        (["-o", "{file}/x"], "cannot be written: "),
    ],
)
def test_bad_input_is_one_line_and_status_2(tmp_path, capsys, given, sentence):
    file = tmp_path / "file"
    file.write_text("")
    arguments = [text.format(file=file) for text in ("-o", str(tmp_path / "out"), *given)]
    assert main(["layouts", *arguments]) == 2
    captured = capsys.readouterr()
    assert (captured.out, captured.err.count("\n")) == ("", 1)
    assert sentence in captured.err
    assert not (tmp_path / "out").exists()
