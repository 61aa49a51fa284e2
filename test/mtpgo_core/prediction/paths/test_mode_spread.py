# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Modes that lie closer together than the covariance allows for are moved apart, by hand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mtpgo_core.prediction.paths.mode_spread import (
    LARGEST_STRETCH,
    SLOW_MPS,
    with_least_spread,
)

H, DT = 2, 0.5
WEIGHT = np.array([[0.5, 0.25, 0.25]])


def modes(*last_y):
    """[1, M, 2, 4] fast paths along +x that end at these y, half of it one step before."""
    mean = np.zeros((1, len(last_y), H, 4))
    mean[..., 0] = [5000.0, 10000.0]
    mean[..., 1] = np.array(last_y)[:, None] * [0.5, 1.0]
    mean[..., 2] = 10000.0
    mean[..., 3] = np.array(last_y)[:, None]
    return mean


def moved_by(least, mean, weight, covariances):
    return with_least_spread(mean, weight, covariances, least, DT)


def covariance(sigma_m, modes=3):
    """[1, M, 2, 2, 2] with this root of the trace at the last step, and 100 m before."""
    steps = np.array([100.0, sigma_m]) ** 2 / 2.0
    return np.broadcast_to(steps[:, None, None] * np.eye(2), (1, modes, H, 2, 2)).copy()


def spread_of(mean, weight):
    """[n] root of the weighted mean squared distance from the heaviest mode at the last step."""
    rows = np.arange(len(mean))
    best = mean[rows, weight.argmax(axis=1), -1, :2]
    squared = ((mean[:, :, -1, :2] - best[:, None]) ** 2).sum(axis=-1)
    return np.sqrt((weight * squared).sum(axis=1))


def doubled(mean, *others):
    """The paths with twice the distance from the first at the end, 1.5 times one step before."""
    expected = mean.copy()
    for other in others:
        end = mean[0, other, -1, 1] - mean[0, 0, -1, 1]
        # 1.5 x half of the way after a step; the factor grows by 1 in 2 x 0.5 s.
        expected[0, other, :, 1] = mean[0, 0, :, 1] + end * np.array([0.75, 2.0])
        expected[0, other, :, 3] = mean[0, 0, :, 3] + end * np.array([1.5 + 0.5, 2.0 + 1.0])
    return expected


def test_modes_that_are_too_close_are_moved_away_from_the_heaviest():
    # Spread sqrt((0.25 + 0.25) 2^2) = sqrt(2); twice as much is wanted: 0.5 x 4 sqrt(2).
    mean = modes(1.0, 3.0, -1.0)
    moved = moved_by(0.5, mean, WEIGHT, covariance(4.0 * np.sqrt(2.0)))
    np.testing.assert_allclose(moved, doubled(mean, 1, 2))
    np.testing.assert_array_equal(moved[:, 0], mean[:, 0])


def test_the_heaviest_mode_is_the_centre_wherever_it_stands():
    swap = [1, 0, 2]
    mean = modes(1.0, 3.0, -1.0)
    moved = moved_by(0.5, mean[:, swap], WEIGHT[:, swap], covariance(4.0 * np.sqrt(2.0)))
    np.testing.assert_allclose(moved, doubled(mean, 1, 2)[:, swap])


def test_velocities_are_those_of_the_moved_paths():
    step_s, steps = 0.01, 500
    time_s = step_s * np.arange(1, steps + 1)
    mean = np.zeros((1, 2, steps, 4))
    for mode, (speed, bend) in enumerate(((10.0, 0.0), (8.0, 0.3))):
        angle = bend * time_s
        mean[0, mode, :, 2] = speed * np.cos(angle)
        mean[0, mode, :, 3] = speed * np.sin(angle)
        mean[0, mode, :, :2] = step_s * np.cumsum(mean[0, mode, :, 2:], axis=0)
    sigmas = np.broadcast_to(200.0 * np.eye(2), (1, 2, steps, 2, 2))
    moved = with_least_spread(mean, np.array([[0.6, 0.4]]), sigmas, 2.0, step_s)
    assert np.abs(moved - mean)[0, 1, -1, :2].max() > 10.0
    between = np.diff(moved[..., :2], axis=2) / step_s
    np.testing.assert_allclose(
        0.5 * (moved[:, :, 1:, 2:] + moved[:, :, :-1, 2:]), between, atol=0.1
    )


def steps_of(path):
    """[H - 1, 2] m in each step."""
    return np.diff(path[:, :2], axis=0)


