# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""From 128-bit identities to the rows of an array, for all agents of a message at once.

A key becomes one 16-byte name whose byte order is the order of the numbers, so numpy sorts and
searches whole messages of keys exactly, without hashing and without a loop over agents.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.schema import BoolArray, KeyArray

NameArray = NDArray[np.bytes_]


def names_of(key: KeyArray) -> NameArray:
    """[n] 16-byte names of [n, 4] keys; equal exactly where the keys are, sorted as they are."""
    words = np.ascontiguousarray(key[:, ::-1], dtype=">u4")
    return words.view("S16").reshape(-1)


def find_names(table: NameArray, names: NameArray) -> NDArray[np.intp]:
    """[n] positions of ``names`` in the sorted ``table``, -1 where absent."""
    if table.shape[0] == 0:
        return np.full(names.shape[0], -1, dtype=np.intp)
    position = np.minimum(np.searchsorted(table, names), table.shape[0] - 1)
    return np.where(table[position] == names, position, -1)


class TrackTable:
    """Sorted names and the slot that each one owns.

    Attributes:
        names: [m] sorted names.
        slots: [m] their slots.
    """

    def __init__(self) -> None:
        self.names: NameArray = np.empty(0, dtype="S16")
        self.slots: NDArray[np.intp] = np.empty(0, dtype=np.intp)

    def __len__(self) -> int:
        return self.names.shape[0]

    def find(self, names: NameArray) -> NDArray[np.intp]:
        """[n] slots of ``names``, -1 where absent."""
        position = find_names(self.names, names)
        if len(self) == 0:
            return position
        return np.where(position >= 0, self.slots[position], -1)

    def add(self, names: NameArray, slots: NDArray[np.intp]) -> None:
        """Enter sorted ``names``, none of which is in the table, with their ``slots``."""
        place = np.searchsorted(self.names, names)
        self.names = np.insert(self.names, place, names)
        self.slots = np.insert(self.slots, place, slots)

    def remove(self, rows: BoolArray) -> NDArray[np.intp]:
        """Take the rows that the mask names out of the table and return their slots."""
        freed = self.slots[rows]
        self.names = self.names[~rows]
        self.slots = self.slots[~rows]
        return freed
