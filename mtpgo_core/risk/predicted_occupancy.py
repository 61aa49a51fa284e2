# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The probability of each cell of a grid to be covered by a predicted road user.

A cell is covered at a step when the footprint covers any part of the cell's inscribed circle or
its middle: the footprint is widened by half a cell on each side. Footprints of different road
users do not overlap, so the probabilities of road users add up; of several steps the largest
counts.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from mtpgo_core.class_size import known_sizes
from mtpgo_core.frames import along_and_across
from mtpgo_core.options import check_options, option
from mtpgo_core.risk.collision_risk import WEIGHT_TOLERANCE, known_poses
from mtpgo_core.schema import Float32Array, Float64Array, IndexArray, Prediction

_REACH = 3.0
"""Standard deviations around a footprint within which cells are filled. Chosen: what is left out
is below 0.3 % of a mode, and values have steps of 1 %."""

_LEAST_WEIGHT = 0.01
"""Modes lighter than this are left out; chosen as the step of the values."""

_CELLS_AT_A_TIME = 20_000
"""Cells of footprints that are computed together; chosen so that they stay in the cache."""

MOST_CELLS = 20_000_000
"""Most cells of all footprints, modes and steps with their errors; chosen: each takes 0.1 us
(measured), so that a grid comes within some two seconds. The 64 road users of the benchmark need
less than a million."""

_LEAST_VARIANCE = 1e-4
"""Smaller variances count as this, in squares of a cell: a hundredth of a cell."""

_FLAT = np.float32(6.0)
"""Beyond, the distribution function of the standard normal is flat in float32 (chosen)."""


