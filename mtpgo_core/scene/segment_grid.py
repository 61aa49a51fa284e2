# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Grid of the segments of many lines, so that those beside a place are found without all others.

Every segment is in the cells within a quarter of a cell around points along it, which lie at most
a quarter of a cell apart. So the cell of a point that is within an eighth of a cell of the
segment has it.
"""

from __future__ import annotations

import numpy as np

from mtpgo_core.schema import Float64Array, IndexArray

CELL_M = 16.0
"""Edge of a cell (m); chosen: a lane line of points at each metre has a few segments in it."""

_STEP_M = 0.25 * CELL_M
_MOST_STEPS = 4_000_000
"""Most points along all segments (200 MB for a moment); longer lines have no grid."""


class SegmentGrid:
    """The segments in each cell.

    Args:
        start: [s, 2] starts of the segments (m).
        along: [s, 2] from start to end (m).
    """

    def __init__(self, start: Float64Array, along: Float64Array) -> None:
        steps = np.maximum(np.ceil(np.hypot(along[:, 0], along[:, 1]) / _STEP_M), 1).astype(int)
        segment = np.repeat(np.arange(len(start)), steps + 1)
        first = np.cumsum(steps + 1) - (steps + 1)
        share = (np.arange(len(segment)) - first[segment]) / steps[segment]
        points = start[segment] + share[:, None] * along[segment]
        self._low = points.min(axis=0) - CELL_M
        self._shape = np.floor((points.max(axis=0) - self._low) / CELL_M).astype(np.int64) + 2
        corners = np.array([(x, y) for x in (-1.0, 1.0) for y in (-1.0, 1.0)]) * _STEP_M
        codes = np.concatenate([self._codes(points + corner) for corner in corners])
        pairs = np.unique(codes * len(start) + np.tile(segment, len(corners)))
        self._cell, self._segment = np.divmod(pairs, len(start))
        self._places: Float64Array = np.unique(np.floor(points / CELL_M), axis=0) * CELL_M

    @staticmethod
    def fits(along: Float64Array) -> bool:
        """Whether the segments are few and short enough for a grid."""
        length_m = float(np.hypot(along[:, 0], along[:, 1]).sum())
        return length_m / _STEP_M + 2.0 * len(along) <= _MOST_STEPS

    def beside(
        self, point: Float64Array, sideways: Float64Array, reach_m: float
    ) -> tuple[IndexArray, IndexArray]:
        """Return pairs of a point and a segment that its lateral line may intersect.

        Args:
            point: [p, 2] (m).
            sideways: [p, 2] unit vectors along the lateral lines.
            reach_m: half the length of those lines (m).

        Returns:
            The points, ascending, and the segments of the pairs; a pair may be there twice.
        """
        count = int(np.ceil(2.0 * reach_m / _STEP_M)) + 1
        along = np.linspace(-reach_m, reach_m, count)
        places = point[:, None] + along[:, None] * sideways[:, None]
        codes = self._codes(places.reshape(-1, 2)).reshape(len(point), count)
        # Neighbours on a line are often in one cell.
        fresh = np.ones(codes.shape, dtype=np.bool_)
        fresh[:, 1:] = codes[:, 1:] != codes[:, :-1]
        who, _ = np.nonzero(fresh)
        codes = codes[fresh]
        begin = np.searchsorted(self._cell, codes, side="left")
        number = np.searchsorted(self._cell, codes, side="right") - begin
        who = np.repeat(who, number)
        offset = np.arange(len(who)) - np.repeat(np.cumsum(number) - number, number)
        return who, self._segment[np.repeat(begin, number) + offset]

    def distance_m(self, point: Float64Array) -> float:
        """Return the distance from the nearest of [p, 2] points to a segment (m).

        It is that to the cell of a segment, so that it may be the cell's diagonal too small.
        """
        smallest = np.inf
        for one in point:
            outside = np.maximum(np.maximum(self._places - one, one - self._places - CELL_M), 0.0)
            smallest = min(smallest, float(np.hypot(outside[:, 0], outside[:, 1]).min()))
        return smallest

    def _codes(self, points: Float64Array) -> IndexArray:
        """Return [n] numbers of the cells of [n, 2] points, -1 outside."""
        cell = np.floor((points - self._low) / CELL_M)
        inside = ((cell >= 0) & (cell < self._shape)).all(axis=1)
        cell = np.where(inside[:, None], cell, 0.0).astype(np.int64)
        return np.where(inside, cell[:, 0] * self._shape[1] + cell[:, 1], -1)
