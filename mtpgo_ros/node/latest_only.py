# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A thread that always takes up the newest item and lets older ones go."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Generic, TypeVar

Item = TypeVar("Item")


class LatestOnly(Generic[Item]):
    """Handles items on a thread of its own; an item that waits is replaced by a newer one.

    Args:
        handle: called with each item taken up; must not raise.
        name: of the thread.
    """

    def __init__(self, handle: Callable[[Item], None], name: str) -> None:
        self._handle = handle
        self._condition = threading.Condition()
        self._waiting: Item | None = None
        self._stopped = False
        self._thread = threading.Thread(target=self._work, name=name, daemon=True)
        self._thread.start()

    def submit(self, item: Item) -> None:
        """Make ``item`` the next one."""
        with self._condition:
            self._waiting = item
            self._condition.notify()

    def stop(self, timeout_s: float = 1.0) -> bool:
        """Take up no more; true when the thread has ended within ``timeout_s``."""
        with self._condition:
            self._stopped = True
            self._waiting = None
            self._condition.notify()
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def _work(self) -> None:
        while True:
            with self._condition:
                while self._waiting is None and not self._stopped:
                    self._condition.wait()
                if self._stopped:
                    return
                item, self._waiting = self._waiting, None
            if item is not None:
                self._handle(item)
