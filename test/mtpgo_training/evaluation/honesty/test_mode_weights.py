# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Weights of modes, against values worked out by hand."""

import numpy as np
import pytest

from mtpgo_training.evaluation.honesty.mode_weights import (
    BINS,
    average_distance,
    brier_min,
    brier_score,
    calibration_error,
    final_distance,
    heaviest_is_nearest,
    nearest,
    weight_bins,
)

WEIGHT = np.array([[0.5, 0.3, 0.2]])
DISTANCE = np.array([[3.0, 1.0, 2.0]])


def test_distances_are_those_of_each_mode():
    mean = np.zeros((2, 2, 2, 2))
    mean[:, 1, :, 0] = [1.0, 3.0]
    mask = np.array([[True, True], [True, False]])
    np.testing.assert_array_equal(final_distance(mean, np.zeros((2, 2, 2)), mask)[0], [0.0, 3.0])
    assert np.isnan(final_distance(mean, np.zeros((2, 2, 2)), mask)[1]).all()
    average = average_distance(mean, np.zeros((2, 2, 2)), mask)
    np.testing.assert_array_equal(average, [[0.0, 2.0], [0.0, 1.0]])


def test_the_nearest_mode_has_the_event_and_equals_share_it():
    np.testing.assert_array_equal(nearest(DISTANCE), [[0.0, 1.0, 0.0]])
    np.testing.assert_array_equal(nearest(np.array([[1.0, 1.0, 4.0]])), [[0.5, 0.5, 0.0]])
    assert np.isnan(nearest(np.full((1, 3), np.nan))).all()


def test_the_brier_score_and_the_heaviest():
    event = nearest(DISTANCE)
    assert brier_score(WEIGHT, event) == pytest.approx(0.25 + 0.49 + 0.04)
    assert brier_score(np.full((1, 4), 0.25), np.eye(4)[:1]) == pytest.approx(1.0 - 1.0 / 4)
    assert heaviest_is_nearest(WEIGHT, event) == 0.0
    assert heaviest_is_nearest(WEIGHT, np.array([[1.0, 0.0, 0.0]])) == 1.0


def test_brier_min_fde_adds_the_squared_doubt_of_the_nearest_mode():
    assert brier_min(WEIGHT, DISTANCE, DISTANCE) == pytest.approx(1.0 + 0.7**2)
    assert brier_min(10.0 * WEIGHT, DISTANCE, DISTANCE) == pytest.approx(1.0 + 0.7**2)
    assert np.isnan(brier_min(WEIGHT, np.full((1, 3), np.nan), DISTANCE))


def test_brier_min_ade_is_of_the_mode_that_ends_nearest_not_of_the_least_ade():
    average = np.array([[0.1, 0.6, 0.4]])
    assert brier_min(WEIGHT, DISTANCE, average) == pytest.approx(0.6 + 0.7**2)


def test_permuted_modes_have_the_same_values():
    order = [2, 0, 1]
    event, other = nearest(DISTANCE), nearest(DISTANCE[:, order])
    weight = WEIGHT[:, order]
    assert brier_score(weight, other) == pytest.approx(brier_score(WEIGHT, event))
    distance = DISTANCE[:, order]
    assert brier_min(weight, distance, distance) == brier_min(WEIGHT, DISTANCE, DISTANCE)
    for one, two in zip(weight_bins(weight, other), weight_bins(WEIGHT, event), strict=True):
        np.testing.assert_allclose(one, two)


def test_bins_count_modes_weights_and_events():
    weight = np.array([[0.62, 0.38], [1.0, 0.0], [0.6, 0.4]])
    event = np.array([[1.0, 0.0], [0.0, 1.0], [np.nan, np.nan]])
    count, weights, events = weight_bins(weight, event)
    assert count.shape == (3, BINS)
    assert np.isnan(count[2]).all()
    np.testing.assert_array_equal(np.nonzero(count[0])[0], [3, 6])
    np.testing.assert_array_equal(np.nonzero(count[1])[0], [0, 9])
    assert (weights[0, 6], events[0, 6]) == (0.62, 1.0)
    assert (weights[1, 9], events[1, 9]) == (1.0, 0.0)
    error = calibration_error(*(np.nansum(part, axis=0) for part in (count, weights, events)))
    assert error == pytest.approx((0.38 + 0.38 + 1.0 + 1.0) / 4)
    assert np.isnan(calibration_error(*np.zeros((3, BINS))))
