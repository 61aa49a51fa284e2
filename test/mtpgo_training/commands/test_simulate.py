# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""`mtpgo simulate` with short real runs of Eclipse SUMO."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest
from simulated_traffic import check_consistent, needs_sumo

from mtpgo_core.schema import AgentClass
from mtpgo_training import cli
from mtpgo_training.data.readers import load_recordings
from mtpgo_training.simulate.roundabout import CENTRE
from mtpgo_training.simulate.street import MIDDLE, VIEW_M


def test_missing_sumo_gives_a_one_line_error(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.delenv("SUMO_HOME", raising=False)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    assert cli.main(["simulate", "roundabout", "-o", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "Eclipse SUMO's program 'netconvert' was not found: install the extra" in error
    assert list(tmp_path.iterdir()) == []


@needs_sumo
def test_roundabout_from_the_command_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["--seconds", "15", "--seed", "5", "--lanes", "1", "--frame-rate", "10"]
    arguments += ["--vehicles-per-hour", "1800"]
    assert cli.main(["simulate", "roundabout", "-o", str(tmp_path), *arguments]) == 0
    assert "road users, seed 5" in capsys.readouterr().out
    (recording,) = load_recordings(tmp_path, "ind")
    assert (recording.name, recording.frame_rate) == ("00", 10.0)
    assert len(recording.track_id) >= 5
    assert AgentClass.CAR in recording.agent_class
    from_centre = recording.position - CENTRE
    assert (np.abs(from_centre) < 60).all()
    # Counter-clockwise around the island, and no vehicle on it.
    radius = np.linalg.norm(from_centre, axis=1)
    turn = np.cross(
        np.pad(from_centre, ((0, 0), (0, 1))), np.pad(recording.velocity, ((0, 0), (0, 1)))
    )
    moving = (np.linalg.norm(recording.velocity, axis=1) > 1.0) & (radius < 18)
    assert moving.any()
    assert (turn[moving, 2] > 0).all()
    assert radius.min() > 8.0
    check_consistent(recording, sideways_mps=2.5)


@needs_sumo
def test_street_has_queues_at_red_and_turns(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["--seconds", "60", "--seed", "5", "--lanes", "2", "--frame-rate", "10"]
    arguments += ["--vehicles-per-hour", "2400", "--speed-limit", "13.4"]
    assert cli.main(["simulate", "street", "-o", str(tmp_path), *arguments]) == 0
    assert "road users, seed 5" in capsys.readouterr().out
    (recording,) = load_recordings(tmp_path, "ind")
    assert (np.abs(recording.position - MIDDLE) <= VIEW_M).all()
    check_consistent(recording, sideways_mps=2.5)
    speed = np.linalg.norm(recording.velocity, axis=1)
    assert speed.max() < 1.5 * 13.4
    assert AgentClass.CAR in recording.agent_class
    started = turned = 0
    for index in range(len(recording.track_id)):
        rows = np.flatnonzero(recording.track == index)
        # A vehicle that waits drives on: red turns green within the minute.
        started += bool(speed[rows].min() < 0.3 and speed[rows[-1]] > 3.0)
        moving = rows[speed[rows] > 1.0]
        if len(moving):
            course = np.unwrap(recording.yaw[moving])
            turned += bool(np.abs(course[-1] - course[0]) > np.radians(60.0))
    assert started >= 5
    assert turned >= 3
    # Right-hand traffic away from the junctions: west is driven north of the middle.
    straight = (speed > 3.0) & (np.abs(recording.position[:, 0] - MIDDLE[0]) < 40.0)
    north = recording.position[straight, 1] > MIDDLE[1]
    west = recording.velocity[straight, 0] < 0.0
    assert west.any()
    assert not west.all()
    assert (west == north).all()


def test_an_option_that_the_site_does_not_have_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = str(tmp_path / "x")
    assert cli.main(["simulate", "street", "-o", output, "--traffic", "free"]) == 2
    assert "--traffic is given for a street, which has no such option" in capsys.readouterr().err
    assert cli.main(["simulate", "roundabout", "-o", output, "--speed-limit", "9"]) == 2
    assert "--speed-limit is given for a roundabout, which has no" in capsys.readouterr().err
    assert not (tmp_path / "x").exists()


@pytest.mark.parametrize(
    ("option", "value", "expected"),
    [
        ("--count", "0", "expected at least 1"),
        ("--seconds", "-1", "expected a number above 0"),
        ("--truck-share", "0.95", "expected a number from 0 to 0.9"),
    ],
)
def test_wrong_values(
    option: str, value: str, expected: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as caught:
        cli.main(["simulate", "street", "-o", "x", option, value])
    assert caught.value.code == 2
    assert expected in capsys.readouterr().err


@pytest.mark.parametrize(
    ("site", "held", "refused"),
    [
        ("roundabout", "00_tracks.csv.gz", True),
        ("roundabout", "01_recordingMeta.csv", True),
        ("roundabout", "02_tracks.csv", False),
        ("highway", "02_tracks.csv", True),
        ("highway", "00_tracks.csv", False),
    ],
)
def test_recordings_of_an_earlier_call_are_not_replaced(
    site: str,
    held: str,
    refused: bool,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked: list[str] = []
    monkeypatch.setattr(
        "mtpgo_training.simulate.sites.write_recordings", lambda site, *_: asked.append(site) or ()
    )
    (tmp_path / held).write_text("of an earlier call")
    arguments = ["simulate", site, "-o", str(tmp_path), "--count", "2"]
    assert cli.main(arguments) == 2
    error = capsys.readouterr().err
    said = f"{tmp_path} has the file {held}, which the recordings to be written would replace"
    assert (said in error) == refused
    assert asked == ([] if refused else [site])
    cli.main([*arguments, "--overwrite"])
    assert asked[-1:] == [site]


@needs_sumo
def test_a_simulation_without_traffic_gives_a_one_line_error(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["--seconds", "0.1", "--seed", "5", "--vehicles-per-hour", "0.001"]
    assert cli.main(["simulate", "roundabout", "-o", str(tmp_path / "x"), *arguments]) == 2
    assert "expected" in capsys.readouterr().err
    assert not (tmp_path / "x").exists()
