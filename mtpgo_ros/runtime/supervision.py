# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What the process tells its supervisor. No ROS in here."""

from __future__ import annotations

import contextlib
import os
import socket
import threading
import time
from collections.abc import Iterator

from mtpgo_ros.runtime.side_thread import side_thread

LONGEST_STEP_S = 180.0
"""A step of the executor counts as alive for at most this time (s); chosen: a model file is tried
for two minutes at most, and then loaded."""


class ServiceNotifier:
    """Messages to systemd, as described in sd_notify(3); without systemd nothing is sent.

    Args:
        address: of the socket, empty for none; a leading ``@`` stands for the abstract namespace.
        watchdog_us: time without a sign of life after which systemd restarts the service (us), 0
            for no watchdog.

    Attributes:
        watchdog_s: how often :meth:`alive` has to be called (s), 0.0 for never.
    """

    def __init__(self, address: str = "", watchdog_us: int = 0) -> None:
        self._address = f"\0{address[1:]}" if address.startswith("@") else address
        self._status = ""
        # systemd.service(5) recommends half of the time.
        self.watchdog_s = 0.5e-6 * watchdog_us if address else 0.0

    @classmethod
    def from_environment(cls) -> ServiceNotifier:
        """Return the notifier of the service that this process is, if it is one."""
        number, process = os.environ.get("WATCHDOG_USEC", ""), os.environ.get("WATCHDOG_PID", "")
        meant = process in ("", str(os.getpid()))
        watchdog_us = int(number) if number.isdecimal() and meant else 0
        return cls(os.environ.get("NOTIFY_SOCKET", ""), watchdog_us)

    def ready(self) -> None:
        """Report that the start has ended."""
        self._send("READY=1")

    def alive(self) -> None:
        """Report a sign of life for the watchdog."""
        self._send("WATCHDOG=1")

    @contextlib.contextmanager
    def long_step(self) -> Iterator[None]:
        """Report signs of life while the block keeps the executor busy, for a bounded time."""
        if not self.watchdog_s:
            yield
            return

        def report(ended: threading.Event) -> None:
            end = time.monotonic() + LONGEST_STEP_S
            while time.monotonic() < end:
                self.alive()
                if ended.wait(self.watchdog_s):
                    return

        with side_thread("signs of life", report):
            yield

    def status(self, sentence: str) -> None:
        """Report a sentence that ``systemctl status`` shows."""
        if sentence != self._status:
            self._status = sentence
            self._send("STATUS=" + " ".join(sentence.split()))

    def stopping(self) -> None:
        """Report that the process is about to end."""
        self._send("STOPPING=1")

    def _send(self, message: str) -> None:
        if not self._address:
            return
        # A supervisor that has gone must not end the process.
        with (
            contextlib.suppress(OSError),
            socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sender,
        ):
            sender.sendto(message.encode(), socket.MSG_DONTWAIT, self._address)
