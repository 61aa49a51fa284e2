# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A thread that handles items in order, with a queue of bounded length."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from typing import Generic, TypeVar

Item = TypeVar("Item")


class WorkQueue(Generic[Item]):
    """Handles items on a thread of its own, in their order; a full queue loses its oldest item.

    It keeps the executor's thread free while a message is decoded, so that services, diagnostics
    and the clock are served in the meantime: the interpreter changes between threads every few
    milliseconds.

    Args:
        handle: called with each item; must not raise.
        depth: most items that wait; with 1 the newest item replaces the one that waits.
        name: of the thread.
        dropped: called for each item that was lost.
        rest_s: while items are lost, the thread rests so long after each (s): all threads share
            one interpreter, which the others need as well.

    Attributes:
        depth, rest_s: as above; may be changed at any time.
        stopped: no more items are handled.
    """

    def __init__(
        self,
        handle: Callable[[Item], None],
        depth: int,
        name: str,
        dropped: Callable[[], None] = lambda: None,
        rest_s: float = 0.0,
    ) -> None:
        self.rest_s, self._loses, self._ended = rest_s, False, threading.Event()
        self._handle, self._dropped, self.depth = handle, dropped, depth
        self._condition = threading.Condition()
        self._waiting: deque[Item] = deque()
        self.stopped = False
        self._thread = threading.Thread(target=self._work, name=name, daemon=True)
        self._thread.start()

    def submit(self, item: Item) -> None:
        """Handle ``item`` after those that wait."""
        with self._condition:
            full = len(self._waiting) >= self.depth
            if full:
                self._waiting.popleft()
                self._loses = True
            self._waiting.append(item)
            self._condition.notify()
        if full:
            self._dropped()

    def stop(self, timeout_s: float = 1.0) -> bool:
        """Handle no more items; return true if the thread has ended within ``timeout_s``."""
        with self._condition:
            self.stopped = True
            self._ended.set()
            self._waiting.clear()
            self._condition.notify()
        if self._thread is not threading.current_thread():
            self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def _work(self) -> None:
        while True:
            with self._condition:
                while not self._waiting and not self.stopped:
                    self._condition.wait()
                if self.stopped:
                    return
                item = self._waiting.popleft()
                self._loses = False
            self._handle(item)
            if self._loses and self.rest_s:
                self._ended.wait(self.rest_s)
