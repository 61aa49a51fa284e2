# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""From bumpers to centres by exact solutions, and real short runs of Eclipse SUMO."""

from __future__ import annotations

import importlib.util
import math
from pathlib import Path

import numpy as np
import pytest

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.schema import AgentClass
from mtpgo_training import cli
from mtpgo_training.data.readers import load_recordings
from mtpgo_training.data.recording import Recording
from mtpgo_training.data.writers.highd_writer import write_highd
from mtpgo_training.simulate import sumo
from mtpgo_training.simulate import vehicle_motion as motion
from mtpgo_training.simulate.highway import HighwayConfig, simulate_highway
from mtpgo_training.simulate.roundabout import CENTRE
from mtpgo_training.simulate.street import MIDDLE, VIEW_M, StreetConfig, simulate_street

STILL = motion.MotionConfig(wander_m=0.0, surge_m=0.0)


def floating(front: np.ndarray, heading: np.ndarray) -> sumo.Floating:
    """One vehicle."""
    n = len(front)
    return sumo.Floating(
        vehicle=np.zeros(n, dtype=np.int64),
        step=np.arange(n),
        front=front,
        speed=np.zeros(n),
        heading=heading,
        names=["a"],
        types=["car0"],
    )


def test_straight_drive_is_shifted_by_half_the_length() -> None:
    t = np.arange(200) / 25.0
    front = np.stack([20.0 * t, np.full(200, -5.0)], axis=1)
    moved = motion.centres(floating(front, np.zeros(200)), np.array([5.0]), 25.0, STILL, seed=0)
    assert moved.rows.tolist() == list(range(2, 198))
    np.testing.assert_allclose(moved.position, front[2:-2] - (2.5, 0.0), atol=1e-9)
    np.testing.assert_allclose(moved.velocity, np.tile([20.0, 0.0], (196, 1)), atol=1e-9)
    np.testing.assert_allclose(moved.acceleration, 0.0, atol=1e-6)
    np.testing.assert_allclose(moved.yaw, 0.0, atol=1e-9)


def test_on_a_circle_the_rear_cuts_the_corner() -> None:
    # Front on a circle of radius R; the rear axle trails at d on radius sqrt(R^2 - d^2), so the
    # heading turns away from the tangent by asin(d / R), outwards.
    radius, length, speed = 20.0, 10.0, 8.0
    angle = speed / radius * np.arange(3000) / 25.0
    front = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    config = motion.MotionConfig(smoothing_s=0.04, wander_m=0.0, surge_m=0.0)
    seen = floating(front, angle + math.pi / 2)
    moved = motion.centres(seen, np.array([length]), 25.0, config, seed=0)
    settled = slice(2000, -10)
    offset = moved.yaw[settled] - (angle[moved.rows[settled]] + math.pi / 2)
    expected = -math.asin(motion.REAR_AXLE * length / radius)
    # The axle moves in steps of the frame, hence not exactly.
    np.testing.assert_allclose(offset, expected, atol=0.02)
    reach = np.linalg.norm(moved.position[settled] - front[moved.rows[settled]], axis=1)
    np.testing.assert_allclose(reach, length / 2, atol=0.01)


def test_velocity_and_acceleration_belong_to_the_position() -> None:
    t = np.arange(100) / 25.0
    front = np.stack([10.0 * t + 0.5 * 1.5 * t**2, np.zeros(100)], axis=1)
    moved = motion.centres(floating(front, np.zeros(100)), np.array([4.0]), 25.0, STILL, seed=0)
    middle = slice(30, -30)
    np.testing.assert_allclose(moved.acceleration[middle, 0], 1.5, atol=1e-6)
    np.testing.assert_allclose(
        np.gradient(moved.position[:, 0], 0.04)[1:-1], moved.velocity[1:-1, 0], atol=1e-9
    )


def test_wander_has_the_spread_asked_for_and_rests_at_rest() -> None:
    config = motion.MotionConfig(wander_time_s=0.5)
    generator = np.random.default_rng(0)
    moving = motion._wander(np.full(50_000, 30.0), 0.04, config, generator)
    assert moving.std() == pytest.approx(1.0, abs=0.1)
    # The rate of the twice filtered noise has the spread 1 / time constant.
    assert np.diff(moving).std() == pytest.approx(0.04 / 0.5, rel=0.1)
    standing = motion._wander(np.zeros(100), 0.04, config, generator)
    np.testing.assert_allclose(standing, standing[0])


