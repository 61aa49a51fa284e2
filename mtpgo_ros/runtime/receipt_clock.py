# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""When a message was received, on the monotonic clock. No ROS in here."""

from __future__ import annotations

import time
from typing import NamedTuple

from mtpgo_ros.runtime.clock_watch import ClockSteps


class Receipt(NamedTuple):
    """When and how a message was received.

    Attributes:
        monotonic_ns: when it was received (ns of the monotonic clock), 0 where that is not known.
        sender_set: its sender's clock was set forward before it was sent.
    """

    monotonic_ns: int = 0
    sender_set: bool = False


UNKNOWN = Receipt()
"""Nothing is known of a message's way."""


class ReceiptClock:
    """Converts the middleware's times of receipt from the system clock to the monotonic clock.

    A message may have waited for long, for example while the process was stopped. This wait is
    part of its latency, unless the system clock was set since the receipt: the wait before that
    is then unknown.
    """

    def __init__(self) -> None:
        self._steps = ClockSteps()
        self._set_ns = 0  # when the system clock was seen to be set

    def monotonic_ns(self, received_ns: int) -> int:
        """Return when a message was received (ns of the monotonic clock).

        Args:
            received_ns: the same of the system clock, 0 where the middleware does not say it.
        """
        now_ns, system_ns = time.monotonic_ns(), time.time_ns()
        if self._steps.change_ns():
            self._set_ns = now_ns
        waited_ns = system_ns - received_ns
        if received_ns <= 0 or waited_ns < 0:
            return now_ns
        return max(now_ns - waited_ns, self._set_ns)
