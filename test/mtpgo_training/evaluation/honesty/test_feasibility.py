# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Feasibility of straight, turning, stopping and reversing paths."""

import numpy as np
import pytest

from mtpgo_training.evaluation.honesty.feasibility import (
    final_displacement,
    lateral_acceleration,
    reverses,
)

H, DT = 25, 0.2
TIME = DT * np.arange(1, H + 1)


def along(distance, heading=0.0):
    """[1, H, 2] a straight path with the given distances along its heading (m)."""
    return np.stack([distance * np.cos(heading), distance * np.sin(heading)], axis=-1)[None]


def start(speed, heading=0.0):
    return np.array([[0.0, 0.0, speed * np.cos(heading), speed * np.sin(heading)]])


@pytest.mark.parametrize("heading", [0.0, 2.0, -1.0])
def test_driving_back_is_found_whatever_the_heading(heading):
    forward = 2.0 * TIME - 0.6 * TIME**2  # turns round after 1.7 s
    assert reverses(along(forward, heading), start(2.0, heading), DT) == [True]
    assert reverses(along(2.0 * TIME, heading), start(2.0, heading), DT) == [False]
    stopping = np.where(TIME < 2.0, 2.0 * TIME - 0.5 * TIME**2, 2.0)
    assert reverses(along(stopping, heading), start(2.0, heading), DT) == [False]


def test_driving_back_in_the_last_second_is_found():
    back = 8.0 - 1.5 * (TIME - 4.0)
    path = along(np.where(TIME <= 4.0, 2.0 * TIME, back))
    assert reverses(path, start(2.0), DT) == [True]


def test_a_little_back_after_a_stop_and_standing_agents_do_not_count():
    slightly = along(np.minimum(2.0 * TIME, 2.0) - 0.03 * TIME)
    assert reverses(slightly, start(2.0), DT) == [False]
    assert reverses(along(-2.0 * TIME), start(0.3), DT) == [False]
    assert reverses(along(-2.0 * TIME), start(2.0), DT) == [True]


def test_a_turn_is_no_reversing():
    angle = np.pi * TIME / 5.0  # a half circle in 5 s
    turn = 8.0 * np.stack([np.sin(angle), 1.0 - np.cos(angle)], axis=-1)[None]
    assert reverses(turn, start(8.0 * np.pi / 5.0), DT) == [False]


def test_lateral_acceleration_of_a_circle_is_speed_squared_by_radius():
    speed, radius = 10.0, 25.0
    angle = speed / radius * TIME
    circle = radius * np.stack([np.sin(angle), 1.0 - np.cos(angle)], axis=-1)[None]
    found = lateral_acceleration(circle, DT)
    assert found.shape == (1, H - 2)
    np.testing.assert_allclose(found, speed**2 / radius, rtol=0.01)


def test_braking_and_creeping_have_no_lateral_acceleration():
    np.testing.assert_allclose(lateral_acceleration(along(10.0 * TIME - TIME**2), DT), 0.0)
    rng = np.random.default_rng(0)
    np.testing.assert_array_equal(lateral_acceleration(0.01 * rng.normal(size=(3, H, 2)), DT), 0.0)


def test_the_displacement_is_that_of_the_end():
    there_and_back = along(np.append(TIME[:-1], 0.3))
    assert final_displacement(there_and_back, start(0.0)) == pytest.approx(0.3)
