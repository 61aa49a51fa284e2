# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
r"""The probability that two oriented rectangles overlap when the offset of one is Gaussian.

Two convex shapes overlap where the offset of their centres lies in the Minkowski sum of the one
and the mirrored other. For two rectangles that is an octagon whose edges are those of both, so
the probability is the integral of the offset's Gaussian over an octagon. Whitened, it is

.. math:: \int\!\!\int_{octagon} \varphi(z_1)\,\varphi(z_2)\,dz_2\,dz_1
          = -\oint \varphi(z_1)\,\Phi(z_2)\,dz_1,

by Green's theorem: exact in :math:`z_2`, and a sum over edges of one-dimensional integrals of a
smooth function, by Gauss-Legendre quadrature with bounded numbers of nodes. The first axis lies
along the ego, so that its ends are perpendicular to the path of integration and drop out; an edge
along which :math:`z_2` is constant needs no quadrature. Two parallel boxes with a covariance along
their axes thus get the product of differences of the distribution function.
"""

from __future__ import annotations

import functools

import numpy as np

from mtpgo_core.frames import rotate, rotate_covariance
from mtpgo_core.prediction.constant_velocity import LARGEST_STD
from mtpgo_core.risk.normal_integral import normal_density, normal_integral
from mtpgo_core.schema import BoolArray, Float64Array

FAR = 5.0
"""Boxes whose gap is more than this many standard deviations are not looked at."""

NEGLIGIBLE = 3e-7
"""Probabilities that are known to be below are given as 0: Phi(-FAR)."""

_REACH = 6.0
"""Half the side of the square, in standard deviations, outside of which nothing is integrated; the
mass beyond is 4e-9."""

_LEAST_VARIANCE_M2 = 1e-6
"""Variances below one square millimetre count as that: a sharp position is not singular then."""

_NODES = ((1.0, 4), (3.0, 7), (np.inf, 20))
"""Nodes of the quadrature for edges up to a whitened length. Chosen: with them the error stays
below 1e-5 on random boxes and covariances (measured)."""


def overlap_probability(
    offset: Float64Array,
    covariance: Float64Array,
    ego_yaw: Float64Array,
    yaw: Float64Array,
    ego_size: Float64Array,
    size: Float64Array,
) -> Float64Array:
    """Return [k] the probability that a box at an uncertain place overlaps the ego's.

    Args:
        offset: [k, 2] mean centre of the box minus centre of the ego (m).
        covariance: [k, 2, 2] of that offset (m^2), in the same frame.
        ego_yaw: [k] heading of the ego's box (rad).
        yaw: [k] heading of the other box (rad).
        ego_size: [k, 2] length, width of the ego (m).
        size: [k, 2] length, width of the other box (m).

    Returns:
        Probabilities, 0 where they are below :data:`NEGLIGIBLE`; NaN where an argument is not
        finite or the matrix is not a covariance (:func:`is_covariance`).
    """
    with np.errstate(invalid="ignore"):
        # A sum is finite where all of its terms are.
        total = offset[:, 0] + offset[:, 1] + ego_yaw + yaw
        total += ego_size[:, 0] + ego_size[:, 1] + size[:, 0] + size[:, 1]
    known = np.isfinite(total) & is_covariance(covariance)
    out = np.where(known, 0.0, np.nan)
    near = np.flatnonzero(known & ~_is_out_of_reach(offset, covariance, ego_size, size))
    if not len(near):
        return out
    near = near[~_is_far(*(v[near] for v in (offset, covariance, ego_yaw, yaw, ego_size, size)))]
    if not len(near):
        return out
    ego_yaw = ego_yaw[near]
    place = rotate(offset[near], -ego_yaw)
    spread = rotate_covariance(covariance[near], -ego_yaw)
    corners = _octagon(yaw[near] - ego_yaw, 0.5 * ego_size[near], 0.5 * size[near])
    out[near] = np.clip(_integral(*_whitened(corners, place, spread)), 0.0, 1.0)
    return out


def half_extent(direction: Float64Array, yaw: Float64Array, size: Float64Array) -> Float64Array:
    """Return [...] how far boxes reach from their centres along unit vectors (m).

    Args:
        direction: [..., 2] unit vectors.
        yaw: [...] headings of the boxes (rad).
        size: [..., 2] length, width (m).
    """
    along = direction[..., 0] * np.cos(yaw) + direction[..., 1] * np.sin(yaw)
    across = direction[..., 1] * np.cos(yaw) - direction[..., 0] * np.sin(yaw)
    out: Float64Array = 0.5 * (size[..., 0] * np.abs(along) + size[..., 1] * np.abs(across))
    return out