@dataclass(frozen=True)
class GridShape:
    """A square grid around a place, whose cells lie on multiples of the resolution.

    Attributes:
        side: length of a side (m).
        resolution: length of a cell (m).
    """

    side: float = option(100.0, low=1.0, high=1000.0)
    resolution: float = option(0.5, low=0.05, high=10.0)

    def __post_init__(self) -> None:
        check_options(self)

    @property
    def cells(self) -> int:
        """Cells along a side."""
        return max(1, round(self.side / self.resolution))

    def corner(self, center: Float64Array) -> Float64Array:
        """Return [2] the lower left corner of the grid around a place (m)."""
        snapped = np.round(center / self.resolution) * self.resolution
        return np.asarray(snapped - (self.cells // 2) * self.resolution)


@dataclass(frozen=True)
class OccupancyField:
    """Occupancy of a grid's cells.

    Attributes:
        corner: [2] lower left corner (m).
        resolution: length of a cell (m).
        probability: [rows, columns] of each cell to be covered, rows along y; NaN where unknown.
        unknown_agents: number of agents whose prediction is not known, because of whom the whole
            field is unknown.
        begins_beyond: the predictions do not reach the window, because of which it is unknown.
        too_many_cells: cells of all footprints with their errors, because of which it is unknown:
            computing it would take longer than it is of use; 0 where they are few enough.
    """

    corner: Float64Array
    resolution: float
    probability: Float64Array
    unknown_agents: int = 0
    begins_beyond: bool = False
    too_many_cells: int = 0


def unknown_field(shape: GridShape, center: Float64Array, agents: int = 0) -> OccupancyField:
    """Return a field of which nothing is known, because of a number of agents."""
    nothing = np.full((shape.cells, shape.cells), np.nan)
    return OccupancyField(shape.corner(center), shape.resolution, nothing, agents)


def predicted_occupancy(
    prediction: Prediction, shape: GridShape, center: Float64Array, begin_s: float, end_s: float
) -> OccupancyField:
    """Return the largest occupancy of each cell over the steps of a time window.

    Args:
        prediction: without the ego itself.
        shape: of the grid.
        center: [2] its middle (m).
        begin_s: first time after the prediction's stamp (s); with a window between two steps,
            the step nearest to its middle counts.
        end_s: last time. What is beyond the last step is not known and does not count.
    """
    if len(prediction) and begin_s > reach_s(prediction.time_s):
        return dataclasses.replace(unknown_field(shape, center), begins_beyond=True)
    chosen = _steps_within(prediction.time_s, begin_s, end_s)
    corner, cells = shape.corner(center), shape.cells
    weighty = prediction.weight > _LEAST_WEIGHT
    finite = known_poses(prediction)[:, :, chosen].all(axis=2)
    lost = (weighty & ~finite).any(axis=1)
    with np.errstate(invalid="ignore"):  # an infinite weight; NaN is lost too
        lost |= ~(np.abs(prediction.weight.sum(axis=1) - 1.0) <= WEIGHT_TOLERANCE)
    if lost.any():
        return unknown_field(shape, center, int(lost.sum()))
    size = known_sizes(prediction.size, prediction.agent_class)
    field = np.zeros(cells * cells)
    agent, mode = np.nonzero(weighty)
    ranges = [
        _cell_range(
            prediction.mean[agent, mode, step, :2] - corner,
            prediction.covariance[agent, mode, step],
            size[agent],
            shape,
        )
        for step in chosen
    ]
    number = sum(int(np.prod(last - first, axis=1).sum()) for first, last in ranges)
    if number > MOST_CELLS:
        return dataclasses.replace(unknown_field(shape, center), too_many_cells=number)
    for step, (first, last) in zip(chosen, ranges, strict=True):
        now = np.zeros(cells * cells)
        mean = prediction.mean[agent, mode, step, :2] - corner
        spread = prediction.covariance[agent, mode, step]
        boxes = _boxes(
            mean / shape.resolution - 0.5,
            spread / shape.resolution**2,
            prediction.yaw[agent, mode, step],
            size[agent] / shape.resolution + 1.0,
            prediction.weight[agent, mode],
        )
        for rows in _parts(np.prod(last - first, axis=1)):
            row, column, line = _cells(first[rows], last[rows])
            covered = _covered(column, line, boxes[rows][row])
            now += np.bincount(line * cells + column, weights=covered, minlength=cells * cells)
        np.maximum(field, now, out=field)
    np.minimum(field, 1.0, out=field)
    return OccupancyField(corner, shape.resolution, field.reshape(cells, cells))


def reach_s(time_s: Float64Array) -> float:
    """Return until when the last of [H] steps stands for what is predicted: half a step later."""
    if not len(time_s):
        return 0.0
    before_s = float(time_s[-2]) if len(time_s) > 1 else 0.0
    return float(time_s[-1]) + 0.5 * (float(time_s[-1]) - before_s)


def _steps_within(time_s: Float64Array, begin_s: float, end_s: float) -> IndexArray:
    """Return the steps of a time window, else the one nearest to its middle."""
    slack_s = 1e-3  # times are float32 in messages
    found = np.flatnonzero((time_s >= begin_s - slack_s) & (time_s <= end_s + slack_s))
    if len(found) or not len(time_s):
        return found
    return np.array([np.abs(time_s - 0.5 * (begin_s + end_s)).argmin()])


def _cell_range(
    mean: Float64Array, spread: Float64Array, size: Float64Array, shape: GridShape
) -> tuple[IndexArray, IndexArray]:
    """Return [k, 2] first cells and ends of the ranges that footprints may reach, in x and y."""
    sigma = np.sqrt(np.maximum(np.stack([spread[:, 0, 0], spread[:, 1, 1]], -1), 0.0))
    reach = _REACH * sigma + 0.5 * np.hypot(*size.T)[:, None] + shape.resolution
    low = np.clip(np.floor((mean - reach) / shape.resolution), 0, shape.cells)
    high = np.clip(np.ceil((mean + reach) / shape.resolution), 0, shape.cells)
    return low.astype(np.intp), np.maximum(high, low).astype(np.intp)


def _parts(count: IndexArray) -> list[IndexArray]:
    """Return rows with cells in groups of at most :data:`_CELLS_AT_A_TIME` cells, or of one."""
    rows = np.flatnonzero(count)
    group = np.cumsum(count[rows]) // _CELLS_AT_A_TIME
    return np.split(rows, np.flatnonzero(np.diff(group)) + 1) if len(rows) else []


def _cells(first: IndexArray, last: IndexArray) -> tuple[IndexArray, IndexArray, IndexArray]:
    """Return the cells of ranges: [c] the range, [c] the column and [c] the row in the grid."""
    width = last - first
    count = width[:, 0] * width[:, 1]
    row = np.repeat(np.arange(len(first)), count)
    number = np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)
    line, column = np.divmod(number, width[row, 0])
    return row, first[row, 0] + column, first[row, 1] + line


def _boxes(
    mean: Float64Array,
    spread: Float64Array,
    yaw: Float64Array,
    size: Float64Array,
    weight: Float64Array,
) -> Float32Array:
    """Return what :func:`_covered` needs of boxes at uncertain places; lengths in cells.

    Returns:
        [k, 11] mean x and y; cosine and sine of the heading; standard deviation across; change of
        the mean along the box with the place across; variance along where the place across is
        known, and what it may grow by; half length and half width; weight is in the last column.
    """
    var_along, both, var_across = along_and_across(spread, yaw)
    var_across = np.maximum(var_across, _LEAST_VARIANCE)
    slope = both / var_across
    growth = slope * slope * var_across
    rest = np.maximum(np.maximum(var_along, _LEAST_VARIANCE) - growth, _LEAST_VARIANCE)
    direction, sigma, half = (np.cos(yaw), np.sin(yaw)), np.sqrt(var_across), 0.5 * size.T
    columns = (*mean.T, *direction, sigma, slope, rest, growth, *half, weight)
    return np.stack(columns, axis=1).astype(np.float32)


def _covered(column: IndexArray, line: IndexArray, boxes: Float32Array) -> Float32Array:
    """Return [c] the probability of cells to be inside boxes at uncertain places, times weight.

    Across the box the probability is that of an interval; along it, that of an interval of a
    Gaussian with the mean and the variance that the position along the box has where the one
    across is within its interval. That is exact without correlation of both.

    Args:
        column: [c] of the cells in the grid.
        line: [c] their rows in the grid.
        boxes: [c, 11] of :func:`_boxes`, for each cell.
    """
    x, y, c, s, sigma, slope, rest, growth, half_length, half_width, weight = boxes.T
    x, y = column.astype(np.float32) - x, line.astype(np.float32) - y
    along, across = c * x + s * y, c * y - s * x
    low, high = (across - half_width) / sigma, (across + half_width) / sigma
    low, high = np.clip(low, -_FLAT, _FLAT), np.clip(high, -_FLAT, _FLAT)
    mass = _integral(high) - _integral(low)
    some = np.maximum(mass, np.float32(1e-4))
    left, right = np.exp(-0.5 * low * low), np.exp(-0.5 * high * high)
    scale = np.float32(1.0 / np.sqrt(2.0 * np.pi)) / some
    middle = (left - right) * scale
    share = 1.0 - (high * right - low * left) * scale - middle * middle
    root = np.sqrt(rest + growth * np.clip(share, 0.0, 1.0))
    ahead = along - slope * sigma * middle
    ends = _integral((ahead + half_length) / root) - _integral((ahead - half_length) / root)
    return np.asarray(mass * ends * weight)


def _integral(x: Float32Array) -> Float32Array:
    """Return the distribution function of the standard normal to 2e-4, which is fast."""
    x = np.clip(x, -_FLAT, _FLAT)
    # A logistic function of a cubic polynomial that was fitted to it.
    return np.asarray(1.0 / (1.0 + np.exp(-x * (1.5976 + 0.07056 * (x * x)))), dtype=np.float32)
