# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The age of the input: the time since the last usable observation. No ROS in here.

A message that is rejected, or whose objects are all rejected, does not count. With simulated time
the age is measured on the simulated clock, so that a slow or briefly paused simulation does not
make the input stale; once that clock has stood still for a while, the machine's clock is used.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

CLOCK_PATIENCE = 3.0
"""Input timeouts of the machine's time after which a simulated clock that stands still is not
waited for any longer; chosen: a step of a slow simulator is shorter."""


@dataclass(frozen=True)
class InputAge:
    """The age of the input, and why messages were rejected.

    Attributes:
        usable: whether there was a usable observation since the activation.
        age_s: time since the last usable observation, without one since the activation (s).
        rejected: messages since then, none of them usable.
        reason: why the last of them was rejected.
        clock_stands_s: how long the simulated clock has stood still (s of the machine's time), 0.0
            while it moves and without simulated time.
        clock_seen: whether the simulated clock has ever shown a time.
    """

    usable: bool = False
    age_s: float = 0.0
    rejected: int = 0
    reason: str = ""
    clock_stands_s: float = 0.0
    clock_seen: bool = True


class InputWatch:
    """Keeps the time of the last usable observation; thread-safe.

    Args:
        machine_clock: monotonic time (s).
    """

    def __init__(self, machine_clock: Callable[[], float] = time.monotonic) -> None:
        self._machine_clock = machine_clock
        self._lock = threading.Lock()
        self._simulated_ns: int | None = None  # None: the node uses the machine's time
        self._moved_s = machine_clock()  # when the simulated clock last moved
        self.start()

    def start(self) -> None:
        """Start again, as at an activation: no observation has come yet."""
        with self._lock:
            self._usable = False
            self._rejected, self._reason = 0, ""
            self._mark()

    def accept(self) -> None:
        """Note a usable observation."""
        with self._lock:
            self._usable = True
            self._rejected, self._reason = 0, ""
            self._mark()

    def reject(self, reason: str) -> None:
        """Note a message that was not usable."""
        with self._lock:
            self._rejected += 1
            self._reason = reason

    def set_simulated_time(self, simulated_ns: int | None) -> None:
        """Note the simulated time (ns), 0 before the first and None without one; call often."""
        with self._lock:
            changed = simulated_ns != self._simulated_ns
            if changed and not (simulated_ns and self._simulated_ns):
                # Another clock, or its first time: it cannot be compared with earlier times.
                self._marked_ns = simulated_ns
            elif simulated_ns and self._simulated_ns and self._marked_ns is not None:
                # When the clock is set back, the mark is moved with it, so that the age continues
                # to grow at once, not only when the clock has reached its old time again.
                self._marked_ns -= max(0, self._simulated_ns - simulated_ns)
            if changed or simulated_ns is None:
                self._moved_s = self._machine_clock()
            self._simulated_ns = simulated_ns

    def age(self, timeout_s: float) -> InputAge:
        """Return the age of the input.

        Args:
            timeout_s: age from which on an input is stale (s); it scales the patience with a
                clock that stands still.
        """
        with self._lock:
            now_s = self._machine_clock()
            age_s = now_s - self._marked_s
            simulated_ns = self._simulated_ns
            stands_s = 0.0 if simulated_ns is None else now_s - self._moved_s
            dead = stands_s > CLOCK_PATIENCE * timeout_s
            if simulated_ns is not None and self._marked_ns is not None and not dead:
                age_s = min(age_s, max(0.0, (simulated_ns - self._marked_ns) * 1e-9))
            return InputAge(
                usable=self._usable,
                age_s=age_s,
                rejected=self._rejected,
                reason=self._reason,
                clock_stands_s=stands_s,
                clock_seen=simulated_ns != 0,
            )

    def _mark(self) -> None:
        """Count the age from now on both clocks."""
        self._marked_s, self._marked_ns = self._machine_clock(), self._simulated_ns
