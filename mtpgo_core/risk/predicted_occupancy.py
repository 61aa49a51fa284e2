# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The probability of each cell of a grid to be covered by a predicted road user.

A cell counts as covered at a step when the footprint, widened by half a cell on each side, covers
the middle of the cell. Footprints of different road users do not overlap, so their probabilities
are added. Over several steps the largest probability is taken.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from mtpgo_core.class_size import known_sizes
from mtpgo_core.frames import along_and_across
from mtpgo_core.options import check_options, option
from mtpgo_core.risk.collision_risk import WEIGHT_TOLERANCE, known_poses
from mtpgo_core.schema import BoolArray, Float32Array, Float64Array, IndexArray, Prediction

_REACH = 3.0
"""Standard deviations around a footprint within which cells are filled. Chosen: beyond it lies
less than 0.3 % of a mode, and published values have steps of 1 %."""

_LEAST_WEIGHT = 0.01
"""Modes with a smaller weight are left out; chosen as the step of the published values."""

_CELLS_AT_A_TIME = 20_000
"""Cells of footprints that are computed together; chosen so that they stay in the cache."""

MOST_CELLS = 20_000_000
"""Most cells that are computed for one grid, over all footprints, modes and steps. Chosen: each
takes 0.1 us (measured), so a grid takes two seconds at most. The 64 road users of the benchmark
need less than a million."""

_LEAST_VARIANCE = 1e-4
"""Smaller variances are raised to this (cells squared): a hundredth of a cell, squared."""

_FLAT = np.float32(6.0)
"""Beyond this many standard deviations the normal distribution function is constant in float32
(chosen)."""


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
        unknown_agents: number of agents without a known prediction; one makes the whole field
            unknown.
        begins_beyond: the field is unknown because the time window begins after the predictions
            end.
        too_many_cells: the field is unknown because this many cells, more than
            :data:`MOST_CELLS`, would have to be computed; 0 if there are fewer.
    """

    corner: Float64Array
    resolution: float
    probability: Float64Array
    unknown_agents: int = 0
    begins_beyond: bool = False
    too_many_cells: int = 0


def unknown_field(shape: GridShape, center: Float64Array, agents: int = 0) -> OccupancyField:
    """Return a field with all cells unknown, because of ``agents`` without a known prediction."""
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
        begin_s: begin of the window after the prediction's stamp (s). If no step lies within the
            window, the step nearest to its middle is used.
        end_s: end of the window (s); times after the last step are ignored.
    """
    if len(prediction) and begin_s > reach_s(prediction.time_s):
        return dataclasses.replace(unknown_field(shape, center), begins_beyond=True)
    steps = _steps_within(prediction.time_s, begin_s, end_s)
    has_weight = prediction.weight > _LEAST_WEIGHT
    lost = _lost_agents(prediction, has_weight, steps)
    if lost.any():
        return unknown_field(shape, center, int(lost.sum()))
    agent, mode = np.nonzero(has_weight)
    corner, cells = shape.corner(center), shape.cells
    size = known_sizes(prediction.size, prediction.agent_class)[agent]
    ranges = [
        _cell_range(
            prediction.mean[agent, mode, step, :2] - corner,
            prediction.covariance[agent, mode, step],
            size,
            shape,
        )
        for step in steps
    ]
    number = sum(int(np.prod(last - first, axis=1).sum()) for first, last in ranges)
    if number > MOST_CELLS:
        return dataclasses.replace(unknown_field(shape, center), too_many_cells=number)
    field = np.zeros(cells * cells)
    for step, (first, last) in zip(steps, ranges, strict=True):
        boxes = _boxes(
            (prediction.mean[agent, mode, step, :2] - corner) / shape.resolution - 0.5,
            prediction.covariance[agent, mode, step] / shape.resolution**2,
            prediction.yaw[agent, mode, step],
            size / shape.resolution + 1.0,
            prediction.weight[agent, mode],
        )
        np.maximum(field, _occupancy_at_step(boxes, first, last, cells), out=field)
    np.minimum(field, 1.0, out=field)
    return OccupancyField(corner, shape.resolution, field.reshape(cells, cells))


def _lost_agents(prediction: Prediction, has_weight: BoolArray, steps: IndexArray) -> BoolArray:
    """Return [n] whose prediction is not known: a mode is not finite, or weights are missing.

    Args:
        prediction: of n agents.
        has_weight: [n, M] modes that count.
        steps: those of the time window.
    """
    finite = known_poses(prediction)[:, :, steps].all(axis=2)
    mode_lost = (has_weight & ~finite).any(axis=1)
    with np.errstate(invalid="ignore"):  # an infinite weight; NaN is lost too
        sums_to_one = np.abs(prediction.weight.sum(axis=1) - 1.0) <= WEIGHT_TOLERANCE
    return np.asarray(mode_lost | ~sums_to_one)


