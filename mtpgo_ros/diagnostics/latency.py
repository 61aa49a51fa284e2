# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Statistics of the time from an observation to its prediction. No ROS in here."""

from __future__ import annotations

import threading
from collections import deque
from dataclasses import dataclass

import numpy as np

WINDOW = 512
"""Predictions over which the percentiles are taken; chosen: 100 s at 5 Hz."""


@dataclass(frozen=True)
class Latency:
    """Time from an observation's receipt to the publication of its prediction (ms).

    Attributes:
        p50, p99: percentiles over the last :data:`WINDOW` predictions, NaN before the first.
        maximum: over all predictions, NaN before the first.
    """

    p50: float
    p99: float
    maximum: float


class LatencyStatistics:
    """Percentiles of the latest latencies; thread-safe."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._latest_ms: deque[float] = deque(maxlen=WINDOW)
        self._maximum_ms = float("nan")

    def add(self, latency_ms: float) -> None:
        """Add the latency of one prediction (ms)."""
        with self._lock:
            self._latest_ms.append(latency_ms)
            self._maximum_ms = float(np.fmax(self._maximum_ms, latency_ms))

    def summary(self) -> Latency:
        """Return the percentiles and the maximum."""
        with self._lock:
            latest_ms, maximum_ms = np.array(self._latest_ms), self._maximum_ms
        if latest_ms.size == 0:
            return Latency(float("nan"), float("nan"), float("nan"))
        p50, p99 = np.percentile(latest_ms, (50.0, 99.0))
        return Latency(float(p50), float(p99), maximum_ms)
