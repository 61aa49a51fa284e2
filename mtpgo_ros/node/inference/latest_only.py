# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A thread that handles only the newest of the submitted items."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Generic, TypeVar

Item = TypeVar("Item")


class LatestOnly(Generic[Item]):
    """Handles items on a separate thread; a waiting item is replaced by a newer one.

    Args:
        handle: called with each item; must not raise.
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
        """Handle ``item`` next, instead of one that still waits."""
        with self._condition:
            self._waiting = item
            self._condition.notify()

    def stop(self, timeout_s: float = 1.0) -> bool:
        """Handle no more items; return true if the thread has ended within ``timeout_s``."""
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
