# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Frames and rates from times: steady, rounded to milliseconds, with holes, without a rate."""

import numpy as np
import pytest

from mtpgo_training.data.readers.tables.frame_grid import frames_of_times, without_common_step


@pytest.mark.parametrize("rate", [2.5, 10.0, 25.0, 29.97, 30.0, 100.0])
@pytest.mark.parametrize("digits", [3, 6])
def test_a_steady_rate_is_found_in_rounded_times(rate, digits):
    number = np.array([0, 0, 1, 2, 3, 5, 6, 7, 40, 41, 42, 900])
    frame, found = frames_of_times(1.7e9 + np.round(number / rate, digits))
    np.testing.assert_array_equal(frame, number)
    assert found == pytest.approx(rate, rel=1e-5)


def test_mostly_holes_give_the_shortest_step():
    number = np.array([0, 5, 10, 15, 16, 21, 26])
    frame, rate = frames_of_times(number / 10)
    np.testing.assert_array_equal(frame, number)
    assert rate == 10.0


def test_times_in_any_order():
    frame, rate = frames_of_times(np.array([0.3, 0.1, 0.2]))
    assert (frame.tolist(), rate) == ([2, 0, 1], 10.0)


def test_times_without_a_rate_are_milliseconds():
    frame, rate = frames_of_times(np.array([0.0, 0.1, 0.217, 0.29, 0.41]))
    assert (frame.tolist(), rate) == ([0, 100, 217, 290, 410], 1000.0)
    frame, rate = frames_of_times(np.array([5.0, 5.0]))
    assert (frame.tolist(), rate) == ([0, 0], 10.0)


def test_tracks_of_several_rates_without_a_common_one_are_milliseconds():
    tracks = (np.arange(50) / 10, np.arange(50) / 8, 0.013 + np.arange(50) / 25)
    times = np.concatenate(tracks)
    frame, rate = frames_of_times(times)
    assert rate == 1000.0  # not 521.3 Hz, of whose grid any time is within a millisecond
    np.testing.assert_array_equal(frame, np.round(times * 1000))


@pytest.mark.parametrize("rate", [240.0, 480.0, 500.0, 1000.0, 2000.0])
def test_fast_sensors_keep_their_rate(rate):
    number = np.array([0, 1, 2, 3, 5, 6, 7, 40, 41, 42, 900])
    frame, found = frames_of_times(np.round(number / rate, 6))
    np.testing.assert_array_equal(frame, number)
    assert found == pytest.approx(rate, rel=1e-5)


def test_frames_are_counted_in_their_common_step():
    frame, rate = without_common_step(np.array([780, 790, 810, 780]), 25.0)
    assert (frame.tolist(), rate) == ([0, 1, 3, 0], 2.5)
    frame, rate = without_common_step(np.array([4, 5, 9]), 25.0)
    assert (frame.tolist(), rate) == ([4, 5, 9], 25.0)


@pytest.mark.parametrize("rate", [12.5, 15.0, 7.0, 23.976, 59.94, 119.88, 1000 / 15, 1000 / 7])
def test_a_rate_near_a_round_one_is_kept(rate):
    number = np.arange(2000)
    frame, found = frames_of_times(np.round(number / rate, 4))
    np.testing.assert_array_equal(frame, number)
    assert found == pytest.approx(rate, rel=1e-5)
