# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Distances between oriented rectangles, and quantiles of the smallest distance over a horizon.

A prediction gives the distribution at each step, not that of whole paths. Errors persist along a
path: an agent ahead of its prediction after two seconds is still ahead after three. The error of a
path is therefore assumed to be the same number of standard deviations at all steps, along and
across the heading of its mode. For each error of a fixed sample of the standard normal
distribution, the distance between the footprints is computed exactly, and its smallest value over
the horizon enters the quantiles with the weight of its mode.
"""

from __future__ import annotations

import numpy as np

from mtpgo_core.frames import along_and_across, rotate
from mtpgo_core.risk.footprint_overlap import within_right_angle
from mtpgo_core.schema import Float32Array, Float64Array, IndexArray

ERRORS = 16
"""Errors per mode. Chosen: quantiles are then within 0.6 standard deviations of the smallest
distance of those of thousands of errors, mostly within 0.2 (measured)."""

_LEAST_SIGMA_M = 1e-3
"""Smaller standard deviations count as a millimetre."""


def _spread_errors() -> Float64Array:
    """Return [2, ERRORS] points that sample the standard normal distribution in two dimensions."""
    number = np.arange(ERRORS // 2)
    radius = np.sqrt(-2.0 * np.log1p(-(number + 0.5) / len(number)))
    angle = number * np.pi * 0.5 * (np.sqrt(5.0) - 1.0)  # the golden section of half a circle
    half = np.stack([radius * np.cos(angle), radius * np.sin(angle)])
    spread = np.concatenate([half, -half], axis=1)
    # Whitened: the covariance of a small sample is the identity only approximately.
    root = np.linalg.cholesky(spread @ spread.T / ERRORS)
    return np.asarray(np.linalg.solve(root, spread))


STANDARD_ERRORS = _spread_errors()

_ERRORS_AND_1 = np.concatenate([STANDARD_ERRORS, np.ones((1, ERRORS))])

_PATHS_AT_A_TIME = 32
"""Paths whose gaps are computed together; chosen so that they stay in the cache."""


def footprint_distance(
    offset: Float64Array,
    ego_yaw: Float64Array,
    yaw: Float64Array,
    ego_size: Float64Array,
    size: Float64Array,
) -> Float64Array:
    """Return [k, e] distances between two boxes (m), 0 where they overlap or touch.

    Args:
        offset: [k, e, 2] centres of the other box minus that of the ego (m).
        ego_yaw: [k] heading of the ego's box (rad).
        yaw: [k] heading of the other box (rad).
        ego_size: [k, 2] length, width of the ego (m).
        size: [k, 2] length, width of the other box (m).
    """
    place = rotate(offset, -ego_yaw[:, None])
    turn, a, b = within_right_angle(yaw - ego_yaw, 0.5 * size)
    c, s = np.cos(turn), np.sin(turn)
    ego_a, ego_b = 0.5 * ego_size[:, 0], 0.5 * ego_size[:, 1]
    x, y = place[..., 0], place[..., 1]
    u = c[:, None] * x + s[:, None] * y
    v = c[:, None] * y - s[:, None] * x
    # The four pairs of edges of the octagon (see footprint_overlap): coordinate across the edge,
    # along it, distance of the edge from the middle, place of its middle, half its length.
    edges = (
        (x, y, ego_a + a * c + b * s, a * s - b * c, ego_b),
        (y, x, ego_b + a * s + b * c, a * c - b * s, ego_a),
        (u, v, a + ego_a * c + ego_b * s, ego_b * c - ego_a * s, b),
        (v, u, b + ego_a * s + ego_b * c, ego_b * s - ego_a * c, a),
    )
    nearest = np.full(x.shape, np.inf)
    for across, along, reach, middle, half in edges:
        out = np.abs(across) - reach[:, None]
        aside = np.abs(np.copysign(1.0, across) * along - middle[:, None]) - half[:, None]
        np.maximum(aside, 0.0, out=aside)
        squared = out * out + aside * aside
        np.minimum(nearest, np.where(out > 0.0, squared, np.inf), out=nearest)
    return np.where(np.isinf(nearest), 0.0, np.sqrt(nearest))


def smallest_distances(
    offset: Float64Array,
    covariance: Float64Array,
    ego_yaw: Float64Array,
    yaw: Float64Array,
    ego_size: Float64Array,
    size: Float64Array,
) -> Float64Array:
    """Return [p, ERRORS] the smallest distances of paths over their steps (m).

    The nearest step is found by a cheap lower bound (see :func:`_nearest_steps`); the distance at
    that step is exact.

    Args:
        offset: [p, H, 2] centres of the predicted box minus that of the ego (m); steps with NaN
            are left out.
        covariance: [p, H, 2, 2] of the position (m^2).
        ego_yaw: [H] (rad).
        yaw: [p, H] (rad).
        ego_size: [2] length, width of the ego (m).
        size: [p, 2] those of the predicted box (m).

    Returns:
        One for each of :data:`STANDARD_ERRORS`; infinity for a path without a known step.
    """
    paths, _ = yaw.shape
    out = np.full((paths, ERRORS), np.inf)
    used = np.flatnonzero(np.isfinite(offset[..., 0]).any(axis=1))
    if not len(used):
        return out
    if len(used) < paths:
        offset, covariance, yaw, size = (v[used] for v in (offset, covariance, yaw, size))
    coefficient, reach = _projections(
        offset, _roots(covariance, yaw), ego_yaw, yaw, ego_size, size
    )
    step = np.empty((len(used), ERRORS), dtype=np.intp)
    for begin in range(0, len(used), _PATHS_AT_A_TIME):
        rows = slice(begin, begin + _PATHS_AT_A_TIME)
        step[rows] = _nearest_steps(coefficient[:, rows], reach[:, rows])
    # The first two projections are coordinates in the ego's frame.
    row = np.arange(len(used))[:, None]
    place = np.einsum("dpek,ke->dpe", coefficient[:2, row, step].astype(np.float64), _ERRORS_AND_1)
    turn = (yaw - ego_yaw)[row, step].reshape(-1)
    distance = footprint_distance(
        np.moveaxis(place, 0, -1).reshape(-1, 1, 2),
        np.zeros(len(turn)),
        turn,
        np.broadcast_to(ego_size, (len(turn), 2)),
        np.repeat(size, ERRORS, axis=0),
    )
    out[used] = distance.reshape(len(used), ERRORS)
    return out


def _roots(covariance: Float64Array, yaw: Float64Array) -> tuple[Float64Array, ...]:
    """Return the Cholesky factor of covariances, in axes along and across the heading (m).

    The first standard error moves the position along the heading and, by the correlation, across
    it; the second one moves it across only.

    Args:
        covariance: [..., 2, 2] (m^2).
        yaw: [...] (rad).

    Returns:
        [...] each: along by the first error, across by the first, across by the second.
    """
    var_along, both, var_across = along_and_across(covariance, yaw)
    along = np.sqrt(np.maximum(var_along, _LEAST_SIGMA_M**2))
    mixed = both / along
    across = np.sqrt(np.maximum(var_across - mixed * mixed, _LEAST_SIGMA_M**2))
    return along, mixed, across


def _projections(
    offset: Float64Array,
    root: tuple[Float64Array, ...],
    ego_yaw: Float64Array,
    yaw: Float64Array,
    ego_size: Float64Array,
    size: Float64Array,
) -> tuple[Float32Array, Float32Array]:
    """Return the offsets along the four directions of the boxes' sides.

    Returns:
        [4, p, H, 3] coefficients of both standard errors and the mean (m), first along and across
        the ego, then along and across the other box; [4, p, H] half extents of both boxes together
        in these directions (m).
    """
    along, mixed, across = root
    ego_c, ego_s = np.cos(ego_yaw), np.sin(ego_yaw)
    x = ego_c * offset[..., 0] + ego_s * offset[..., 1]
    y = ego_c * offset[..., 1] - ego_s * offset[..., 0]
    c, s = np.cos(yaw - ego_yaw), np.sin(yaw - ego_yaw)
    coefficient = np.zeros((4, *yaw.shape, 3), dtype=np.float32)
    coefficient[0, ..., 0], coefficient[0, ..., 1] = c * along - s * mixed, -s * across
    coefficient[1, ..., 0], coefficient[1, ..., 1] = s * along + c * mixed, c * across
    coefficient[2, ..., 0] = along
    coefficient[3, ..., 0], coefficient[3, ..., 1] = mixed, across
    coefficient[0, ..., 2], coefficient[1, ..., 2] = x, y
    coefficient[2, ..., 2], coefficient[3, ..., 2] = c * x + s * y, c * y - s * x
    c, s = np.abs(c), np.abs(s)
    ego_a, ego_b = 0.5 * ego_size
    a, b = 0.5 * size[:, 0, None], 0.5 * size[:, 1, None]
    reach = np.empty((4, *yaw.shape), dtype=np.float32)
    reach[0], reach[1] = ego_a + a * c + b * s, ego_b + a * s + b * c
    reach[2], reach[3] = a + ego_a * c + ego_b * s, b + ego_a * s + ego_b * c
    return coefficient, reach


def _nearest_steps(coefficient: Float32Array, reach: Float32Array) -> IndexArray:
    """Return [p, ERRORS] the step at which a lower bound of the boxes' distance is smallest.

    The bound is the distance of each box to the other one's bounding rectangle along its own
    sides, whichever is larger. Where the rectangles overlap, the step with the deepest overlap is
    returned.

    Args:
        coefficient: [4, p, H, 3] and
        reach: [4, p, H], of :func:`_projections`.
    """
    gap = coefficient @ _ERRORS_AND_1.astype(np.float32)
    np.abs(gap, out=gap)
    gap -= reach[..., None]
    inside = np.maximum(np.maximum(gap[0], gap[1]), np.maximum(gap[2], gap[3]))
    np.minimum(inside, 0.0, out=inside)
    np.maximum(gap, 0.0, out=gap)
    np.square(gap, out=gap)
    least = np.maximum(gap[0] + gap[1], gap[2] + gap[3])
    least += inside
    np.copyto(least, np.inf, where=np.isnan(least))
    return np.asarray(least.argmin(axis=1))


def weighted_quantiles(
    value: Float64Array, weight: Float64Array, level: tuple[float, ...]
) -> Float64Array:
    """Return [n, levels] quantiles of values [n, k] with weights [n, k]; NaN without weight.

    Each value stands at the middle of its weight; quantiles between two values are interpolated.
    """
    used = weight > 0.0
    known = np.asarray((np.isfinite(value) | ~used).all(axis=1) & used.any(axis=1))
    value = np.where(used, value, np.inf)
    order = np.argsort(value, axis=1)
    value, weight = np.take_along_axis(value, order, 1), np.take_along_axis(weight, order, 1)
    middle = np.cumsum(weight, axis=1)
    wanted = np.array(level) * middle[:, -1:]
    middle -= 0.5 * weight
    last = np.maximum(used.sum(axis=1) - 1, 0)[:, None]
    after = np.minimum((middle[:, None, :] < wanted[..., None]).sum(axis=-1), last)
    before = np.maximum(after - 1, 0)
    row = np.arange(len(value))[:, None]
    span = middle[row, after] - middle[row, before]
    share = np.clip((wanted - middle[row, before]) / np.where(span > 0.0, span, 1.0), 0.0, 1.0)
    low = np.where(known[:, None], value[row, before], 0.0)
    high = np.where(known[:, None], value[row, after], 0.0)
    return np.where(known[:, None], low + share * (high - low), np.nan)
