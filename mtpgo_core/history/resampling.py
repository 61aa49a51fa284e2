# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Resampling of irregular samples onto the common grid, for all tracks at once."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.frames import wrap
from mtpgo_core.schema import BoolArray, Float64Array, IndexArray

TOLERANCE_NS = 1_000
"""Stamps closer than this are the same time (ns): the resolution of stamps that were stored as
floating-point seconds since the epoch. No road user moves a tenth of a millimetre in it."""

NEVER_NS = np.iinfo(np.int64).min
"""Stamp of an empty sample."""


@dataclass(frozen=True)
class Brackets:
    """The samples on either side of each grid time.

    Attributes:
        left: [n, T] column of the last sample at or before the grid time.
        right: [n, T] column of the sample after it; ``left`` where nothing is interpolated.
        fraction: [n, T] position between left and right, in [0, 1].
        after_s: [n] time from the last sample to the last grid time where that one has to be
            extrapolated, else 0 (s).
        valid: [n, T] the track has a value at the grid time.
    """

    left: IndexArray
    right: IndexArray
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
    """Return the samples around every grid time; samples after the last grid time are ignored.

    Args:
        stamp_ns: [n, K] sample times, ascending; rows with fewer than K start with ``NEVER_NS``.
        grid_ns: [T] grid times, ascending.
        max_gap_ns: longest gap between two samples that is interpolated (ns).
        max_extrapolation_ns: how long after the last sample the last grid time may be (ns).
    """
    n, width = stamp_ns.shape
    start, end = int(grid_ns[0]) - max_gap_ns, int(grid_ns[-1]) + TOLERANCE_NS
    relative = np.clip(stamp_ns, start - 1, end + 1) - (start - 1)
    left = _samples_until(relative, grid_ns + (TOLERANCE_NS - (start - 1)), end - start + 4) - 1

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
    extrapolated = has_left[:, -1] & ~exact[:, -1] & (since_ns[:, -1] <= max_extrapolation_ns)
    valid[:, -1] |= extrapolated
    inside = bridged & ~exact
    return Brackets(
        left=left,
        right=np.where(inside, right, left),
        fraction=np.where(inside, np.clip(since_ns / gap_ns, 0.0, 1.0), 0.0),
        after_s=np.where(extrapolated, since_ns[:, -1] * 1e-9, 0.0),
        valid=valid,
    )


def _samples_until(
    relative: NDArray[np.int64], wanted: NDArray[np.int64], span: int
) -> NDArray[np.int64]:
    """Return [n, T] how many samples of each row are at or before each wanted time.

    Args:
        relative: [n, K] ascending in each row, from 0 on and below ``span``.
        wanted: [T] times, within the same limits.
        span: as above.
    """
    n, width = relative.shape
    if n * span > np.iinfo(np.int64).max:
        # Times that are years apart, where the clock was set forward.
        rows = [np.searchsorted(row, wanted, side="right") for row in relative]
        return np.array(rows, dtype=np.int64).reshape(n, len(wanted))
    # All rows form one ascending array, each in its own range of values, so that a single search
    # handles them all. Samples that are too old or missing were clipped to the start of the
    # range, samples that are too new to its end.
    segment = (np.arange(n, dtype=np.int64) * span)[:, None]
    place = np.searchsorted((relative + segment).ravel(), (wanted + segment).ravel(), side="right")
    return place.reshape(n, len(wanted)) - (np.arange(n) * width)[:, None]


def interpolate_linear(
    left: Float64Array, right: Float64Array, fraction: Float64Array
) -> Float64Array:
    """Return linearly interpolated values; where one side is unknown (NaN), the other side."""
    value = left + fraction * (right - left)
    return np.where(np.isnan(left), right, np.where(np.isnan(right), left, value))


def interpolate_angle(
    left: Float64Array, right: Float64Array, fraction: Float64Array
) -> Float64Array:
    """Return angles (rad) interpolated along the shorter arc, in (-pi, pi]."""
    value = left + fraction * wrap(right - left)
    return wrap(np.where(np.isnan(left), right, np.where(np.isnan(right), left, value)))


def fill_backwards(values: Float64Array, valid: BoolArray) -> Float64Array:
    """Return ``values`` with the unknown first samples of a track filled from its first known one.

    Args:
        values: [n, T, ...] with NaN where unknown.
        valid: [n, T] presence; samples at which the track was absent remain unknown.
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
