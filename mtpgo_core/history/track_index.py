# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Index from 128-bit identities to slots, for all agents of a message at once.

An identity becomes one 16-byte sort key whose byte order is the order of the numbers, so numpy
sorts and searches the identities of a whole message exactly, without hashing or a loop.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.schema import BoolArray, IndexArray, KeyArray

SortKeyArray = NDArray[np.bytes_]


def sort_keys(key: KeyArray) -> SortKeyArray:
    """Return 16-byte sort keys [n] of identities [n, 4], in the order of the 128-bit numbers."""
    words = np.ascontiguousarray(key[:, ::-1], dtype=">u4")
    return words.view("S16").reshape(-1)


def find_sort_keys(table: SortKeyArray, wanted: SortKeyArray) -> IndexArray:
    """Return [n] positions of the ``wanted`` keys in the sorted ``table``, -1 where absent."""
    if table.shape[0] == 0:
        return np.full(wanted.shape[0], -1, dtype=np.intp)
    position = np.minimum(np.searchsorted(table, wanted), table.shape[0] - 1)
    return np.where(table[position] == wanted, position, -1)


class TrackIndex:
    """Sorted identities and the slot of each.

    Attributes:
        keys: [m] ascending sort keys.
        slots: [m] their slots.
    """

    def __init__(self) -> None:
        self.keys: SortKeyArray = np.empty(0, dtype="S16")
        self.slots: IndexArray = np.empty(0, dtype=np.intp)

    def __len__(self) -> int:
        return self.keys.shape[0]

    def find(self, wanted: SortKeyArray) -> IndexArray:
        """Return [n] slots of the ``wanted`` keys, -1 where absent."""
        position = find_sort_keys(self.keys, wanted)
        if len(self) == 0:
            return position
        return np.where(position >= 0, self.slots[position], -1)

    def add(self, keys: SortKeyArray, slots: IndexArray) -> None:
        """Insert ascending ``keys``, none of which is in the index yet, with their ``slots``."""
        place = np.searchsorted(self.keys, keys)
        self.keys = np.insert(self.keys, place, keys)
        self.slots = np.insert(self.slots, place, slots)

    def remove(self, rows: BoolArray) -> IndexArray:
        """Remove the rows of a mask and return their slots."""
        freed = self.slots[rows]
        self.keys = self.keys[~rows]
        self.slots = self.slots[~rows]
        return freed
