# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Latencies, misses and requirements computed from recorded times, against known answers."""

import math
import os

import pytest

from mtpgo_training.benchmark.node_benchmark import Requirement
from mtpgo_training.benchmark.node_case import NodeCase, evaluate
from mtpgo_training.benchmark.process_usage import (
    ProcessMonitor,
    Usage,
    cpu_share,
    largest_mb,
    read_peak_mb,
    read_usage,
)

MS = 1_000_000
STEP, PERIOD = 40 * MS, 200 * MS  # 25 Hz in, 5 Hz out
STAMP = 10**18  # stamps and the monotonic clock are not the same


def made(latency_ms, *, lost=(), fallback=(), seconds=3.0, measured=(1.0, 3.0)):
    """Observations at 25 Hz, every fifth one answered; ``lost`` cycles are not."""
    published = [[STAMP + k * STEP, k * STEP] for k in range(int(seconds * 25))]
    received = [
        [stamp, when + round(latency_ms(n) * MS), 4, 4 if n in fallback else 0]
        for n, (stamp, when) in enumerate(published[::5])
        if n not in lost
    ]
    return {
        "published": published,
        "received": received,
        "heard_from_stamp": STAMP,
        "measured_from": round(measured[0] * 1e9),
        "measured_until": round(measured[1] * 1e9),
    }


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


@pytest.mark.parametrize("lost", [{5}, {9}, {14}])
def test_a_cycle_that_never_comes_is_a_miss_wherever_it_stands(lost):
    row = evaluate(NodeCase(4), made(lambda n: 10.0, lost=lost), [], 0)
    assert (row.cycles, row.misses) == (10, 1)
    assert not row.holds


def test_late_is_a_miss_too_and_constant_velocity_is_counted_separately():
    late = made(lambda n: 201.0 if n == 7 else 199.0, fallback={8, 2})
    row = evaluate(NodeCase(4), late, [], 0)
    assert (row.cycles, row.misses, row.by_constant_velocity) == (10, 1, 1)


def test_no_prediction_at_all_in_the_measured_time():
    row = evaluate(NodeCase(4), made(lambda n: 1.0, lost=set(range(5, 15))), [], 0)
    assert row.misses == row.cycles == 10
    assert math.isnan(row.p99_ms)


def test_the_share_of_a_core_counts_inside_the_measurement_only():
    usages = [Usage(s * 10**9, cpu, 100.0 + s) for s, cpu in enumerate([0.0, 9.0, 9.1, 9.2, 9.9])]
    assert cpu_share(usages, 1 * 10**9, 3 * 10**9) == pytest.approx(0.1)
    assert largest_mb(usages) == 104.0
    assert math.isnan(cpu_share(usages, 0, 1))


def test_a_process_can_be_watched():
    monitor = ProcessMonitor(os.getpid())
    monitor.sample()
    monitor.sample()  # too soon for another
    assert len(monitor.usages) == 1
    assert monitor.usages[0].cpu_s > 0.1
    assert 20.0 < monitor.usages[0].resident_mb <= read_peak_mb(os.getpid()) * 1.1
    assert read_usage(2**30) is None
    assert read_peak_mb(2**30) == 0.0


def test_a_bar_says_what_does_not_hold():
    row = evaluate(NodeCase(4), made(lambda n: 50.0, lost={9}), [Usage(1, 0.0, 500.0)], 0)
    violations = Requirement(NodeCase(4), p99_ms=40.0).violations(row)
    assert [sentence.split(",")[0] for sentence in violations] == [
        "1 misses",
        "p99 50 ms",
        "500 MB",
    ]
    assert (
        Requirement(NodeCase(4), 60.0).violations(
            evaluate(NodeCase(4), made(lambda n: 50.0), [], 0)
        )
        == []
    )
