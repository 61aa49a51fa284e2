# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``mtpgo data`` on the command line: text, JSON, picture, files that cannot be read."""

import json
import shutil

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


def test_copies_are_named(folder, tmp_path, capsys):
    """As a training names what it leaves out; also from results that were kept."""
    shutil.copytree(folder, tmp_path / "copy")
    write_ind(braking_cars("04", seconds=7.0, tracks=5), tmp_path / "copy")
    command = ["data", str(folder), "--layout", "ind", "--data", str(tmp_path / "copy")]
    command += ["--layout", "ind", "--no-cache", "--resume", str(tmp_path / "done")]
    for _ in range(2):
        assert cli.main(command) == 0
        text = capsys.readouterr().out
        assert "5 recordings, " in text
        assert (
            "  2 x copy (recordings with the content of another, which a training leaves out)\n"
            "    recording copy/01: that of data/01\n"
            "    recording copy/02: that of data/02\n"
        ) in text
    assert cli.main([*command, "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert content["copies"] == [f"recording copy/0{n}: that of data/0{n}" for n in (1, 2)]
    assert content["total"]["defects"]["copy"] == 2


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


def test_processes_resume_and_name_what_fails_at_the_end(folder, tmp_path, capsys, monkeypatch):
    pytest.importorskip("distributed")
    path = folder / "01_tracks.csv"
    path.write_text(path.read_text()[:-30])
    write_ind(braking_cars("03", seconds=7.0, tracks=3), folder, compress=False)
    command = ["data", str(folder), "--layout", "ind", "--no-cache", "--json"]
    assert cli.main(command) == 1
    alone = capsys.readouterr()
    command += [str(tmp_path / "out.json"), "--resume", str(tmp_path / "done")]
    assert cli.main([*command, "--jobs", "2"]) == 1
    assert "1 of 3 could not be read or scored:\n  01: " in capsys.readouterr().err
    assert json.loads((tmp_path / "out.json").read_text()) == json.loads(alone.out)

    def summarise_again(recording):
        raise AssertionError("a kept result is made again")

    monkeypatch.setattr("mtpgo_training.reports.recordings.description.summarise", summarise_again)
    assert cli.main(command) == 1
    assert json.loads((tmp_path / "out.json").read_text()) == json.loads(alone.out)


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--jobs", "0"], "--jobs is 0, expected at least 1"),
        (["--jobs", "2", "--cluster", "tcp://a:1"], "--jobs is 2 and --cluster is given"),
    ],
)
def test_bad_arguments_of_processes(folder, capsys, arguments, sentence):
    assert cli.main(["data", str(folder), "--layout", "ind", *arguments]) == 2
    assert sentence in capsys.readouterr().err
