# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Requests to end a run early: Ctrl-C, a request to terminate, a closed terminal."""

from __future__ import annotations

import signal
import threading
from contextlib import AbstractContextManager
from types import FrameType
from typing import Any

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Interruption(AbstractContextManager["Interruption"]):
    """Records requests to end a run, so that the current step can be completed first.

    Signals are caught inside the ``with`` block. A second signal has its usual effect: it ends the
    process.

    Attributes:
        received_signal: the first signal, if there was one.
    """

    def __init__(self) -> None:
        self.received_signal: int | None = None
        self._handlers: dict[int, Any] = {}

    def __enter__(self) -> Interruption:
        if threading.current_thread() is threading.main_thread():  # others cannot set handlers
            self._handlers = {
                number: signal.signal(number, self._receive)
                for number in SIGNALS
                # Of nohup: the terminal may be closed.
                if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN
            }
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._handlers.items():
            signal.signal(number, handler)
        self._handlers.clear()

    def _receive(self, number: int, frame: FrameType | None) -> None:
        self.received_signal = number
        self.__exit__()

    def requested(self) -> bool:
        """Return whether the run should end."""
        return self.received_signal is not None
