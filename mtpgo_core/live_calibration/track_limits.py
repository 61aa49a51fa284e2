# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Limits on the changes that a single track may make."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.schema import Float64Array, IndexArray

_FORGOTTEN = 5.0
"""Time constants after which an unseen track is dropped; chosen: 0.7 % is left then."""

_CAPACITY = 1024
"""Tracks for which there is room at first: 64 road users that stay 20 s each need 900."""


class TrackLimits:
    """Sums the changes by each track, with exponential forgetting, and clips them at a limit.

    Args:
        places: number of values that each track may change.
    """

    def __init__(self, places: int) -> None:
        self._places = places
        self._row_of: dict[int, int] = {}
        self._free = list(range(_CAPACITY))
        self._idle_s = np.zeros(_CAPACITY)
        # Allocated once: growing it with each new track would copy more than a megabyte.
        self._sum = np.zeros((_CAPACITY, places))

    def __len__(self) -> int:
        return len(self._row_of)

    def pass_time(self, seconds: float, memory_s: float) -> None:
        """Forget by the time that has passed (s), with a time constant (s)."""
        self._sum *= math.exp(-seconds / memory_s)
        self._idle_s += seconds
        longest = _FORGOTTEN * memory_s
        gone = [track for track, row in self._row_of.items() if self._idle_s[row] >= longest]
        for track in gone:
            row = self._row_of.pop(track)
            self._sum[row] = 0.0
            self._free.append(row)

    def limited(
        self,
        tracks: NDArray[np.int64],
        row: IndexArray,
        place: IndexArray,
        change: Float64Array,
        limit: Float64Array,
    ) -> Float64Array:
        """Return [m] the part of changes that is within the limits, and count it.

        Args:
            tracks: [t] numbers of tracks, each once.
            row: [m] positions there.
            place: [m] flat positions on the other axes.
            change: [m] wanted changes; several of one track and place count together.
            limit: [m] largest absolute sum.
        """
        rows = self._rows(tracks)
        cell = row * self._places + place
        cells = len(tracks) * self._places
        wanted = np.bincount(cell, change, cells)
        largest = np.zeros(cells)
        largest[cell] = limit
        before = self._sum[rows].reshape(-1)
        # A sum above a limit that has become smaller may stay, but not grow.
        bound = np.maximum(largest, np.abs(before))
        after = np.clip(before + wanted, -bound, bound)
        self._sum[rows] = after.reshape(len(rows), self._places)
        share = np.divide(after - before, wanted, out=np.zeros_like(wanted), where=wanted != 0.0)
        return np.asarray(change * share[cell])

    def _rows(self, tracks: NDArray[np.int64]) -> IndexArray:
        """Return the rows of tracks, which are added if they are new."""
        row = np.array([self._row(track) for track in tracks.tolist()], dtype=np.intp)
        self._idle_s[row] = 0.0
        return row

    def _row(self, track: int) -> int:
        if track not in self._row_of:
            if not self._free:
                self._grow()
            self._row_of[track] = self._free.pop()
        return self._row_of[track]

    def _grow(self) -> None:
        old = len(self._sum)
        self._free = list(range(old, 2 * old))
        self._idle_s = np.concatenate([self._idle_s, np.zeros(old)])
        self._sum = np.concatenate([self._sum, np.zeros((old, self._places))])