def _occupancy_at_step(
    boxes: Float32Array, first: IndexArray, last: IndexArray, cells: int
) -> Float64Array:
    """Return [cells * cells] the probability of each cell to be covered at one step.

    Args:
        boxes: [k, 11] of :func:`_boxes`.
        first: [k, 2] first column and row of the cells that each box may reach.
        last: [k, 2] their ends.
        cells: along a side of the grid.
    """
    field = np.zeros(cells * cells)
    for rows in _parts(np.prod(last - first, axis=1)):
        box, column, row = _cells(first[rows], last[rows])
        covered = _covered(column, row, boxes[rows][box])
        field += np.bincount(row * cells + column, weights=covered, minlength=cells * cells)
    return field


def reach_s(time_s: Float64Array) -> float:
    """Return the time up to which the last of [H] steps is valid (s): half a step after it."""
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
    """Return the rows with cells, in groups of about :data:`_CELLS_AT_A_TIME` cells.

    Args:
        count: [k] number of cells of each row.
    """
    rows = np.flatnonzero(count)
    group = np.cumsum(count[rows]) // _CELLS_AT_A_TIME
    return np.split(rows, np.flatnonzero(np.diff(group)) + 1) if len(rows) else []


def _cells(first: IndexArray, last: IndexArray) -> tuple[IndexArray, IndexArray, IndexArray]:
    """Return all cells of k ranges, [c] each: the range, the column and the row in the grid.

    Args:
        first: [k, 2] first column and row of each range.
        last: [k, 2] their ends.
    """
    width = last - first
    count = width[:, 0] * width[:, 1]
    box = np.repeat(np.arange(len(first)), count)
    number_in_range = np.arange(len(box)) - np.repeat(np.cumsum(count) - count, count)
    row, column = np.divmod(number_in_range, width[box, 0])
    return box, first[box, 0] + column, first[box, 1] + row


def _boxes(
    mean: Float64Array,
    spread: Float64Array,
    yaw: Float64Array,
    size: Float64Array,
    weight: Float64Array,
) -> Float32Array:
    """Return what :func:`_covered` needs of boxes at uncertain places; lengths in cells.

    Returns:
        [k, 11] columns: mean x and y; cosine and sine of the heading; standard deviation across;
        slope of the mean position along as a function of the position across (regression);
        variance along for a given position across, and the variance that the spread across adds
        to it; half length and half width; weight.
    """
    var_along, both, var_across = along_and_across(spread, yaw)
    var_across = np.maximum(var_across, _LEAST_VARIANCE)
    slope = both / var_across
    growth = slope * slope * var_across
    rest = np.maximum(np.maximum(var_along, _LEAST_VARIANCE) - growth, _LEAST_VARIANCE)
    direction, sigma, half = (np.cos(yaw), np.sin(yaw)), np.sqrt(var_across), 0.5 * size.T
    columns = (*mean.T, *direction, sigma, slope, rest, growth, *half, weight)
    return np.stack(columns, axis=1).astype(np.float32)


def _covered(column: IndexArray, row: IndexArray, boxes: Float32Array) -> Float32Array:
    """Return [c] the probability of cells to be inside boxes at uncertain places, times weight.

    Across the box the probability is that of an interval. Along the box it is that of an interval
    of a Gaussian whose mean and variance are those of the position along the box, given that the
    position across is within its interval. This is exact where the two are not correlated.

    Args:
        column: [c] of the cells in the grid.
        row: [c] of the cells in the grid.
        boxes: [c, 11] of :func:`_boxes`, for each cell.
    """
    x, y, cos, sin, sigma, slope, rest, growth, half_length, half_width, weight = boxes.T
    dx, dy = column.astype(np.float32) - x, row.astype(np.float32) - y
    along, across = cos * dx + sin * dy, cos * dy - sin * dx
    low, high = (across - half_width) / sigma, (across + half_width) / sigma
    low, high = np.clip(low, -_FLAT, _FLAT), np.clip(high, -_FLAT, _FLAT)
    mass = _normal_integral(high) - _normal_integral(low)
    # Mean and variance (in sigmas) of the normal distribution truncated to low..high.
    density_low, density_high = np.exp(-0.5 * low * low), np.exp(-0.5 * high * high)
    scale = np.float32(1.0 / np.sqrt(2.0 * np.pi)) / np.maximum(mass, np.float32(1e-4))
    mean = (density_low - density_high) * scale
    variance = 1.0 - (high * density_high - low * density_low) * scale - mean * mean
    sigma_along = np.sqrt(rest + growth * np.clip(variance, 0.0, 1.0))
    ahead = along - slope * sigma * mean
    begin, end = (ahead - half_length) / sigma_along, (ahead + half_length) / sigma_along
    return np.asarray(mass * (_normal_integral(end) - _normal_integral(begin)) * weight)


def _normal_integral(x: Float32Array) -> Float32Array:
    """Return the distribution function of the standard normal, within 2e-4 but fast."""
    x = np.clip(x, -_FLAT, _FLAT)
    # The logistic function of a fitted cubic polynomial.
    return np.asarray(1.0 / (1.0 + np.exp(-x * (1.5976 + 0.07056 * (x * x)))), dtype=np.float32)
