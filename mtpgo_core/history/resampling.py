# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Samples at any times onto the common grid, for all tracks at once (design section 4)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.frames import wrap
from mtpgo_core.schema import BoolArray, Float64Array

TOLERANCE_NS = 1_000
"""Stamps closer than this are the same time: what stamps kept as floating seconds since the epoch
are good for. No road user moves by a tenth of a millimetre in it."""

NEVER_NS = np.iinfo(np.int64).min
"""Stamp of a sample that is not there."""


@dataclass(frozen=True)
class Brackets:
    """Where each grid time lies among a track's samples.

    Attributes:
        left: [n, T] column of the last sample at or before the grid time.
        right: [n, T] column of the sample after it; ``left`` where there is none to go towards.
        fraction: [n, T] way from left to right, in [0, 1].
        after_s: [n] time from the last sample to the last grid time, where that one has to be
            extrapolated (s), else 0.
        valid: [n, T] the track has a value at the grid time.
    """

    left: NDArray[np.intp]
    right: NDArray[np.intp]
    fraction: Float64Array
    after_s: Float64Array
    valid: BoolArray


def bracket(
    stamp_ns: NDArray[np.int64],
    grid_ns: NDArray[np.int64],
    *,
    max_gap_ns: int,
    max_extrapolation_ns: int,
) -> Brackets:
    """Find the samples around every grid time; samples after the last grid time do not exist.

    Args:
        stamp_ns: [n, K] sample times, ascending, ``NEVER_NS`` first where there are fewer.
        grid_ns: [T] grid times, ascending.
        max_gap_ns: the longest step between two samples that is bridged.
        max_extrapolation_ns: how far the last grid time may lie behind the last sample.
    """
    n, width = stamp_ns.shape
    start, end = int(grid_ns[0]) - max_gap_ns, int(grid_ns[-1]) + TOLERANCE_NS
    # All rows in one ascending array, each in a stretch of its own: one search serves everything.
    # Whatever is too old (or not there) goes to the stretch's start, what is too new to its end.
    relative = np.clip(stamp_ns, start - 1, end + 1) - (start - 1)
    stretch = (np.arange(n, dtype=np.int64) * (end - start + 4))[:, None]
    wanted = grid_ns + (TOLERANCE_NS - (start - 1)) + stretch
    place = np.searchsorted((relative + stretch).ravel(), wanted.ravel(), side="right")
    left = place.reshape(wanted.shape) - 1 - (np.arange(n) * width)[:, None]

    rows = np.arange(n)[:, None]
    has_left = left >= 0
    left = np.maximum(left, 0)
    left_ns = stamp_ns[rows, left]
    has_left &= left_ns >= start
    since_ns = np.where(has_left, grid_ns - left_ns, 0)
    right = np.minimum(left + 1, width - 1)
    right_ns = stamp_ns[rows, right]
    has_right = has_left & (left + 1 < width) & (right_ns <= end)
    gap_ns = np.where(has_right, right_ns - left_ns, 1)

    exact = has_left & (since_ns <= TOLERANCE_NS)
    bridged = has_right & (gap_ns <= max_gap_ns + TOLERANCE_NS)
    valid = exact | bridged
    carried = has_left[:, -1] & ~exact[:, -1] & (since_ns[:, -1] <= max_extrapolation_ns)
    valid[:, -1] |= carried
    between = bridged & ~exact
    return Brackets(
        left=left,
        right=np.where(between, right, left),
        fraction=np.where(between, np.clip(since_ns / gap_ns, 0.0, 1.0), 0.0),
        after_s=np.where(carried, since_ns[:, -1] * 1e-9, 0.0),
        valid=valid,
    )


def between(left: Float64Array, right: Float64Array, fraction: Float64Array) -> Float64Array:
    """Linear interpolation; where one side is unknown (NaN) the other one."""
    value = left + fraction * (right - left)
    return np.where(np.isnan(left), right, np.where(np.isnan(right), left, value))


def between_angles(
    left: Float64Array, right: Float64Array, fraction: Float64Array
) -> Float64Array:
    """Interpolation of angles (rad) along the shorter arc, in (-pi, pi]."""
    value = left + fraction * wrap(right - left)
    return wrap(np.where(np.isnan(left), right, np.where(np.isnan(right), left, value)))


def fill_backwards(values: Float64Array, valid: BoolArray) -> Float64Array:
    """Unknown values of a track's first samples, taken from its first known one.

    Args:
        values: [n, T, ...] with NaN where unknown.
        valid: [n, T] presence; samples at which the track was absent stay unknown.
    """
    flat = values.reshape(*valid.shape, math.prod(values.shape[2:]))
    known = np.isfinite(flat).all(axis=2)
    if (known | ~valid).all():
        return values
    steps = valid.shape[1]
    index = np.where(known, np.arange(steps), steps - 1)
    following = np.minimum.accumulate(index[:, ::-1], axis=1)[:, ::-1]
    filled = flat[np.arange(valid.shape[0])[:, None], following]
    return np.where((~known & valid)[..., None], filled, flat).reshape(values.shape)