def test_a_slow_mode_in_a_bend_does_not_turn_round():
    time_s, radius_m = 0.2 * np.arange(1, 26), 10.0
    mean = np.zeros((1, 2, 25, 2))
    for mode, speed in enumerate((6.0, 2.0)):
        angle = speed * time_s / radius_m
        mean[0, mode] = radius_m * np.stack([np.sin(angle), 1.0 - np.cos(angle)], axis=-1)
    wide = np.broadcast_to(200.0 * np.eye(2), (1, 2, 25, 2, 2))
    moved = with_least_spread(mean, np.array([[0.6, 0.4]]), wide, 2.0, 0.2)
    before, after = steps_of(mean[0, 1]), steps_of(moved[0, 1])
    assert np.abs(moved - mean).max() > 0.5
    turned = np.arctan2(
        before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0], (before * after).sum(1)
    )
    # 31 degrees, and somewhat more where it is hardly faster than what is added to its speed.
    assert np.abs(turned).max() < np.deg2rad(45.0)
    free = mean[0, 0, -1] + LARGEST_STRETCH * (mean[0, 1, -1] - mean[0, 0, -1])
    assert np.linalg.norm(moved[0, 1, -1] - free) > 1.0


def test_a_mode_that_brakes_goes_on_forwards():
    time_s = 0.2 * np.arange(1, 26)
    mean = np.zeros((1, 2, 25, 2))
    mean[0, 0, :, 0] = 10.0 * time_s
    mean[0, 1, :, 0] = 10.0 * time_s - 0.9 * time_s**2  # 1 m/s at the end
    wide = np.broadcast_to(5000.0 * np.eye(2), (1, 2, 25, 2, 2))
    moved = with_least_spread(mean, np.array([[0.6, 0.4]]), wide, 2.0, 0.2)
    assert (moved[0, 1, -1] < mean[0, 1, -1] - 0.1)[0]
    assert (steps_of(moved[0, 1])[:, 0] > -SLOW_MPS * 0.2 - 1e-9).all()


def test_modes_that_are_far_enough_apart_stay():
    mean = modes(1.0, 3.0, -1.0)
    np.testing.assert_array_equal(moved_by(0.5, mean, WEIGHT, covariance(2.8)), mean)


def test_the_factor_is_limited():
    moved = moved_by(1.0, modes(0.0, 1.0, -1.0), WEIGHT, covariance(1000.0))
    np.testing.assert_allclose(moved[0, :, -1, 1], [0.0, LARGEST_STRETCH, -LARGEST_STRETCH])


def test_positions_alone_are_enough():
    mean = modes(1.0, 3.0, -1.0)
    covariances = covariance(4.0 * np.sqrt(2.0))
    whole = moved_by(0.5, mean, WEIGHT, covariances)
    found = moved_by(0.5, mean[..., :2], WEIGHT, covariances)
    np.testing.assert_array_equal(found, whole[..., :2])


@pytest.mark.parametrize("least", [0.0, 1.0])
def test_nothing_happens_without_a_spread_or_with_one_mode(least):
    mean = modes(1.0, 1.0, 1.0) if least else modes(0.0, 1.0, 2.0)
    np.testing.assert_array_equal(moved_by(least, mean, WEIGHT, covariance(9.0)), mean)
    one = modes(1.0)
    found = moved_by(least, one, np.ones((1, 1)), covariance(9.0, 1))
    np.testing.assert_array_equal(found, one)
    none = one[:0]
    found = moved_by(least, none, np.ones((0, 1)), covariance(9.0, 1)[:0])
    assert found.shape == none.shape


def test_rows_that_are_not_finite_do_not_touch_the_others():
    mean = np.concatenate([modes(1.0, 3.0, -1.0), modes(np.nan, 3.0, np.inf)])
    weight = np.concatenate([WEIGHT, np.full((1, 3), np.nan)])
    covariances = np.concatenate([covariance(4.0 * np.sqrt(2.0)), covariance(np.nan)])
    moved = moved_by(0.5, mean, weight, covariances)
    np.testing.assert_allclose(moved[:1], doubled(mean[:1], 1, 2))
    assert not np.isfinite(moved[1]).all()


@given(
    st.lists(st.floats(-50.0, 50.0, allow_subnormal=False), min_size=3, max_size=3),
    st.floats(0.01, 50.0),
    st.floats(0.1, 3.0),
)
def test_the_spread_is_as_wanted_or_the_limit_is_reached(last_y, sigma_m, least):
    mean = modes(*last_y)
    before = spread_of(mean, WEIGHT)
    moved = moved_by(least, mean, WEIGHT, covariance(sigma_m))
    after = spread_of(moved, WEIGHT)
    expected = np.clip(least * sigma_m, before, LARGEST_STRETCH * before)
    np.testing.assert_allclose(after, expected, rtol=1e-9, atol=1e-9)


def test_single_precision_stays_single():
    mean = modes(1.0, 3.0, -1.0).astype(np.float32)
    moved = moved_by(0.5, mean, WEIGHT, covariance(4.0 * np.sqrt(2.0)))
    assert moved.dtype == np.float32
    np.testing.assert_allclose(moved, doubled(modes(1.0, 3.0, -1.0), 1, 2), rtol=1e-6)
