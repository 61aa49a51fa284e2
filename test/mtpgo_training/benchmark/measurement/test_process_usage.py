# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Processor time and memory of processes."""

import math
import os

import pytest

from mtpgo_training.benchmark.measurement.process_usage import (
    ProcessMonitor,
    Usage,
    cpu_share,
    largest_mb,
    read_peak_mb,
    read_usage,
)


def test_the_share_of_a_core_counts_inside_the_measurement_only():
    usages = [Usage(s * 10**9, cpu, 100.0 + s) for s, cpu in enumerate([0.0, 9.0, 9.1, 9.2, 9.9])]
    assert cpu_share(usages, 1 * 10**9, 3 * 10**9) == pytest.approx(0.1)
    assert largest_mb(usages) == 104.0
    assert math.isnan(cpu_share(usages, 0, 1))


def test_a_process_is_sampled():
    monitor = ProcessMonitor(os.getpid())
    monitor.sample()
    monitor.sample()  # too early for another sample
    assert len(monitor.usages) == 1
    assert monitor.usages[0].cpu_s > 0.1
    assert 20.0 < monitor.usages[0].resident_mb <= read_peak_mb(os.getpid()) * 1.1
    assert read_usage(2**30) is None
    assert read_peak_mb(2**30) == 0.0
