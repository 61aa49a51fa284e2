# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Latency percentiles by hand-worked numbers."""

import math

import pytest

from mtpgo_ros.diagnostics.latency import LatencyStatistics


def test_latency_percentiles_by_hand():
    statistics = LatencyStatistics()
    assert math.isnan(statistics.summary().p50)
    assert math.isnan(statistics.summary().maximum)
    for value in range(101):
        statistics.add(float(value))
    latency = statistics.summary()
    assert (latency.p50, latency.p99, latency.maximum) == pytest.approx((50.0, 99.0, 100.0))
    for _ in range(600):  # the window moves on, the maximum stays
        statistics.add(1.0)
    latency = statistics.summary()
    assert (latency.p50, latency.p99, latency.maximum) == (1.0, 1.0, 100.0)
