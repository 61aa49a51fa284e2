# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Lateral position in the lane and on the road, from lane lines (paper, lane position, eq. (3)).

The paper assumes straight lanes along x: d_l is the distance from the lane's left line divided by
the lane's width, scaled to [-1, 1] (-1 on the left line, 1 on the right one), and d_r the same
with the outermost lines of the road. Here lines are polylines of any shape. They are intersected
with the line through the agent at right angles to its heading; the intersections replace the
paper's lateral coordinates. For straight parallel lines and a heading along them, this is the
paper's formula.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.frames import Pose2
from mtpgo_core.scene.segment_grid import SegmentGrid
from mtpgo_core.schema import Float64Array, IndexArray

_POINTS_AT_ONCE = 500_000
"""Most pairs of agent and segment per pass, which limits the memory to some 100 MB; chosen."""

MAX_ANGLE_RAD = np.radians(60.0)
"""A line whose direction differs more from the agent's heading belongs to another road (rad);
chosen: a vehicle that changes its lane or turns in stays below it."""

_SMALL = 256
"""Segments from which on a grid finds those beside an agent; measured: with fewer, all are as
fast."""

_REACH_M = 40.0
"""A road reaches at most this far to either side of an agent where a grid finds its lines (m);
chosen: eleven lanes."""


class LaneSides(NamedTuple):
    """The lane around each of p points; NaN where there is none.

    Attributes:
        left_m: [p] lateral distance to the lane's left line, at right angles to the heading (m).
        right_m: [p] the same to its right line, negative (m).
        turn_rad: [p] direction of the lane relative to the heading, counter-clockwise (rad).
    """

    left_m: Float64Array
    right_m: Float64Array
    turn_rad: Float64Array


