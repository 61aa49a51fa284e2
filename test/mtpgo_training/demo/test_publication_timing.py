# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0

import numpy as np
import pytest

from mtpgo_training.demo.publication_timing import merge_timings, missed_cycles, timing

MS = 1_000_000
START = 1_500_000_000 * 10**9


def stamps(*times_ms):
    return START + np.array(times_ms, dtype=np.int64) * MS


def names(*text):
    return np.array(text, dtype="S16")


def ticks(step_ms, end_ms):
    return stamps(*range(0, end_ms + 1, step_ms))


@pytest.mark.parametrize(
    ("predicted_ms", "missed"),
    [
        ((0, 200, 400, 600, 800, 1000), 0),
        ((0, 200, 600, 800, 1000), 1),
        ((0, 1000), 4),
        ((200, 400, 600, 800, 1000), 1),
        ((0, 200, 400), 3),
        ((), 6),
    ],
)
def test_each_cycle_without_a_prediction_is_missed(predicted_ms, missed):
    assert missed_cycles(ticks(100, 1000), stamps(*predicted_ms), 200 * MS) == missed


def test_at_a_rate_that_does_not_divide_the_nearest_observations_count():
    # 12.5 Hz against 5 Hz: the observations nearest to 0, 200, 400, 600, 800 ms.
    assert missed_cycles(ticks(80, 800), stamps(0, 160, 400, 560, 800), 200 * MS) == 0


def test_nothing_is_due_while_nothing_is_observed():
    observed = np.concatenate([ticks(100, 400), stamps(2000, 2100, 2200)])
    assert missed_cycles(observed, stamps(0, 200, 400, 2000, 2200), 200 * MS) == 0


def test_an_empty_recording_misses_nothing():
    assert missed_cycles(stamps(), stamps(), 200 * MS) == 0


def test_late_predictions_and_missing_road_users_are_counted():
    first, second, third = ticks(200, 400).tolist()
    observed = {first: names("a"), second: names("a", "b"), third: names("b")}
    received = {first: 10 * MS, second: 210 * MS, third: 410 * MS}
    predicted = [
        (first, 15 * MS, names("a")),
        (second, 217 * MS, names("b")),
        (third, 610 * MS + 1, names("b")),
    ]
    result = timing(observed, received, predicted, rate=5.0)
    assert (result.cycles, result.published, result.missed, result.late) == (3, 3, 0, 1)
    assert result.deadline_misses == 1
    assert result.missing_agents == 1
    assert result.agents_max == 2
    np.testing.assert_allclose(result.latency_ms, [5.0, 7.0, 200.000001])


def test_timings_of_recordings_are_merged():
    one = timing({0: names("a")}, {0: 0}, [(0, 5 * MS, names("a"))], rate=5.0)
    none = timing({0: names("a", "b")}, {0: 0}, [], rate=5.0)
    both = merge_timings([one, none])
    assert (both.cycles, both.published, both.missed, both.agents_max) == (2, 1, 1, 2)
    assert both.latency_ms.tolist() == [5.0]
