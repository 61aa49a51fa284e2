# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Plays serialised messages on time: each is due at its own time after the start.

The time to wait is never counted from the previous message, so lateness does not accumulate.
Messages are read ahead by a thread; publishing is left to the caller's functions, so nothing here
needs ROS.
"""

from __future__ import annotations

import math
import queue
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

_LONGEST_SLEEP_S = 0.05
"""Longest time until a request to stop is noticed (s); chosen."""

_AHEAD = 64
"""Messages read ahead; chosen: enough to last while a chunk of the file is decompressed."""

_IDLE_S = 0.004
"""Time that must be left before the next event for the progress bar to be drawn (s); chosen:
drawing takes less."""

Message = tuple[str, int, bytes]
"""Topic, log time (ns), bytes."""


@dataclass(frozen=True)
class PlaybackTiming:
    """How log time maps to the wall clock.

    Attributes:
        origin_ns: log time that is played first (ns).
        end_ns: log time at which a pass ends (ns).
        rate: seconds of the recording per second.
        clock_hz: ticks of the clock per second of the wall clock, 0 for none.
    """

    origin_ns: int
    end_ns: int
    rate: float = 1.0
    clock_hz: float = 100.0


@dataclass(frozen=True)
class Sinks:
    """Functions that a player calls.

    Attributes:
        publish: (topic, bytes).
        clock: called with the present log time (ns) at every tick.
        progress: called with the log time reached (ns), while no message is due.
        stopped: returns whether to stop.
    """

    publish: Callable[[str, bytes], None]
    clock: Callable[[int], None]
    progress: Callable[[int], None]
    stopped: Callable[[], bool]


@dataclass
class Report:
    """What was played, and how late.

    Attributes:
        messages: number of messages.
        wall_s: time that it took (s).
        lateness_ms: of each message, after the time at which it was due (ms).
    """

    messages: int = 0
    wall_s: float = 0.0
    lateness_ms: list[float] = field(default_factory=list)

    def percentiles(self) -> tuple[float, float, float]:
        """Return p50, p99 and maximum of the lateness (ms), zeros where nothing was played."""
        if not self.lateness_ms:
            return 0.0, 0.0, 0.0
        p50, p99, top = np.percentile(self.lateness_ms, (50.0, 99.0, 100.0))
        return float(p50), float(p99), float(top)

    def sentence(self) -> str:
        """Return the report as a sentence."""
        p50, p99, top = self.percentiles()
        return (
            f"{self.messages} messages in {self.wall_s:.2f} s; lateness p50 {p50:.2f} ms,"
            f" p99 {p99:.2f} ms, max {top:.2f} ms"
        )


def play(
    messages: Iterator[Message], timing: PlaybackTiming, sinks: Sinks, report: Report
) -> None:
    """Play one pass over ``messages`` (rising log times) and add to ``report``.

    Raises:
        Exception: what ``messages`` raises.
    """
    start = time.monotonic()
    to_wall = 1e-9 / timing.rate
    pass_s = (timing.end_ns - timing.origin_ns) * to_wall
    tick_s = 1.0 / timing.clock_hz if timing.clock_hz > 0.0 else math.inf
    next_tick_s = 0.0 if timing.clock_hz > 0.0 else math.inf
    ahead = _ReadAhead(messages)
    try:
        upcoming = ahead.next()
        while True:
            next_message_s = math.inf
            if upcoming is not None:
                next_message_s = (upcoming[1] - timing.origin_ns) * to_wall
            due_s = min(next_tick_s, next_message_s, pass_s if upcoming is None else math.inf)
            if due_s - (time.monotonic() - start) > _IDLE_S:
                sinks.progress(timing.origin_ns + round(due_s / to_wall))
            if not _sleep(start + due_s, sinks):
                break
            if next_tick_s <= due_s:
                sinks.clock(timing.origin_ns + round(next_tick_s / to_wall))
                # Ticks that were missed (the process was stopped) are left out.
                missed = math.floor((time.monotonic() - start - next_tick_s) / tick_s)
                next_tick_s += tick_s * (1 + max(0, missed))
            elif upcoming is not None:
                report.lateness_ms.append((time.monotonic() - start - next_message_s) * 1e3)
                sinks.publish(upcoming[0], upcoming[2])
                report.messages += 1
                upcoming = ahead.next()
            else:
                sinks.progress(timing.end_ns)
                break
    finally:
        ahead.close()
        report.wall_s += time.monotonic() - start


def _sleep(until: float, sinks: Sinks) -> bool:
    """Sleep until a time of the monotonic clock (s); return False when asked to stop."""
    while (left := until - time.monotonic()) > 0.0:
        time.sleep(min(left, _LONGEST_SLEEP_S))
        if sinks.stopped():
            break
    return not sinks.stopped()


class _ReadAhead:
    """Reads an iterator ahead on a thread."""

    def __init__(self, messages: Iterator[Message]) -> None:
        self._queue: queue.Queue[Message | Exception | None] = queue.Queue(_AHEAD)
        self._closed = threading.Event()
        self._thread = threading.Thread(
            target=self._fill, args=(messages,), name="reader", daemon=True
        )
        self._thread.start()

    def _fill(self, messages: Iterator[Message]) -> None:
        try:
            for message in messages:
                if not self._put(message):
                    return
            self._put(None)
        except Exception as error:  # Raised again where the message is asked for.
            self._put(error)

    def _put(self, item: Message | Exception | None) -> bool:
        while not self._closed.is_set():
            try:
                self._queue.put(item, timeout=0.1)
                return True
            except queue.Full:
                continue
        return False

    def next(self) -> Message | None:
        """Return the next message, None after the last.

        Raises:
            Exception: what the iterator raised.
        """
        item = self._queue.get()
        if isinstance(item, Exception):
            raise item
        return item

    def close(self) -> None:
        """Stop reading."""
        self._closed.set()
        self._thread.join(timeout=1.0)
