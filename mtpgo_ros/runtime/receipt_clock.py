# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""When a message was received, on the monotonic clock. No ROS in here."""

from __future__ import annotations

import time

_SET_NS = 100_000_000
"""Change of the system clock against the monotonic one from which on it was set (ns); chosen:
far more than an adjustment of its rate makes between two messages."""


class ReceiptClock:
    """Converts times of receipt from the system clock, which the middleware has, to the monotonic.

    A message may have waited for long: while the process was stopped, or while something kept its
    interpreter busy. That time counts, unless the system clock was set since the last message:
    then nothing is known about the wait.
    """

    def __init__(self) -> None:
        self._offset_ns = time.time_ns() - time.monotonic_ns()

    def monotonic_ns(self, received_ns: int) -> int:
        """Return when a message was received (ns of the monotonic clock).

        Args:
            received_ns: the same of the system clock, 0 where the middleware does not say it.
        """
        now_ns, system_ns = time.monotonic_ns(), time.time_ns()
        offset_ns, before_ns = system_ns - now_ns, self._offset_ns
        self._offset_ns = offset_ns
        waited_ns = system_ns - received_ns
        if received_ns <= 0 or waited_ns < 0 or abs(offset_ns - before_ns) > _SET_NS:
            return now_ns
        return now_ns - waited_ns