def within_right_angle(
    turn: Float64Array, half: Float64Array
) -> tuple[Float64Array, Float64Array, Float64Array]:
    """Return the same boxes with headings from 0 to a right angle, sides swapped where need be.

    Args:
        turn: [k] headings (rad).
        half: [k, 2] half length, half width (m).

    Returns:
        [k] headings (rad), [k] half the side along the heading and [k] half that across it (m).
    """
    quarter = np.floor(turn / (0.5 * np.pi))
    swapped = quarter.astype(np.int64) % 2 == 1
    along = np.where(swapped, half[:, 1], half[:, 0])
    across = np.where(swapped, half[:, 0], half[:, 1])
    return turn - quarter * (0.5 * np.pi), along, across


def is_covariance(matrix: Float64Array) -> BoolArray:
    """Return [...] whether matrices [..., 2, 2] are finite and positive semidefinite in float32.

    A standard deviation above :data:`LARGEST_STD` does not count as known: the position could be
    anywhere, and every risk would be low.
    """
    xx, yy, xy = matrix[..., 0, 0], matrix[..., 1, 1], matrix[..., 0, 1]
    with np.errstate(invalid="ignore", over="ignore"):
        product = xx * yy * (1.0 + 1e-6) + 1e-12
        possible = np.maximum(xx, yy) <= LARGEST_STD**2  # false for NaN
        return np.asarray((xx >= 0.0) & (yy >= 0.0) & (xy * xy <= product) & possible)


def _is_out_of_reach(
    offset: Float64Array, covariance: Float64Array, ego_size: Float64Array, size: Float64Array
) -> BoolArray:
    """Return [k] whether the circles around the boxes suffice to show :func:`_is_far`."""
    with np.errstate(invalid="ignore"):
        reach = 0.5 * (np.hypot(*ego_size.T) + np.hypot(*size.T))
        reach += FAR * np.sqrt(covariance[:, 0, 0] + covariance[:, 1, 1])
        return np.asarray(np.hypot(*offset.T) > reach + FAR * np.sqrt(_LEAST_VARIANCE_M2))


def _is_far(
    offset: Float64Array,
    covariance: Float64Array,
    ego_yaw: Float64Array,
    yaw: Float64Array,
    ego_size: Float64Array,
    size: Float64Array,
) -> BoolArray:
    """Return [k] whether the probability of an overlap is certainly below :data:`NEGLIGIBLE`.

    Boxes that overlap also overlap in projection onto the line through their centres, so the
    projected gap in standard deviations bounds the probability.
    """
    distance = np.maximum(np.hypot(offset[:, 0], offset[:, 1]), 1e-9)
    direction = offset / distance[:, None]
    x, y = direction.T
    variance = (
        x * x * covariance[:, 0, 0]
        + 2.0 * x * y * covariance[:, 0, 1]
        + y * y * covariance[:, 1, 1]
    )
    reach = half_extent(direction, ego_yaw, ego_size) + half_extent(direction, yaw, size)
    gap = distance - reach
    sigma = np.sqrt(np.maximum(variance, _LEAST_VARIANCE_M2))
    return np.asarray(gap > FAR * sigma)


def _octagon(turn: Float64Array, ego_half: Float64Array, half: Float64Array) -> Float64Array:
    """Return [k, 9, 2] corners of the Minkowski sum in the ego's frame, the first one repeated.

    Counter-clockwise; edges may have length zero.

    Args:
        turn: [k] heading of the other box in the ego's frame (rad).
        ego_half: [k, 2] half length, half width (m).
        half: [k, 2] those of the other box (m).
    """
    turn, a, b = within_right_angle(turn, half)
    sin, cos = np.sin(turn), np.cos(turn)
    sin = np.where(np.abs(sin) < 1e-12, 0.0, sin)
    zero = np.zeros(len(turn))
    # Edges by their direction: 0, turn, 90 degrees, 90 degrees + turn; then their opposites.
    edge = np.stack(
        [
            np.stack([2.0 * ego_half[:, 0], 2.0 * a * cos, zero, -2.0 * b * sin], -1),
            np.stack([zero, 2.0 * a * sin, 2.0 * ego_half[:, 1], 2.0 * b * cos], -1),
        ],
        axis=-1,
    )
    first = -0.5 * edge.sum(axis=1)
    half_way = first[:, None] + np.cumsum(edge, axis=1)
    return np.concatenate([first[:, None], half_way, -half_way], axis=1)


