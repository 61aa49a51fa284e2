# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Latencies and misses computed from recorded times, against known answers."""

import math

import pytest
from node_times import MS, STAMP, STEP, made

from mtpgo_training.benchmark.node_case import NodeCase, evaluate


def test_a_perfect_run():
    row = evaluate(NodeCase(4), made(lambda n: 10.0 + n), [], started_ns=-2_000 * MS)
    assert (row.cycles, row.misses, row.by_constant_velocity) == (10, 0, 0)
    assert row.holds
    # Cycles 5 to 14 are measured.
    assert row.p50_ms == pytest.approx(10.0 + 9.5)
    assert row.max_ms == pytest.approx(24.0)
    assert row.start_s == pytest.approx(2.01)
    assert row.first_input_s == pytest.approx(0.01)
    assert math.isnan(row.cpu_share)


@pytest.mark.parametrize("known_from", [None, STAMP + STEP])
def test_the_first_input_is_the_first_predicted_one_where_the_subscription_was_seen_late(
    known_from,
):
    times = made(lambda n: 10.0 + n) | {"heard_from_stamp": known_from}
    assert evaluate(NodeCase(4), times, [], 0).first_input_s == pytest.approx(0.01)


@pytest.mark.parametrize("lost", [{5}, {9}, {14}])
def test_a_cycle_that_never_comes_is_a_miss_wherever_it_is(lost):
    row = evaluate(NodeCase(4), made(lambda n: 10.0, lost=lost), [], 0)
    assert (row.cycles, row.misses) == (10, 1)
    assert not row.holds


def test_a_late_prediction_is_a_miss_and_constant_velocity_is_counted_separately():
    late = made(lambda n: 201.0 if n == 7 else 199.0, fallback={8, 2})
    row = evaluate(NodeCase(4), late, [], 0)
    assert (row.cycles, row.misses, row.by_constant_velocity) == (10, 1, 1)


def test_no_prediction_at_all_in_the_measured_time():
    row = evaluate(NodeCase(4), made(lambda n: 1.0, lost=set(range(5, 15))), [], 0)
    assert row.misses == row.cycles == 10
    assert math.isnan(row.p99_ms)
