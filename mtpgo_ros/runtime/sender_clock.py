# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Whether the clock of another machine, which sends messages, was set. No ROS in here."""

from __future__ import annotations

from collections import deque

from mtpgo_core.history.stream_guard import LATE_NS

LOOKS_BACK_NS = 30_000_000_000
"""Messages are compared with those of this time (ns); chosen: longer than messages are held up. Of
two senders whose clocks differ, both are in it."""


class SenderClock:
    """Notices that the senders' clock was set forward, by their times and those of receipt.

    What holds up messages makes the time from sending to receipt longer, never shorter than it is
    for a message that nothing holds up. So the clock was set forward where that time is shorter
    than that of any message lately, by as much as counts where stamps go back.
    """

    def __init__(self) -> None:
        # Receipts, and how far the sender's clock was ahead of them: those that none after them
        # exceeds, so that the first is the largest (ns).
        self._ahead: deque[tuple[int, int]] = deque()

    def was_set_forward(self, sent_ns: int, received_ns: int) -> bool:
        """Return whether the clock was set forward before a message was sent.

        Args:
            sent_ns: time of sending by the sender's clock (ns), 0 where the middleware does not
                say it.
            received_ns: time of receipt (ns of the monotonic clock).
        """
        if sent_ns <= 0:
            return False
        known, ahead_ns = self._ahead, sent_ns - received_ns
        while known and known[0][0] < received_ns - LOOKS_BACK_NS:
            known.popleft()
        was_set = bool(known) and ahead_ns - known[0][1] > LATE_NS
        while known and known[-1][1] <= ahead_ns:
            known.pop()
        known.append((received_ns, ahead_ns))
        return was_set
