# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The fallback: straight on, with a covariance that equals its noise model."""

import math

import numpy as np
import pytest
from core_helpers import states_of

from mtpgo_core.history.track_history import TrackHistory
from mtpgo_core.prediction.constant_velocity import (
    ConstantVelocityNoise,
    assumed_covariances,
    covariance_along_paths,
    motion_yaw,
    predict_constant_velocity,
    usable_covariances,
)
from mtpgo_core.schema import Source
from mtpgo_core.task.task_description import HistoryConfig

QUIET = ConstantVelocityNoise(
    position_std_m=0.5, velocity_std_mps=0.0, along_m2ps3=0.0, across_m2ps3=0.0
)


def window_of(*arguments, **more):
    history = TrackHistory(HistoryConfig())
    history.update(states_of(5.0, *arguments, **more))
    return history.window()


def test_straight_on_by_hand():
    window = window_of([7], [[100.0, 50.0]], velocity=[[3.0, 4.0]], yaw=[2.0], z=[1.5])
    given = predict_constant_velocity(window, horizon_steps=3, dt_s=0.5, modes=2)
    assert (given.stamp_ns, given.frame_id) == (5_000_000_000, "map")
    np.testing.assert_allclose(given.time_s, [0.5, 1.0, 1.5])
    path = [[101.5, 52.0], [103.0, 54.0], [104.5, 56.0]]
    np.testing.assert_allclose(given.mean[0, :, :, :2], [path, path])
    np.testing.assert_allclose(given.mean[0, :, :, 2:], np.tile([3.0, 4.0], (2, 3, 1)))
    np.testing.assert_allclose(given.yaw[0], math.atan2(4.0, 3.0))
    assert given.weight.tolist() == [[1.0, 0.0]]
    assert given.initial.tolist() == [[100.0, 50.0, 3.0, 4.0]]
    assert given.initial_yaw.tolist() == [2.0]
    assert given.source.tolist() == [Source.CONSTANT_VELOCITY]
    assert given.z.tolist() == [1.5]


def test_covariance_grows_along_and_across_the_motion():
    noise = ConstantVelocityNoise(
        position_std_m=0.3, velocity_std_mps=0.2, along_m2ps3=1.5, across_m2ps3=0.06
    )
    window = window_of([1, 2], [[0, 0], [9, 9]], velocity=[[10.0, 0.0], [-6.0, 6.0]])
    given = predict_constant_velocity(window, horizon_steps=25, dt_s=0.2, noise=noise)
    t = given.time_s
    along = 0.09 + 0.04 * t**2 + 0.5 * t**3
    across = 0.09 + 0.04 * t**2 + 0.02 * t**3
    np.testing.assert_allclose(given.covariance[0, 0, :, 0, 0], along)
    np.testing.assert_allclose(given.covariance[0, 0, :, 1, 1], across)
    np.testing.assert_allclose(given.covariance[0, 0, :, 0, 1], 0.0, atol=1e-12)
    np.testing.assert_allclose(given.covariance[1, 0, :, 0, 1], (across - along) / 2)
    values = np.linalg.eigvalsh(given.covariance[1, 0])
    np.testing.assert_allclose(values, np.stack([across, along], axis=1))


def test_by_default_it_is_known_to_6_6_m_along_and_2_5_m_across_after_five_seconds():
    """0.2 m and 0.3 m/s of the observation, 1 and 0.1 m^2/s^3 of the acceleration."""
    window = window_of([1], [[0, 0]], velocity=[[0.0, 10.0]])
    given = predict_constant_velocity(window, horizon_steps=1, dt_s=5.0)
    expected = np.diag([0.04 + 0.09 * 25 + 0.1 * 125 / 3, 0.04 + 0.09 * 25 + 125 / 3])
    np.testing.assert_allclose(given.covariance[0, 0, 0], expected, atol=1e-12)
    np.testing.assert_allclose(np.sqrt(np.diag(expected)), [2.5, 6.6], atol=0.05)


def test_the_growth_is_that_of_white_acceleration():
    draw = np.random.default_rng(0)
    noise = ConstantVelocityNoise(position_std_m=0.4, velocity_std_mps=0.5, along_m2ps3=0.8)
    window = window_of([1], [[0, 0]], velocity=[[10.0, 0.0]])
    given = predict_constant_velocity(window, horizon_steps=1, dt_s=2.0, noise=noise)
    n, steps = 20_000, 100
    x, v = draw.normal(0, 0.4, n), draw.normal(0, 0.5, n)
    dt = 2.0 / steps
    for _ in range(steps):
        kick = draw.normal(0, math.sqrt(0.8 * dt), n)
        x, v = x + (v + kick / 2) * dt, v + kick
    assert given.covariance[0, 0, 0, 0, 0] == pytest.approx(x.var(), rel=0.05)


