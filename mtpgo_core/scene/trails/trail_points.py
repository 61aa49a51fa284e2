# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Storage of the trails: a ring of points, the oldest overwritten, in the order of their times."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.schema import Float32Array

IntArray = NDArray[np.int64]

_FIRST_SIZE = 4096
"""Points of a new ring; it doubles on demand."""


@dataclass
class PointColumns:
    """One value for each of p points.

    Attributes:
        offset: [p, 2] x, y from the memory's origin (m).
        heading: [p] direction of motion (rad).
        time_ns: [p] when the point became known (ns).
        owner: [p] hash of the road user's identity.
        trail: [p] number of the trail.
        following: [p] how many points later the trail's next point was stored, 0 for none.
        group: [p] class group, see :mod:`mtpgo_core.scene.trails.class_groups`.
    """

    offset: Float32Array
    heading: Float32Array
    time_ns: IntArray
    owner: NDArray[np.uint32]
    trail: NDArray[np.int32]
    following: NDArray[np.int32]
    group: NDArray[np.uint8]

    @classmethod
    def empty(cls, size: int) -> PointColumns:
        """Return columns of ``size`` points, all zero."""
        return cls(
            offset=np.zeros((size, 2), np.float32),
            heading=np.zeros(size, np.float32),
            time_ns=np.zeros(size, np.int64),
            owner=np.zeros(size, np.uint32),
            trail=np.zeros(size, np.int32),
            following=np.zeros(size, np.int32),
            group=np.zeros(size, np.uint8),
        )

    @property
    def nbytes(self) -> int:
        """Memory of all columns (bytes)."""
        return sum(column.nbytes for column in vars(self).values())


class TrailPoints:
    """Ring of up to ``capacity`` points, numbered in the order in which they were stored.

    A point's number never changes and identifies it forever; ``oldest`` is the number of the
    first one that is still stored. Times never descend, so the points known at a time are those
    with a number below :meth:`known_at`.

    Args:
        capacity: limit of the memory (points).
        reserved: take all memory now, so that it does not grow later.

    Attributes:
        count: points ever stored; the number of the next one.
    """

    def __init__(self, capacity: int, *, reserved: bool = False) -> None:
        self._capacity = capacity
        self._columns = PointColumns.empty(capacity if reserved else min(_FIRST_SIZE, capacity))
        if reserved:
            for column in vars(self._columns).values():
                column.fill(0)  # the system gives memory when it is written to
        self.count = 0

    @property
    def oldest(self) -> int:
        """Number of the oldest point that is still stored."""
        return max(0, self.count - self._size)

    @property
    def nbytes(self) -> int:
        """Memory of the points (bytes)."""
        return self._columns.nbytes

    @property
    def _size(self) -> int:
        return self._columns.time_ns.shape[0]

    def append(self, new: PointColumns) -> IntArray:
        """Store points whose times do not descend; return [p] their numbers.

        Of more points than the capacity, the last ones are kept.
        """
        number = self.count + np.arange(new.time_ns.shape[0], dtype=np.int64)
        self._make_room(self.count + number.shape[0])
        kept = number[-self._size :]
        slot = kept % self._size
        for name, column in vars(self._columns).items():
            column[slot] = getattr(new, name)[number.shape[0] - kept.shape[0] :]
        self.count += number.shape[0]
        return number

    def link(self, number: IntArray, following: IntArray) -> None:
        """Make the points ``following`` the next ones of ``number``, where those are stored."""
        stored = number >= self.oldest
        slot = number[stored] % self._size
        self._columns.following[slot] = (following - number)[stored]

    def column(self, name: str, number: IntArray) -> NDArray[Any]:
        """Return one column of points that are stored."""
        column: NDArray[Any] = getattr(self._columns, name)
        return column.take(number if self.count <= self._size else number % self._size, axis=0)

    def known_at(self, time_ns: int) -> int:
        """Return the number below which all points were known at ``time_ns`` (inclusive)."""
        return self._before(time_ns, "right")

    def since(self, time_ns: int) -> int:
        """Return the number of the first point that became known at ``time_ns`` or later."""
        return self._before(time_ns, "left")

    def _before(self, time_ns: int, side: Any) -> int:
        times, oldest = self._columns.time_ns[: self.count], self.oldest
        turn = oldest % self._size  # the ring's oldest entry
        older, newer = times[turn:], times[:turn]
        place = int(np.searchsorted(older, time_ns, side))
        if place == older.shape[0]:
            place += int(np.searchsorted(newer, time_ns, side))
        return oldest + place

    def _make_room(self, wanted: int) -> None:
        """Grow while the ring has not been closed."""
        size = self._size
        while size < min(wanted, self._capacity):
            size = min(2 * size, self._capacity)
        if size > self._size:
            old, self._columns = self._columns, PointColumns.empty(size)
            for name, column in vars(old).items():
                getattr(self._columns, name)[: self.count] = column[: self.count]
