# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The watchdog that answers requests whose time budget is used up."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from mtpgo_ros.node.inference.prediction_request import PredictionRequest


class DeadlineWatchdog:
    """Claims each watched request that is still unclaimed when its budget ends.

    It runs on its own thread, so a model that is slow or never returns cannot delay it. See
    :class:`PredictionRequest` for the claim protocol.

    Args:
        on_overdue: called on the watchdog's thread with each request that the watchdog has
            claimed; must answer it quickly and must not raise.
    """

    def __init__(self, on_overdue: Callable[[PredictionRequest], None]) -> None:
        self._on_overdue = on_overdue
        self._condition = threading.Condition()
        self._open: list[PredictionRequest] = []
        self._stopped = False
        self._thread = threading.Thread(target=self._run, name="watchdog", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def watch(self, request: PredictionRequest) -> None:
        """Watch ``request`` until it is claimed."""
        with self._condition:
            self._open.append(request)
            self._condition.notify()

    def stop(self, timeout_s: float = 1.0) -> bool:
        """Claim no more requests; return true if the thread has ended within ``timeout_s``."""
        with self._condition:
            self._stopped = True
            self._open.clear()
            self._condition.notify()
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def _run(self) -> None:
        while (request := self._claim_next()) is not None:
            self._on_overdue(request)

    def _claim_next(self) -> PredictionRequest | None:
        """Wait for the next overdue request and claim it; return None once stopped."""
        with self._condition:
            while not self._stopped:
                self._open = [request for request in self._open if not request.claimed]
                if not self._open:
                    self._condition.wait()
                    continue
                first = min(self._open, key=lambda request: request.due_ns)
                left_ns = first.due_ns - time.monotonic_ns()
                if left_ns > 0:
                    self._condition.wait(left_ns * 1e-9)
                elif first.claim():
                    return first
        return None
