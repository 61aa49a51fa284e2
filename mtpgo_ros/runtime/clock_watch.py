# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Notices that the machine's clock was set, as by NTP or by hand. No ROS in here."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Iterator

from mtpgo_ros.runtime.side_thread import side_thread

SET_NS = 100_000_000
"""Change of the system clock against the monotonic one from which on it was set (ns); chosen:
far more than an adjustment of its rate makes between two looks."""

_PERIOD_S = 0.1
"""Time between two looks (s); chosen: the executables check as often whether they have to stop."""

_REPEATS = 3
"""Looks from a change on at which it is reported again; chosen. What computed until when to wait
just before the change, and waits just after it, is reached by one of them."""

_SURE_NS = 1_000_000
"""The two clocks were read together if no more than this lies between (ns); chosen."""


class ClockSteps:
    """Detects steps of the system clock by polling.

    A machine that was suspended counts as one whose clock was set forward.
    """

    def __init__(self) -> None:
        self._offset_ns = _offset_ns()

    def change_ns(self) -> int:
        """Return by how much the clock was set since the last call (ns), 0 if it was not.

        Changes by less than :data:`SET_NS` between two calls are ignored.
        """
        offset_ns, before_ns = _offset_ns(), self._offset_ns
        if offset_ns is None:
            return 0
        self._offset_ns = offset_ns
        if before_ns is None or abs(offset_ns - before_ns) <= SET_NS:
            return 0
        return offset_ns - before_ns


class EvenClock:
    """A clock that starts at the system time and ignores later steps of the system clock.

    It follows adjustments of the rate.
    """

    def __init__(self) -> None:
        self._steps = ClockSteps()
        self._shift_ns = 0

    def time_ns(self) -> int:
        """Return the time (ns); call it often, so that slow adjustments do not look like steps."""
        self._shift_ns -= self._steps.change_ns()
        return time.time_ns() + self._shift_ns


@contextlib.contextmanager
def watched_clock(
    was_set: Callable[[float], None], again: Callable[[], object] = lambda: None
) -> Iterator[None]:
    """Watch the system clock within the block, on a thread of its own.

    Args:
        was_set: called with the change (s) when the clock was set; must not raise.
        again: called some times in the fraction of a second from then on; must not raise.
    """

    def watch(ended: threading.Event) -> None:
        steps, left = ClockSteps(), 0
        while not ended.wait(_PERIOD_S):
            change_ns = steps.change_ns()
            if change_ns:
                was_set(change_ns * 1e-9)
                left = _REPEATS
            if left:
                left -= 1
                again()

    with side_thread("machine clock", watch):
        yield


def set_sentence(change_s: float) -> str:
    """Return that the machine's clock was set, and by how much (s)."""
    return (
        f"the machine's clock was set {'back' if change_s < 0.0 else 'forward'} by"
        f" {abs(change_s):.1f} s"
    )


def _offset_ns() -> int | None:
    """Return the system clock minus the monotonic clock (ns); None if not known.

    Not known if the thread was suspended between reading the two clocks.
    """
    for _ in range(3):
        before_ns = time.monotonic_ns()
        system_ns = time.time_ns()
        if time.monotonic_ns() - before_ns <= _SURE_NS:
            return system_ns - before_ns
    return None