def _whitened(
    corners: Float64Array, place: Float64Array, spread: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """Return [k, 9] both whitened coordinates of the corners; the first one is along x."""
    xx = np.maximum(spread[:, 0, 0], _LEAST_VARIANCE_M2)
    slope = spread[:, 0, 1] / xx
    rest = np.maximum(spread[:, 1, 1] - slope * spread[:, 0, 1], _LEAST_VARIANCE_M2)
    x = corners[..., 0] - place[:, None, 0]
    y = corners[..., 1] - place[:, None, 1]
    return x / np.sqrt(xx)[:, None], (y - slope[:, None] * x) / np.sqrt(rest)[:, None]


def _integral(first: Float64Array, second: Float64Array) -> Float64Array:
    """Return [k] the standard normal's mass in polygons with corners [k, 9], counter-clockwise."""
    total = np.zeros(len(first))
    # Only edges within reach matter; those perpendicular to the first axis contribute nothing.
    left = np.clip(np.minimum(first[:, :-1], first[:, 1:]), -_REACH, _REACH)
    right = np.clip(np.maximum(first[:, :-1], first[:, 1:]), -_REACH, _REACH)
    matters = (right - left > 1e-12) & (np.maximum(second[:, :-1], second[:, 1:]) > -_REACH)
    row, edge = np.nonzero(matters)
    if not len(row):
        return total
    left, right = left[row, edge], right[row, edge]
    x, y = first[row, edge], second[row, edge]
    run, rise = first[row, edge + 1] - x, second[row, edge + 1] - y
    sign = np.where(run < 0.0, 1.0, -1.0)  # upper edges of the polygon run to the left
    slope = rise / run
    # Where the edge crosses the upper and the lower side of the square.
    level = np.abs(rise) < 1e-9
    safe = np.where(level, 1.0, slope)
    up = np.where(level, np.where(y >= _REACH, -np.inf, np.inf), x + (_REACH - y) / safe)
    down = np.where(level, np.where(y <= -_REACH, np.inf, -np.inf), x + (-_REACH - y) / safe)
    rising = level | (slope > 0.0)
    begin = np.where(rising, np.maximum(left, down), np.maximum(left, up))
    end = np.where(rising, np.minimum(right, up), np.minimum(right, down))
    begin, end = np.minimum(begin, right), np.maximum(end, left)
    # Above the square the inner integral is 1.
    above_begin = np.where(rising, np.maximum(left, np.minimum(up, right)), left)
    above_end = np.where(rising, right, np.minimum(right, np.maximum(up, left)))
    above = np.where(level, y >= _REACH, above_end > above_begin)
    above_begin = np.where(level, left, above_begin)
    above_end = np.where(level, right, above_end)
    part = np.zeros(len(row))
    chosen = np.flatnonzero(above)
    part[chosen] = normal_integral(above_end[chosen]) - normal_integral(above_begin[chosen])
    inside = (end > begin) & ~(level & above)
    flat = np.flatnonzero(inside & level)
    part[flat] += normal_integral(y[flat]) * (
        normal_integral(right[flat]) - normal_integral(left[flat])
    )
    chosen = np.flatnonzero(inside & ~level)
    begin, end = begin[chosen], end[chosen]
    height = y[chosen] + slope[chosen] * (begin - x[chosen])
    part[chosen] += _edge_integrals(begin, end - begin, height, slope[chosen])
    return np.bincount(row, weights=sign * part, minlength=len(first)).astype(np.float64)


def _edge_integrals(
    begin: Float64Array, run: Float64Array, height: Float64Array, slope: Float64Array
) -> Float64Array:
    """Return [e] integrals of phi(z1) Phi(z2) along lines from (begin, height)."""
    out = np.empty(len(begin))
    length = run * np.sqrt(1.0 + slope * slope)
    shorter = 0.0
    for longest, nodes in _NODES:
        group = np.flatnonzero((length > shorter) & (length <= longest) | (length <= 0.0))
        shorter = longest
        place, share = _quadrature(nodes)
        step = place[:, None] * run[group]
        value = normal_density(begin[group] + step)
        value *= normal_integral(height[group] + slope[group] * step)
        out[group] = (share @ value) * run[group]
    return out


@functools.cache
def _quadrature(nodes: int) -> tuple[Float64Array, Float64Array]:
    """Return [nodes] places and weights of Gauss-Legendre quadrature on 0..1."""
    place, weight = np.polynomial.legendre.leggauss(nodes)
    return 0.5 * (place + 1.0), 0.5 * weight
