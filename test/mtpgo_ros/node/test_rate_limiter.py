# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Which observations start a prediction, by hand-worked streams."""

import numpy as np
import pytest

from mtpgo_ros.node.rate_limiter import RateLimiter


def chosen(times_s, rate=5.0):
    """Times (s) of those that are due."""
    schedule = RateLimiter(rate)
    return [t for t in times_s if schedule.due(round(t * 1e9))]


def test_every_fifth_of_25_hz():
    assert chosen([k / 25 for k in range(26)]) == [0.0, 0.2, 0.4, 0.6, 0.8, 1.0]


def test_the_nearest_to_each_multiple_where_the_rates_do_not_divide():
    # 12 Hz: 0, 83, 167, 250, 333, 417, 500, 583, ... ms; multiples of 200 ms.
    times = [k / 12 for k in range(13)]
    assert [round(1e3 * t) for t in chosen(times)] == [0, 167, 417, 583, 833, 1000]


@pytest.mark.parametrize("input_hz", [5.0, 7.3, 10.0, 11.0, 12.0, 29.97, 100.0])
def test_the_mean_rate_is_never_exceeded_nor_missed(input_hz):
    times = np.arange(0.0, 100.0, 1.0 / input_hz)
    assert len(chosen(times)) == pytest.approx(500, abs=2)


def test_a_slower_stream_is_taken_whole():
    assert len(chosen(np.arange(0.0, 10.0, 0.25))) == 40


def test_jitter_loses_nothing():
    jitter = np.random.default_rng(1).uniform(-0.03, 0.03, 500)
    assert len(chosen(np.arange(500) * 0.2 + jitter + 1.0)) == 500


def test_a_clock_that_runs_fast_does_not_drift_out_of_the_tolerance():
    # 1 % fast: one in a hundred must be left out, and not more.
    assert len(chosen(np.arange(1000) * 0.198)) == pytest.approx(990, abs=2)


def test_nothing_is_caught_up_after_a_gap():
    times = [0.0, 0.2, 5.03, 5.07, 5.11, 5.15, 5.19, 5.23]
    assert chosen(times) == [0.0, 0.2, 5.03, 5.23]


def test_repeated_and_older_stamps_are_never_due():
    assert chosen([1.0, 1.0, 0.5, 1.2, 1.2]) == [1.0, 1.2]


def test_after_a_reset_the_next_one_is_due():
    schedule = RateLimiter(5.0)
    assert schedule.due(10**10)
    assert not schedule.due(10**9)
    schedule.reset()
    assert schedule.due(10**9)