def test_missing_sumo_is_one_sentence(
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


def _has_sumo() -> bool:
    try:
        return bool(sumo.program("sumo") and sumo.program("netconvert"))
    except sumo.SimulationError:
        return False


needs_sumo = pytest.mark.skipif(
    not _has_sumo(), reason="Eclipse SUMO is not installed (extra 'simulation')"
)


def check_consistent(recording: Recording, sideways_mps: float) -> None:
    """Positions, velocities and headings tell the same story."""
    for index in range(len(recording.track_id)):
        rows = np.flatnonzero(recording.track == index)
        if len(rows) < 10:
            continue
        assert (np.diff(recording.frame[rows]) >= 1).all()
        whole = np.diff(recording.frame[rows], n=1) == 1
        step = np.diff(recording.position[rows], axis=0) * recording.frame_rate
        mean = (recording.velocity[rows][1:] + recording.velocity[rows][:-1]) / 2
        np.testing.assert_allclose(step[whole], mean[whole], atol=0.25)
    cos, sin = np.cos(recording.yaw), np.sin(recording.yaw)
    sideways = recording.velocity[:, 1] * cos - recording.velocity[:, 0] * sin
    assert np.abs(sideways).max() < sideways_mps


@needs_sumo
def test_highway_is_a_highd_recording(tmp_path: Path) -> None:
    config = HighwayConfig(
        seconds=5.0, seed=3, traffic="dense", lanes=2, truck_share=0.2, warm_up_s=40.0
    )
    recording = simulate_highway(config)
    assert (recording.frame.min(), recording.frame.max()) == (1, 125)
    assert len(recording.track_id) >= 5
    left = np.cos(recording.yaw) < 0
    assert left.any()
    assert not left.all()
    # Right-hand traffic: the upper carriageway drives left, everybody between the outer lines.
    lines = [float(line[0, 1]) for line in recording.lanes]
    for upper, own in ((True, lines[:3]), (False, lines[3:])):
        y = recording.position[left == upper, 1]
        assert min(own) < y.min() < y.max() < max(own)
    half = recording.size[recording.track, 0] / 2
    assert (recording.position[:, 0] - half >= 0).all()
    assert (recording.position[:, 0] + half <= 420).all()
    check_consistent(recording, sideways_mps=1.0)
    write_highd(recording, tmp_path)
    (back,) = load_recordings(tmp_path, "highd")
    np.testing.assert_allclose(back.position, recording.position, atol=1.1e-3)
    again = simulate_highway(config)
    np.testing.assert_array_equal(again.position, recording.position)


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
    # Counter-clockwise around the island, and nobody on it.
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
        # Who waits goes on: red turns green within the minute.
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


@needs_sumo
def test_street_is_the_same_again_and_refuses_what_it_has_not(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    config = StreetConfig(seconds=5.0, seed=2, warm_up_s=20.0)
    np.testing.assert_array_equal(
        simulate_street(config).position, simulate_street(config).position
    )
    with pytest.raises(ConfigurationError, match="lanes is 4, expected 1 to 3 for a street"):
        StreetConfig(lanes=4)
    arguments = ["simulate", "street", "-o", str(tmp_path / "x"), "--traffic", "free"]
    assert cli.main(arguments) == 2
    assert "--traffic is given for a street, which has no such option" in capsys.readouterr().err
    assert not (tmp_path / "x").exists()


@needs_sumo
def test_simulation_without_traffic_is_one_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["--seconds", "0.1", "--seed", "5", "--vehicles-per-hour", "0.001"]
    assert cli.main(["simulate", "roundabout", "-o", str(tmp_path / "x"), *arguments]) == 2
    assert "expected" in capsys.readouterr().err
    assert not (tmp_path / "x").exists()


def test_recording_shipped_is_as_described() -> None:
    from mtpgo_core.resources import find_resource

    (recording,) = load_recordings(find_resource("recordings", "highway"), "highd")
    assert recording.frame_rate == 25.0
    assert 25.0 <= recording.duration_s <= 40.0
    at_once = np.bincount(recording.frame)[recording.frame.min() :]
    assert at_once.mean() >= 25
    assert at_once.max() <= 48
    left = np.cos(recording.yaw) < 0
    assert 0.2 < left.mean() < 0.8
    forward = recording.acceleration[:, 0] * np.where(left, -1, 1)
    assert forward.min() < -2.0
    changed = 0
    for index in range(len(recording.track_id)):
        y = recording.position[recording.track == index, 1]
        changed += int(np.ptp(y) > 2.5)
    assert changed >= 5
    assert len(recording.lanes) >= 6
