# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Motion of vehicle centres, against exact solutions."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mtpgo_training.simulate import vehicle_motion as motion
from mtpgo_training.simulate.motion_config import MotionConfig
from mtpgo_training.simulate.sumo import FloatingCarData

STILL = MotionConfig(wander_m=0.0, surge_m=0.0)


def car_data(front: np.ndarray, heading: np.ndarray) -> FloatingCarData:
    """Return one vehicle."""
    n = len(front)
    return FloatingCarData(
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
    moved = motion.centre_motion(
        car_data(front, np.zeros(200)), np.array([5.0]), 25.0, [STILL], seed=0
    )
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
    config = MotionConfig(smoothing_s=0.04, wander_m=0.0, surge_m=0.0)
    seen = car_data(front, angle + math.pi / 2)
    moved = motion.centre_motion(seen, np.array([length]), 25.0, [config], seed=0)
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
    moved = motion.centre_motion(
        car_data(front, np.zeros(100)), np.array([4.0]), 25.0, [STILL], seed=0
    )
    middle = slice(30, -30)
    np.testing.assert_allclose(moved.acceleration[middle, 0], 1.5, atol=1e-6)
    np.testing.assert_allclose(
        np.gradient(moved.position[:, 0], 0.04)[1:-1], moved.velocity[1:-1, 0], atol=1e-9
    )


def test_wander_has_unit_variance_and_stops_with_the_vehicle() -> None:
    config = MotionConfig(wander_time_s=0.5)
    generator = np.random.default_rng(0)
    moving = motion._wander(np.full(50_000, 30.0), 0.04, config, generator)
    assert moving.std() == pytest.approx(1.0, abs=0.1)
    # The rate of the twice filtered noise has the spread 1 / time constant.
    assert np.diff(moving).std() == pytest.approx(0.04 / 0.5, rel=0.1)
    standing = motion._wander(np.zeros(100), 0.04, config, generator)
    np.testing.assert_allclose(standing, standing[0])


def test_a_pedestrian_turns_with_its_velocity_and_keeps_its_heading_at_rest() -> None:
    # One second to the east, one to the north, one second of standing.
    t = np.arange(25) / 25.0
    east = np.stack([1.2 * t, np.zeros(25)], axis=1)
    north = np.stack([np.full(25, 1.2), 1.2 * t], axis=1)
    path = np.concatenate([east, north, np.repeat(north[-1:], 25, axis=0)])
    yaw = motion._walking_heading(path, 0.04, 0.0)
    assert yaw[20] == pytest.approx(0.0, abs=1e-6)
    assert yaw[47] == pytest.approx(math.pi / 2, abs=0.02)
    np.testing.assert_allclose(yaw[55:], yaw[55])


def test_a_pedestrian_that_jumps_is_two_pieces() -> None:
    t = np.arange(50) / 25.0
    front = np.stack([1.2 * t, np.where(t < 1.0, 0.0, 2.0)], axis=1)
    walking = MotionConfig(wander_m=0.0, surge_m=0.0, trailing=False)
    moved = motion.centre_motion(
        car_data(front, np.zeros(50)), np.array([0.4]), 25.0, [walking], seed=0
    )
    assert moved.rows.tolist() == [*range(2, 23), *range(27, 48)]
    np.testing.assert_allclose(moved.velocity, np.tile([1.2, 0.0], (42, 1)), atol=1e-9)
