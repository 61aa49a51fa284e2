# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Whether the objects are subscribed to reliably or with best effort. No ROS in here.

Best effort hears every publisher and never waits for a message that was lost. But of a message of
many fragments (20,000 objects) some are lost every time, so it never arrives; and a reliable
subscription waits for a message that can never arrive (an empty one), and for all after it. So the
choice is best effort until messages are lost or fail to come, and changes when none come. When a
small message ends the silence, it was a pause of the stream, and best effort is chosen again.
"""

from __future__ import annotations

from collections import deque
from statistics import median

_SILENCE_S = 1.0
"""Shortest silence after which the other choice is tried (s); chosen: several periods of most
trackers."""

_USUAL_TIMES = 3.0
"""The same as a multiple of the usual time between two messages; chosen: in a slow stream no
single message decides."""

_FIRST_SILENCE_S = 3.0
"""The same before the first message (s); chosen longer, since many publishers start late."""

_LARGE_BYTES = 200_000
"""Messages above this size are kept reliable (bytes); chosen: with best effort 380 kB arrived
every time, and 2 MB never (measured in shared memory; by UDP what the socket's buffer holds)."""

_LOST = 5
"""Lost messages after which it is reliable; chosen: one is no reason to subscribe anew."""


class ReliabilityChoice:
    """The choice, from what came and what did not; each silence changes it once at most.

    Args:
        now_s: monotonic time (s), as in all methods.

    Attributes:
        reliable: the choice.
    """

    def __init__(self, now_s: float) -> None:
        self.reliable = False
        self._since_s, self._limit_s = now_s, _FIRST_SILENCE_S
        self._intervals_s: deque[float] = deque(maxlen=5)
        self._tried, self._lost, self._by_silence = False, 0, False

    def received(self, size: int, now_s: float) -> bool:
        """Take the receipt of a message of a size (bytes) into account.

        Returns:
            Whether the choice has changed.
        """
        if self._limit_s != _FIRST_SILENCE_S or self._intervals_s:
            self._intervals_s.append(now_s - self._since_s)
        usual_s = median(self._intervals_s) if self._intervals_s else 0.0
        self._since_s, self._tried = now_s, False
        self._limit_s = max(_SILENCE_S, _USUAL_TIMES * usual_s)
        paused = self.reliable and self._by_silence and size < _LARGE_BYTES
        self._by_silence = False
        if paused:
            self.reliable = False
        return paused

    def lost(self, number: int) -> None:
        """Take into account that the middleware has lost messages."""
        self._lost += number

    def update(self, *, possible: bool, matched: bool, now_s: float) -> bool:
        """Return whether the choice has changed.

        Args:
            possible: all publishers are reliable.
            matched: there is a publisher.
            now_s: see the class.
        """
        before = self.reliable
        if not matched:
            self._since_s = now_s
        if not possible:
            self.reliable = False
        elif self._lost >= _LOST:
            self.reliable, self._lost = True, 0
        elif not self._tried and now_s - self._since_s > self._limit_s:
            self.reliable, self._tried = not self.reliable, True
            self._by_silence = True
        return self.reliable != before