class LaneMap:
    """Lane lines of a site.

    A line runs in the driving direction of the lanes next to it; lines that run against the
    agent's heading belong to the opposite carriageway and are ignored.

    Args:
        lines: polylines [k, 2] in the fixed frame (m), k >= 2.
        max_lane_width_m: a wider gap between two lines is not a lane: the road ends there (m).

    Raises:
        ConfigurationError: a line with fewer than two points or a point that is not finite.
    """

    def __init__(self, lines: Sequence[Float64Array], max_lane_width_m: float = 8.0) -> None:
        starts, ends = [], []
        for number, points in enumerate(lines):
            line = np.asarray(points, dtype=np.float64)
            if line.ndim != 2 or line.shape[0] < 2 or line.shape[1] != 2:
                raise ConfigurationError(
                    f"lane line {number} has shape {line.shape}, expected [k, 2] with k >= 2"
                )
            if not np.isfinite(line).all():
                raise ConfigurationError(f"lane line {number} has a point that is not finite")
            starts.append(line[:-1])
            ends.append(line[1:])
        self._start = np.concatenate(starts) if starts else np.zeros((0, 2))
        self._along = (np.concatenate(ends) if ends else np.zeros((0, 2))) - self._start
        self._max_width_m = max_lane_width_m
        self._length = np.hypot(self._along[:, 0], self._along[:, 1])
        self._pose: Pose2 | None = None
        self._grid: SegmentGrid | None = None
        if len(self) > _SMALL and SegmentGrid.fits(self._along):
            self._grid = SegmentGrid(self._start, self._along)

    def __len__(self) -> int:
        return self._start.shape[0]

    def seen_from(self, pose: Pose2) -> LaneMap:
        """Return the same lines for positions in another frame.

        Args:
            pose: that frame in the frame of the lines.
        """
        other = copy.copy(self)
        other._pose = pose
        return other

    def positions(self, position: Float64Array, yaw: Float64Array) -> Float64Array:
        """Return [..., 2] d_l and d_r in [-1, 1]; NaN where there is no line on one side.

        Args:
            position: [..., 2] in the fixed frame (m).
            yaw: [...] headings (rad); NaN gives NaN.
        """
        points, headings = self._placed(position.reshape(-1, 2), yaw.reshape(-1))
        result = np.full((points.shape[0], 2), np.nan)
        for some in self._blocks(points, headings):
            result[some] = self._positions(points[some], headings[some])
        return result.reshape(position.shape)

    def sides(self, position: Float64Array, yaw: Float64Array) -> LaneSides:
        """Return the lane that each point is in.

        Args:
            position: [p, 2] in the fixed frame (m).
            yaw: [p] headings (rad); NaN gives NaN.
        """
        points, headings = self._placed(position, yaw)
        result = np.full((3, points.shape[0]), np.nan)
        for some in self._blocks(points, headings):
            result[:, some] = self._sides(points[some], headings[some])
        return LaneSides(*result)

    def _placed(
        self, position: Float64Array, yaw: Float64Array
    ) -> tuple[Float64Array, Float64Array]:
        """Return positions and headings in the frame of the lines."""
        if self._pose is None:
            return position, yaw
        return self._pose.point(position), yaw + self._pose.yaw

    def _blocks(self, points: Float64Array, headings: Float64Array) -> Iterator[IndexArray]:
        """Yield the indices of the known points, in blocks that bound the memory."""
        if not len(self):
            return
        known = np.flatnonzero(np.isfinite(points).all(axis=1) & np.isfinite(headings))
        step = max(1, _POINTS_AT_ONCE // min(len(self), _SMALL if self._grid else len(self)))
        for begin in range(0, known.shape[0], step):
            yield known[begin : begin + step]

    def distance_m(self, position: Float64Array) -> float:
        """Return the smallest distance of the points [p, 2] from a line (m), inf without any.

        With many lines a grid is used, and the result may be too small by the diagonal of a cell
        (23 m).
        """
        if not len(self) or not len(position):
            return float("inf")
        if self._pose is not None:
            position = self._pose.point(position)
        if self._grid is not None:
            return self._grid.distance_m(position)
        squared = np.maximum(self._length**2, 1e-18)
        to_point = position[:, None] - self._start
        share = np.clip((to_point * self._along).sum(axis=2) / squared, 0.0, 1.0)
        away = to_point - share[..., None] * self._along
        return float(np.hypot(away[..., 0], away[..., 1]).min())

    def _positions(self, point: Float64Array, yaw: Float64Array) -> Float64Array:
        """Return [p, 2] d_l and d_r of points that are all known."""
        offsets, _ = self._offsets(point, yaw)
        left = np.sort(offsets, axis=1)  # rightmost line first, inf: no line
        beyond = (left >= 0.0) & np.isfinite(left)
        first_left = np.argmax(beyond, axis=1)
        inside = beyond.any(axis=1) & (first_left > 0)
        rows = np.arange(point.shape[0])
        first_left = np.maximum(first_left, 1)
        lane_left, lane_right = left[rows, first_left], left[rows, first_left - 1]
        with np.errstate(invalid="ignore"):
            wide = ~(np.diff(left, axis=1) <= self._max_width_m)
        # The road extends to the left and right as long as the gaps are lanes.
        gap = np.arange(wide.shape[1])
        after = np.where(wide & (gap >= first_left[:, None]), gap, wide.shape[1]).min(axis=1)
        before = np.where(wide & (gap <= first_left[:, None] - 2), gap, -1).max(axis=1)
        road_left, road_right = left[rows, after], left[rows, before + 1]
        with np.errstate(invalid="ignore", divide="ignore"):
            inside &= lane_left - lane_right <= self._max_width_m
            lane = 2.0 * lane_left / (lane_left - lane_right) - 1.0
            road = 2.0 * road_left / (road_left - road_right) - 1.0
        both = np.clip(np.stack([lane, road], axis=1), -1.0, 1.0)
        return np.where(inside[:, None], both, np.nan)

    def _sides(self, point: Float64Array, yaw: Float64Array) -> Float64Array:
        """Return [3, p] the fields of :class:`LaneSides` for points that are all known."""
        offsets, turns = self._offsets(point, yaw, self._max_width_m)
        rows = np.arange(point.shape[0])
        to_left = np.where(offsets >= 0.0, offsets, np.inf)
        to_right = np.where(offsets < 0.0, offsets, -np.inf)
        at_left, at_right = to_left.argmin(axis=1), to_right.argmax(axis=1)
        left, right = to_left[rows, at_left], to_right[rows, at_right]
        inside = np.isfinite(left) & np.isfinite(right)
        inside &= np.where(inside, left, 0.0) - np.where(inside, right, 0.0) <= self._max_width_m
        left, right = np.where(inside, left, np.nan), np.where(inside, right, np.nan)
        share = left / (left - right)  # 0 on the left line, 1 on the right one
        turn = (1.0 - share) * turns[rows, at_left] + share * turns[rows, at_right]
        return np.stack([left, right, turn])

    def _offsets(
        self, point: Float64Array, yaw: Float64Array, reach_m: float = _REACH_M
    ) -> tuple[Float64Array, Float64Array]:
        """Return [p, k] lateral offsets (m) and turns (rad) of the segments beside each point.

        An offset is positive to the left; a turn is the segment's direction relative to the
        heading. Unused columns are inf (offset) and 0 (turn); there are at least two of them, so
        that callers need not handle empty arrays. A joint of two segments counts once.

        Args:
            point: [p, 2] (m).
            yaw: [p] headings (rad).
            reach_m: a grid finds the segments as far as this to either side (m).
        """
        forward = np.stack([np.cos(yaw), np.sin(yaw)], axis=1)
        if self._grid is None:
            who, segment = np.divmod(np.arange(len(point) * len(self)), len(self))
        else:
            sideways = np.stack([-forward[:, 1], forward[:, 0]], axis=1)
            who, segment = self._grid.beside(point, sideways, reach_m)
        to_start, along = self._start[segment] - point[who], self._along[segment]
        cos, sin = forward[who, 0], forward[who, 1]
        ahead = to_start[:, 0] * cos + to_start[:, 1] * sin
        advance = along[:, 0] * cos + along[:, 1] * sin
        met = (ahead <= 0.0) & (ahead + advance > 0.0)  # starts behind the agent, ends ahead of it
        met &= advance >= np.cos(MAX_ANGLE_RAD) * self._length[segment]
        # Of a pair that was found twice, the first counts.
        kept = np.flatnonzero(met)
        kept = kept[np.unique(who[kept] * len(self) + segment[kept], return_index=True)[1]]
        who, to_start, along = who[kept], to_start[kept], along[kept]
        cos, sin, advance = cos[kept], sin[kept], advance[kept]
        fraction = -ahead[kept] / advance
        at = to_start + fraction[:, None] * along
        number = np.bincount(who, minlength=len(point))
        offsets = np.full((len(point), int(number.max(initial=0)) + 2), np.inf)
        column = np.arange(len(who)) - np.repeat(np.cumsum(number) - number, number)
        offsets[who, column] = at[:, 1] * cos - at[:, 0] * sin
        turns = np.zeros_like(offsets)
        turns[who, column] = np.arctan2(along[:, 1] * cos - along[:, 0] * sin, advance)
        return offsets, turns
