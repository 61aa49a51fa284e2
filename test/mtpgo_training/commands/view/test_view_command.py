# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``mtpgo view`` on the command line."""

import sys
from pathlib import Path

import pytest
from demo_traffic import make_recording

from mtpgo_training.cli import main
from mtpgo_training.commands.view.view_command import live_topic

sys.path.insert(0, str(Path(__file__).parents[2] / "view"))

from viewed_bags import write_bag


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    return write_bag(tmp_path_factory.mktemp("bag") / "drive.mcap", make_recording())


def test_a_page_is_written_without_an_output(bag, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["view", str(bag)]) == 0
    assert capsys.readouterr().out.startswith("drive.html: drive, 12.0 s, 2 road users, 51 pred")
    assert (tmp_path / "drive.html").is_file()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--seconds", "3"], "expected a live topic: a name with a leading slash"),
        (["--html", "/proc/nowhere/a.html"], "/proc/nowhere/a.html cannot be written"),
        (["--html", "/tmp"], "/tmp is a directory, expected a file to write"),
        (["--layout", "no"], "the layout 'no' is unknown"),
        (["--start", "99"], "drive has no road user from 99 s on, it lasts 12.0 s"),
        (["--model", "none"], "none"),
    ],
)
def test_bad_input_is_one_error(bag, arguments, message, capsys):
    assert main(["view", str(bag), *arguments]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1


@pytest.mark.parametrize(
    ("output", "module"), [("--rerun", "rerun"), ("--gif", "matplotlib"), ("--mp4", "matplotlib")]
)
def test_a_missing_library_names_the_extra(bag, output, module, tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, module, None)
    assert main(["view", str(bag), output, str(tmp_path / "a.out")]) == 2
    error = capsys.readouterr().err
    assert f"{output} needs {module}, which comes with the extra 'view'" in error


def test_a_file_that_is_missing_is_no_topic(tmp_path, capsys):
    assert main(["view", str(tmp_path / "a.mcap")]) == 2
    assert "does not exist" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("path", "layout", "topic"),
    [
        ("/objects", None, "/objects"),
        ("/robot1/predictor/predictions", None, "/robot1/predictor/predictions"),
        ("objects", None, None),
        ("/drive.mcap", None, None),
        ("/tmp", None, None),
        ("/tmp/no_such_bag", None, None),
        ("/nowhere", "ind", None),
    ],
)
def test_what_is_a_topic(path, layout, topic):
    given = [("data", Path(path)), *([("layout", layout)] if layout else [])]
    assert live_topic(given) == topic
