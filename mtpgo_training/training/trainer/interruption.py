# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Ends a run early and in order: the time is up, Ctrl-C, a request to terminate."""

from __future__ import annotations

import signal
import threading
import time
from types import FrameType
from typing import Any

import lightning
from torch_geometric.data import Batch

SIGNALS = (signal.SIGINT, signal.SIGTERM)


class Stopper(lightning.Callback):
    """Asks the module to stop; a step that has begun is done first, in every process.

    A second signal ends the process at once, as it would without this callback.
    """

    def __init__(self, max_minutes: float | None = None) -> None:
        """Set the limit.

        Args:
            max_minutes: time from the first step to the request to stop (min).
        """
        self.max_minutes = max_minutes
        self._signal: int | None = None
        self._began = 0.0
        self._handlers: dict[int, Any] = {}

    def on_train_start(self, trainer: lightning.Trainer, pl_module: Any) -> None:
        """Start the clock, listen to signals."""
        self._began = time.monotonic()
        if threading.current_thread() is not threading.main_thread():
            return  # only the main thread may set handlers
        for number in SIGNALS:
            self._handlers[number] = signal.signal(number, self._receive)

    def _receive(self, number: int, frame: FrameType | None) -> None:
        self._signal = number
        self._let_go()

    def on_train_batch_start(
        self,
        trainer: lightning.Trainer,
        pl_module: Any,
        batch: Batch,
        batch_idx: int,
    ) -> None:
        """Pass a request on."""
        late = (
            self.max_minutes is not None
            and time.monotonic() - self._began > 60.0 * self.max_minutes
        )
        pl_module.received_signal = self._signal
        pl_module.asked_to_stop = pl_module.asked_to_stop or late or self._signal is not None

    def on_train_end(self, trainer: lightning.Trainer, pl_module: Any) -> None:
        """Listen no longer."""
        self._let_go()

    def on_exception(
        self, trainer: lightning.Trainer, pl_module: Any, exception: BaseException
    ) -> None:
        """Listen no longer."""
        self._let_go()

    def _let_go(self) -> None:
        for number, handler in self._handlers.items():
            signal.signal(number, handler)
        self._handlers.clear()
