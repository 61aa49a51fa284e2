# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Each baseline on the motion that it describes exactly."""

import numpy as np
import pytest

from mtpgo_core.schema import HistoryWindow
from mtpgo_training.scenes.kinematic_baselines import predict_baselines

DT, T = 0.2, 16
PAST = (np.arange(T) - (T - 1)) * DT
AHEAD = np.arange(1, 26) * DT


def window(position, velocity, acceleration, valid=None):
    """One agent from [T, 2] arrays."""
    course = np.arctan2(velocity[:, 1], velocity[:, 0])
    return HistoryWindow(
        stamp_ns=0,
        frame_id="map",
        key=np.zeros((1, 4), dtype=np.uint32),
        agent_class=np.ones(1, dtype=np.uint8),
        z=np.zeros(1),
        size=np.ones((1, 2)),
        position=position[None],
        velocity=velocity[None],
        acceleration=acceleration[None],
        yaw=course[None],
        valid=np.ones((1, T), dtype=bool) if valid is None else valid,
        covariance=np.full((1, 4, 4), np.nan),
    )


def straight(t, speed=5.0, acceleration=0.0):
    x = 100.0 + speed * t + 0.5 * acceleration * t**2
    return np.stack([x, 0.5 * x], axis=-1)


def accelerating(acceleration):
    direction = np.array([1.0, 0.5])
    return window(
        straight(PAST, acceleration=acceleration),
        (5.0 + acceleration * PAST)[:, None] * direction,
        np.full((T, 1), acceleration) * direction,
    )


def circle(t, radius=20.0, rate=0.3):
    return radius * np.stack([np.sin(rate * t), 1.0 - np.cos(rate * t)], axis=-1)


def turning(valid=None):
    rate, radius = 0.3, 20.0
    speed = radius * rate
    velocity = speed * np.stack([np.cos(rate * PAST), np.sin(rate * PAST)], axis=-1)
    return window(circle(PAST), velocity, np.zeros((T, 2)), valid)


def paths(history, steps=25):
    """Positions by the name of the baseline, [1, steps, 2] each."""
    found = predict_baselines(history, steps, DT)
    assert [name for name, path in found.items() if path.covariance is not None] == ["cv"]
    return {name: path.position for name, path in found.items()}


@pytest.mark.parametrize("name", ["cv", "ca", "ctrv"])
def test_uniform_motion_is_exact_for_all(name):
    path = paths(accelerating(0.0))[name]
    np.testing.assert_allclose(path[0], straight(AHEAD), atol=1e-9)


def test_constant_acceleration_is_exact_where_constant_velocity_is_not():
    accelerated = accelerating(0.8)
    truth = straight(AHEAD, acceleration=0.8)
    np.testing.assert_allclose(paths(accelerated)["ca"][0], truth, atol=1e-9)
    error = paths(accelerated)["cv"][0] - truth
    assert np.linalg.norm(error[-1]) == pytest.approx(0.5 * 0.8 * 25 * np.hypot(1.0, 0.5))


def test_constant_turn_rate_is_exact_on_a_circle():
    np.testing.assert_allclose(paths(turning())["ctrv"][0], circle(AHEAD), atol=1e-9)


def test_a_turn_that_was_observed_too_briefly_is_ignored():
    valid = np.zeros((1, T), dtype=bool)
    valid[0, -2:] = True
    found = paths(turning(valid))
    np.testing.assert_allclose(found["ctrv"], found["cv"], atol=1e-9)


def test_an_unknown_velocity_stands():
    blank = window(np.ones((T, 2)), np.full((T, 2), np.nan), np.full((T, 2), np.nan))
    for path in paths(blank, 3).values():
        np.testing.assert_allclose(path, np.ones((1, 3, 2)))
