# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Log lines that may recur with every message, each kind once in a while."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable


class Complaints:
    """Passes the first complaint of a kind on at once, and further ones at most every few seconds.

    Args:
        log: takes a line.
        repeat_s: shortest time between two lines of one kind (s).
        clock: monotonic time (s).
    """

    def __init__(
        self,
        log: Callable[[str], None],
        repeat_s: float = 5.0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._log = log
        self._repeat_s = repeat_s
        self._clock = clock
        self._lock = threading.Lock()
        self._last: dict[str, float] = {}

    def __call__(self, kind: str, line: str) -> None:
        """Log ``line`` unless one of its ``kind`` was logged a moment ago."""
        now = self._clock()
        with self._lock:
            if now - self._last.get(kind, -self._repeat_s) < self._repeat_s:
                return
            self._last[kind] = now
        self._log(line)
