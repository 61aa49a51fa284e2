# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Marker ids of agents, stable from message to message."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.history.track_index import SortKeyArray, find_sort_keys, sort_keys

MODES_PER_AGENT = 256
"""A marker's id is the agent's slot times this plus the mode; modes are counted in a byte."""

_MAX_SLOT = (1 << 31) // MODES_PER_AGENT


@dataclass
class MarkerTracker:
    """Keeps marker ids stable from message to message, and finds the markers to delete.

    An agent has one slot for as long as it is predicted; slots are not reused before all have been
    used, so a display never shows two agents as one.
    """

    _names: SortKeyArray = field(default_factory=lambda: np.empty(0, dtype="S16"))
    _slots: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    _drawn: set[tuple[str, int]] = field(default_factory=set)
    _next: int = 0

    def slots(self, key: NDArray[np.uint32]) -> list[int]:
        """Return the slots of [n, 4] different keys; agents not among them lose theirs."""
        names = sort_keys(key)
        place = find_sort_keys(self._names, names)
        slots = np.full(len(names), -1, dtype=np.int64)
        slots[place >= 0] = self._slots[place[place >= 0]]
        taken = set(slots[place >= 0].tolist())
        for row in np.flatnonzero(place < 0):
            while self._next in taken:
                self._next = (self._next + 1) % _MAX_SLOT
            slots[row] = self._next
            self._next = (self._next + 1) % _MAX_SLOT
        order = np.argsort(names, kind="stable")
        self._names, self._slots = names[order], slots[order]
        return slots.tolist()

    def stale(self, drawn: set[tuple[str, int]]) -> list[tuple[str, int]]:
        """Return namespace and id of the markers of the last message that are not in this one."""
        gone = sorted(self._drawn - drawn)
        self._drawn = drawn
        return gone
