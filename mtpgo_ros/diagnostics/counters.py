# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What the node counts and measures, safe to touch from any of its threads. No ROS in here."""

from __future__ import annotations

import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

LATENCY_WINDOW = 512
"""Answers over which the latency's percentiles are taken."""

RECENT_S = 2.0
"""How long an odd event keeps its status at WARN (s): long enough for two reports to show it."""


@dataclass(frozen=True)
class Latency:
    """Time from an observation's receipt to the publication of its prediction (ms).

    Attributes:
        p50, p99: over the last :data:`LATENCY_WINDOW` answers, NaN before the first.
        maximum: over all answers, NaN before the first.
    """

    p50: float
    p99: float
    maximum: float


class Statistics:
    """Counters with the time of their last step, and the latencies.

    Args:
        listener: told of every step of a counter (name, number), on the thread that counts.
        clock: monotonic time (s).
    """

    def __init__(
        self,
        listener: Callable[[str, int], None] = lambda _name, _number: None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._listener = listener
        self._clock = clock
        self._lock = threading.Lock()
        self._counts: Counter[str] = Counter()
        self._last: dict[str, float] = {}
        self._latencies: deque[float] = deque(maxlen=LATENCY_WINDOW)
        self._maximum = float("nan")

    def count(self, name: str, number: int = 1) -> None:
        """Add ``number`` to the counter ``name``; zero changes nothing."""
        if number:
            with self._lock:
                self._counts[name] += number
                self._last[name] = self._clock()
            self._listener(name, number)

    def measured(self, latency_ms: float) -> None:
        """Take note of one answer's latency."""
        with self._lock:
            self._latencies.append(latency_ms)
            self._maximum = float(np.fmax(self._maximum, latency_ms))

    def counts(self) -> Mapping[str, int]:
        """All counters that are not zero."""
        with self._lock:
            return dict(self._counts)

    def recent(self, names: Mapping[str, str]) -> list[str]:
        """Those of ``names`` (counter to wording) that counted in the last :data:`RECENT_S`.

        Returns:
            Wordings, each with the counter's total.
        """
        with self._lock:
            since = self._clock() - RECENT_S
            return [
                f"{wording} ({self._counts[name]} in all)"
                for name, wording in names.items()
                if self._last.get(name, -np.inf) >= since
            ]

    def latency(self) -> Latency:
        """Percentiles of the latest answers."""
        with self._lock:
            latencies = np.array(self._latencies)
            maximum = self._maximum
        if latencies.size == 0:
            return Latency(float("nan"), float("nan"), float("nan"))
        p50, p99 = np.percentile(latencies, (50.0, 99.0))
        return Latency(float(p50), float(p99), maximum)
