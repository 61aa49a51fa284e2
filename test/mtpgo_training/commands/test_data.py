# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``mtpgo data`` on the command line: text, JSON, picture, files that cannot be read."""

import json

import pytest
from traffic import braking_cars

from mtpgo_training import cli
from mtpgo_training.data.writers.ind_writer import write_ind


@pytest.fixture
def folder(tmp_path):
    for name in ("01", "02"):
        recording = braking_cars(name, seconds=7.0, tracks=3)
        write_ind(recording, tmp_path / "data", compress=False)
    return tmp_path / "data"


def test_text_json_and_picture(folder, tmp_path, capsys):
    out, picture = tmp_path / "out.json", tmp_path / "out.png"
    command = ["data", str(folder), "--layout", "ind", "--cache", str(tmp_path / "cache")]
    assert cli.main([*command, "--json", str(out), "--picture", str(picture)]) == 0
    text = capsys.readouterr().out
    assert "2 recordings, " in text
    assert "6 road users: 6 car" in text
    assert picture.read_bytes().startswith(b"\x89PNG")
    content = json.loads(out.read_text())
    assert [r["name"] for r in content["recordings"]] == ["01", "02"]
    assert cli.main([*command, "--recordings", "02", "--json"]) == 0
    (only,) = json.loads(capsys.readouterr().out)["recordings"]
    assert only == content["recordings"][1]


def test_a_file_that_cannot_be_read_is_named_and_the_others_are_described(folder, capsys):
    path = folder / "01_tracks.csv"
    path.write_text(path.read_text()[:-30])
    command = ["data", str(folder), "--layout", "ind", "--no-cache"]
    assert cli.main(command) == 1
    text = capsys.readouterr().out
    assert "1 recording, " in text
    assert "1 x unreadable (files that cannot be read)" in text
    assert "01_tracks.csv ends within line" in text
    assert cli.main([*command, "--recordings", "01"]) == 2
    error = capsys.readouterr().err
    assert error.startswith("mtpgo: no recording has a road user: ")
    assert error.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ([], "no directory is given, expected mtpgo data DIR --layout LAYOUT"),
        (["DIR"], "the layout of "),
        (["DIR", "--layout", "kitti"], "the layout 'kitti' is unknown, expected one of highd"),
        (["DIR", "--layout", "ngsim"], "no recording has a road user: "),
        (["DIR", "--layout", "ind", "--json", "DIR"], "is a directory, expected a file to write"),
    ],
)
def test_bad_arguments_are_one_sentence(folder, capsys, arguments, sentence):
    line = [str(folder) if word == "DIR" else word for word in arguments]
    assert cli.main(["data", *line, "--no-cache"]) == 2
    error = capsys.readouterr().err
    assert sentence in error
    assert error.count("\n") == 1
