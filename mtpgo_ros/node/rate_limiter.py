# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Which observations start a prediction.

Predictions are started by observations, never by a timer: the latency then contains computation
only, and a stream without observations has no predictions. Of a stream faster than the rate, the
observations nearest to the multiples of the period are selected: the mean rate is then exact for
any input rate, and a jittering input causes no drift.
"""

from __future__ import annotations

from collections import deque

import numpy as np


class RateLimiter:
    """Selects observations by their stamps, on average at most ``rate`` per second.

    Args:
        rate: highest number of predictions per second of the observations' time (Hz).
    """

    def __init__(self, rate: float) -> None:
        self.rate = rate
        self._due_ns: int | None = None
        self._last_ns: int | None = None
        self._steps: deque[int] = deque(maxlen=9)  # ns, for the median period of the input

    @property
    def period_ns(self) -> int:
        """Time between two predictions (ns)."""
        return round(1e9 / self.rate)

    def change(self, rate: float) -> None:
        """Use another rate (Hz): the next observation that is newer starts a prediction."""
        self.rate, self._due_ns = rate, None

    def reset(self) -> None:
        """Start again: the next observation starts a prediction."""
        self._due_ns = self._last_ns = None
        self._steps.clear()

    def due(self, stamp_ns: int) -> bool:
        """Return whether the observation of this time (ns) starts a prediction.

        An observation that is not newer than the last one never does.
        """
        if self._last_ns is not None:
            if stamp_ns <= self._last_ns:
                return False
            self._steps.append(stamp_ns - self._last_ns)
        self._last_ns = stamp_ns
        if self._due_ns is None:
            self._due_ns = stamp_ns + self.period_ns
            return True
        if stamp_ns < self._due_ns - self._tolerance_ns():
            return False
        # After a gap the multiples are counted from this observation: nothing is caught up.
        behind = stamp_ns - self._due_ns > self.period_ns // 2
        self._due_ns = (stamp_ns if behind else self._due_ns) + self.period_ns
        return True

    def _tolerance_ns(self) -> int:
        """Return half the input's period: an observation this early is the nearest to its time."""
        if not self._steps:
            return 0
        return min(int(np.median(self._steps)) // 2, self.period_ns // 2)
