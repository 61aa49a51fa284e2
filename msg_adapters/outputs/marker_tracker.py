# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Which marker id belongs to which agent, from message to message."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

MODES_PER_AGENT = 256
"""A marker's id is the agent's slot times this plus the mode."""

_MAX_SLOT = (1 << 31) // MODES_PER_AGENT


@dataclass
class MarkerTracker:
    """Keeps marker ids stable from message to message and knows what must be deleted.

    An agent holds one slot for as long as it is predicted; slots are not reused before all are
    spent, so a display never mixes two agents up.
    """

    _slots: dict[bytes, int] = field(default_factory=dict)
    _drawn: set[tuple[str, int]] = field(default_factory=set)
    _next: int = 0

    def slots(self, key: NDArray[np.uint32]) -> list[int]:
        """The slot of each of [n, 4] keys; agents not among them lose theirs."""
        names = [row.tobytes() for row in key]
        kept = {name: self._slots[name] for name in names if name in self._slots}
        taken = set(kept.values())
        for name in names:
            if name not in kept:
                while self._next in taken:
                    self._next = (self._next + 1) % _MAX_SLOT
                kept[name] = self._next
                self._next = (self._next + 1) % _MAX_SLOT
        self._slots = kept
        return [kept[name] for name in names]

    def stale(self, drawn: set[tuple[str, int]]) -> list[tuple[str, int]]:
        """Namespace and id of what stood in the last message and does not in this one."""
        gone = sorted(self._drawn - drawn)
        self._drawn = drawn
        return gone

    def clear(self) -> None:
        """Forget everything, after a :func:`clear_markers` message."""
        self._slots, self._drawn = {}, set()