def test_the_trackers_covariance_starts_it_where_usable():
    covariance = np.tile(np.diag([1.0, 0.25, 0.5, 0.1]), (3, 1, 1))
    covariance[0, 0, 2] = covariance[0, 2, 0] = 0.3
    covariance[1, 0, 0] = -1.0
    covariance[2, 3, 3] = np.nan
    window = window_of(
        [1, 2, 3], [[0, 0], [1, 1], [2, 2]], velocity=np.ones((3, 2)), covariance=covariance
    )
    given = predict_constant_velocity(window, horizon_steps=1, dt_s=2.0, noise=QUIET)
    first = given.covariance[0, 0, 0]
    assert first[0, 0] == pytest.approx(1.0 + 2 * 2.0 * 0.3 + 4.0 * 0.5)
    assert first[1, 1] == pytest.approx(0.25 + 4.0 * 0.1)
    np.testing.assert_allclose(given.covariance[1:, 0, 0], np.tile(0.25 * np.eye(2), (2, 1, 1)))


def test_an_unknown_velocity_stands_with_a_wide_covariance():
    given = predict_constant_velocity(window_of([1], [[4.0, 5.0]]), horizon_steps=5, dt_s=1.0)
    assert (given.mean[0, 0, :, :2] == [4.0, 5.0]).all()
    assert given.initial[0].tolist() == [4.0, 5.0, 0.0, 0.0]
    assert (given.yaw == 0.0).all()
    assert given.covariance[0, 0, 0, 0, 0] > 100.0


def test_standing_agents_keep_their_yaw():
    window = window_of([1], [[0, 0]], velocity=[[0.1, 0.1]], yaw=[-2.0])
    given = predict_constant_velocity(window, horizon_steps=4, dt_s=0.2)
    np.testing.assert_allclose(given.yaw, -2.0)


def test_absent_agents_are_nan():
    history = TrackHistory(HistoryConfig())
    history.update(states_of(0.0, [1, 2], [[0, 0], [1, 1]]))
    history.update(states_of(1.0, [2], [[1, 1]]))
    given = predict_constant_velocity(history.window(), horizon_steps=2, dt_s=0.2)
    for values in (given.weight, given.mean, given.yaw, given.covariance):
        assert np.isnan(values[0]).all()
        assert np.isfinite(values[1]).all()


def test_nobody_is_no_problem():
    given = predict_constant_velocity(
        TrackHistory(HistoryConfig()).window(), horizon_steps=2, dt_s=0.2
    )
    assert given.mean.shape == (0, 1, 2, 4)
    assert len(given) == 0


def test_yaw_of_a_stopping_agent_is_the_last_one_moving():
    mean = np.zeros((1, 2, 4, 4))
    mean[0, 0, :, 2] = [0.0, -3.0, 0.2, 0.0]
    yaw = motion_yaw(mean, np.array([1.0]))
    np.testing.assert_allclose(yaw[0, 0], [1.0, math.pi, math.pi, math.pi])
    np.testing.assert_allclose(yaw[0, 1], 1.0)


def test_usable_covariances():
    good = np.array([[2.0, 0.5], [0.7, 1.0]])
    given = usable_covariances(
        np.stack([good, np.diag([1.0, -1.0]), np.diag([np.inf, 1.0]), np.zeros((2, 2))])
    )
    np.testing.assert_allclose(given[0], [[2.0, 0.6], [0.6, 1.0]])
    assert np.isnan(given[1:]).all()


def test_along_a_straight_path_the_covariance_is_that_of_constant_velocity():
    velocity, yaw = [[3.0, 4.0], [-6.0, 0.0]], np.arctan2([4.0, 0.0], [3.0, -6.0])
    window = window_of([1, 2], [[0, 0], [9, 9]], velocity=velocity, yaw=yaw)
    given = predict_constant_velocity(window, horizon_steps=5, dt_s=0.4, modes=2)
    found = covariance_along_paths(assumed_covariances(2), yaw, given.yaw, given.time_s)
    np.testing.assert_allclose(found, given.covariance)


def test_behind_a_bend_the_covariance_is_turned():
    noise = ConstantVelocityNoise(along_m2ps3=3.0, across_m2ps3=0.3)
    observed = np.diag([0.2, 0.1, 2.0, 1.0])[None]
    yaw = np.array([[[0.0, math.pi / 2]]])
    found = covariance_along_paths(observed, np.zeros(1), yaw, np.array([1.0, 2.0]), noise)
    np.testing.assert_allclose(found[0, 0, 0], np.diag([3.2, 1.2]))
    np.testing.assert_allclose(found[0, 0, 1], np.diag([4.9, 16.2]), atol=1e-12)


def test_along_paths_nothing_grows_from_a_covariance_that_is_no_use():
    observed = np.stack([np.full((4, 4), np.nan), np.zeros((4, 4)), np.eye(4)])
    yaw = np.zeros((3, 1, 2))
    yaw[2, 0, 1] = np.nan
    found = covariance_along_paths(observed, np.zeros(3), yaw, np.array([1.0, 2.0]))
    assert np.isnan(found[:2]).all()
    assert np.isfinite(found[2, 0, 0]).all()
    assert np.isnan(found[2, 0, 1]).all()
