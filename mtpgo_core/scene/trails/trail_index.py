# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Index of trail points by place and direction of motion, most recent first.

Each point is one 64-bit code, its cell in the upper bits and its number in the lower ones, so that
a sorted array of codes lists the points of a cell in the order of time. New codes go into a short
sorted array, which is merged into the long one from time to time.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.schema import BoolArray, Float64Array

CELL_M = 2.0
"""Side of a cell (m): a query's reach, so that the 3 x 3 cells around it contain all it wants."""
HEADING_BINS = 8
"""Bins of the direction of motion; chosen: two contain all directions within tolerance."""
PER_CELL = 16
"""Most recent points that are looked at per cell and bin; chosen, bounds the time."""

_NUMBER_BITS = 36
"""Bits of a point's number: more points than a busy junction gives in a year."""
_HASH_BITS = 63 - _NUMBER_BITS
_RECENT = 2048
"""Codes in the short array before it is merged; chosen: a merge costs as much as ten cycles."""

IntArray = NDArray[np.int64]

_AROUND = np.stack(np.meshgrid([-1, 0, 1], [-1, 0, 1])).reshape(2, 9)
"""Cells around a cell."""

LARGEST_NUMBER = (1 << _NUMBER_BITS) - 1
"""Largest number of a point that the index can hold."""


_NOTHING = np.iinfo(np.int64).max
"""Fills the long array up to its reserved length; greater than every code, and no point's."""


class TrailIndex:
    """From a cell and heading bin to the points in it.

    Args:
        reserved: number of points for which memory is taken now, so that it does not grow later.
    """

    def __init__(self, reserved: int = 0) -> None:
        self._length = reserved + 2 * _RECENT if reserved else 0
        self._long = np.full(self._length, _NOTHING, dtype=np.int64)
        self._short = np.empty(0, dtype=np.int64)

    @property
    def nbytes(self) -> int:
        """Memory of the index (bytes)."""
        return self._long.nbytes + self._short.nbytes

    def add(
        self, place: Float64Array, heading: Float64Array, number: IntArray, oldest: int
    ) -> None:
        """Add points.

        Args:
            place: [p, 2] x, y (m).
            heading: [p] directions of motion (rad).
            number: [p] their numbers, higher than all before.
            oldest: points with lower numbers are forgotten at the next merge.
        """
        cell = np.floor(place / CELL_M).astype(np.int64)
        code = _code(cell[:, 0], cell[:, 1], _bin(heading)) | number
        self._short = np.sort(np.concatenate([self._short, code]))
        if self._short.shape[0] > _RECENT:
            long = self._long[(self._long & LARGEST_NUMBER) >= oldest]
            long = np.insert(long, np.searchsorted(long, self._short), self._short)
            self._long = long[: self._length] if self._length else long
            self._short = np.empty(0, dtype=np.int64)

    def find(
        self,
        place: Float64Array,
        heading: Float64Array,
        reach_m: float,
        tolerance_rad: float,
        first: int,
        end: int,
    ) -> tuple[IntArray, IntArray]:
        """Return the points around places, the most recent ``PER_CELL`` of each cell and bin.

        All points within the reach are in these cells, and all directions within the tolerance in
        these bins; others are returned, too.

        Args:
            place: [n, 2] x, y (m).
            heading: [n] directions of motion (rad).
            reach_m: distance from the place (m), at most ``CELL_M``.
            tolerance_rad: of the direction, at most half a bin.
            first: lowest number of a point (inclusive).
            end: highest number (exclusive).

        Returns:
            [q] rows of the places and [q] numbers of points, each pair once.
        """
        cell = np.floor(place / CELL_M).astype(np.int64)
        x, y = cell[:, 0, None] + _AROUND[0], cell[:, 1, None] + _AROUND[1]  # [n, 9]
        # From the place to the nearest point of each cell.
        apart_x = np.maximum(np.abs((x + 0.5) * CELL_M - place[:, 0, None]) - 0.5 * CELL_M, 0.0)
        apart_y = np.maximum(np.abs((y + 0.5) * CELL_M - place[:, 1, None]) - 0.5 * CELL_M, 0.0)
        row, around = np.nonzero(apart_x**2 + apart_y**2 < reach_m**2)
        x, y = x[row, around], y[row, around]
        low, high = _bin(heading - tolerance_rad)[row], _bin(heading + tolerance_rad)[row]
        two = low != high
        row = np.concatenate([row, row[two]])
        code = np.concatenate([_code(x, y, low), _code(x[two], y[two], high[two])])
        short, some = _newest(self._short, code, first, end, PER_CELL)
        rest = PER_CELL - some.sum(axis=1, keepdims=True)
        long, more = _newest(self._long, code, first, end, PER_CELL)
        more &= np.arange(PER_CELL) < rest
        rows = np.broadcast_to(row[:, None], some.shape)
        return (
            np.concatenate([rows[some], rows[more]]),
            np.concatenate([short[some], long[more]]),
        )


def _newest(
    codes: IntArray, wanted: IntArray, first: int, end: int, most: int
) -> tuple[IntArray, BoolArray]:
    """Return the newest points of each wanted cell.

    Args:
        codes: ascending codes of all points.
        wanted: [q] codes of the cells, without a point number.
        first: lowest number of a point (inclusive).
        end: highest number (exclusive).
        most: points for each cell.

    Returns:
        [q, most] point numbers, the newest first, and [q, most] whether there is such a point.
    """
    if codes.shape[0] == 0:
        nothing = np.zeros((wanted.shape[0], most), dtype=np.int64)
        return nothing, nothing.astype(bool)
    last = np.searchsorted(codes, wanted | end, side="left")[:, None] - 1 - np.arange(most)
    found = codes[np.maximum(last, 0)]
    number = found & LARGEST_NUMBER
    there = (last >= 0) & (found - number == wanted[:, None]) & (number >= first)
    return number, there


def _bin(heading: Float64Array) -> IntArray:
    """Return the heading bins of angles (rad)."""
    turns = np.asarray(heading, dtype=np.float64) / (2.0 * np.pi)
    return np.floor(turns * HEADING_BINS).astype(np.int64) % HEADING_BINS


def _code(x: IntArray, y: IntArray, heading_bin: IntArray) -> IntArray:
    """Return codes with point number 0: a hash of cell and heading bin, which may collide."""
    mixed = (x * 73_856_093) ^ (y * 19_349_663) ^ (heading_bin * 83_492_791)
    mixed ^= mixed >> 15
    return (mixed & ((1 << _HASH_BITS) - 1)) << _NUMBER_BITS
