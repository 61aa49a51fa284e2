# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Bounds what a single track may change."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.schema import Float64Array, IndexArray

_FORGOTTEN = 5.0
"""Time constants after which an unseen track is dropped; chosen: 0.7 % is left then."""


class TrackLimits:
    """Sums what each track has changed, with exponential forgetting, and cuts off the surplus.

    Args:
        memory_s: time constant (s).
        places: number of values that each track may change.
    """

    def __init__(self, memory_s: float, places: int) -> None:
        self._memory_s, self._places = memory_s, places
        self._number: NDArray[np.int64] = np.empty(0, dtype=np.int64)
        self._idle_s = np.empty(0)
        self._sum = np.empty((0, places))

    def __len__(self) -> int:
        return len(self._number)

    def pass_time(self, seconds: float) -> None:
        """Forget by the time that has passed (s)."""
        self._sum *= math.exp(-seconds / self._memory_s)
        self._idle_s += seconds
        keep = self._idle_s < _FORGOTTEN * self._memory_s
        if not keep.all():
            self._number, self._idle_s = self._number[keep], self._idle_s[keep]
            self._sum = self._sum[keep]

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
            tracks: [t] ascending numbers of tracks.
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
        """Return the rows of ascending tracks, which are added if they are new."""
        new = np.setdiff1d(tracks, self._number, assume_unique=True)
        if len(new):
            number = np.concatenate([self._number, new])
            order = np.argsort(number)
            self._number = number[order]
            self._idle_s = np.concatenate([self._idle_s, np.zeros(len(new))])[order]
            self._sum = np.concatenate([self._sum, np.zeros((len(new), self._places))])[order]
        row = np.searchsorted(self._number, tracks)
        self._idle_s[row] = 0.0
        return row
