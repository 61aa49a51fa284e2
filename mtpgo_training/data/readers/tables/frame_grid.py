# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Frame numbers and a frame rate from the times of rows."""

from __future__ import annotations

import numpy as np

from mtpgo_core.schema import Float64Array
from mtpgo_training.data.recording import Int64Array

TOLERANCE_S = 1e-3
"""Deviation of a time from a grid (s) that is rounding; chosen: times are often whole
milliseconds, and at 30 m/s it is 3 cm."""

TOLERANCE_STEPS = 0.25
"""Deviation of a time from a grid, in steps of the grid, that is rounding; chosen: any times at
all are within half a step of a grid."""

FREE_RATE = 1000.0
"""Frame rate of times without a fixed rate (Hz); chosen: finer than any tracker's jitter."""

_ROUND_RATES = 1e-3
"""Relative deviation from a rate of at most one decimal that is rounding; chosen between that of
milliseconds and that of 29.97 Hz from 30 Hz."""


_VIDEO_RATES = (24 / 1.001, 30 / 1.001, 60 / 1.001, 120 / 1.001)
"""Frames per second of videos (Hz; SMPTE) that a short recording does not tell precisely."""


def frames_of_times(time_s: Float64Array) -> tuple[Int64Array, float]:
    """Return [rows] frame numbers from 0, and their rate (Hz): that of the times if it is steady.

    Args:
        time_s: [rows] times in any order (s), at least one.
    """
    elapsed_s = time_s - time_s.min()
    distinct = np.unique(np.round(elapsed_s, 6))
    steps_s = np.diff(distinct)
    # Where many times are missing, the rate follows from the shortest step, not the median.
    for step_s in (np.median(steps_s), steps_s.min()) if len(steps_s) else ():
        for rate in _candidates(_rate(steps_s, float(step_s))):
            number = np.round(distinct * rate)
            tolerance_s = min(TOLERANCE_S, TOLERANCE_STEPS / rate)
            fits = np.abs(number / rate - distinct) <= tolerance_s
            if fits.all() and (np.diff(number) > 0).all():
                return np.round(elapsed_s * rate).astype(np.int64), rate
    return np.round(elapsed_s * FREE_RATE).astype(np.int64), FREE_RATE if len(steps_s) else 10.0


def _candidates(measured: float) -> list[float]:
    """Return the rates (Hz) that a measured one may stand for, the most usual first.

    A rate such as 1000 / 15 Hz is near a round one, which many frames tell apart.
    """
    usual = (round(measured, 1), measured, round(measured, 2), *_VIDEO_RATES)
    return [rate for rate in usual if rate > 0 and abs(rate - measured) < _ROUND_RATES * rate / 2]


def _rate(steps_s: Float64Array, step_s: float) -> float:
    """Return the rate (Hz) that fits all steps, from a rounded one.

    The number of frames in a long pause is known only once the rate is known well enough: the
    steps are taken into account from the shortest to the longest.
    """
    rate, longest = 1.0 / step_s, 4.0
    while True:
        some = steps_s * rate <= longest
        number = np.round(steps_s[some] * rate)
        if number.any():
            rate = float(number.sum() / steps_s[some][number > 0].sum())
        if some.all():
            return rate
        longest *= 4.0


def without_common_step(frame: Int64Array, frame_rate: float) -> tuple[Int64Array, float]:
    """Return frames and rate with the frames counted in their common step.

    Annotations of every tenth frame of a video become frames 0, 1, 2 at a tenth of its rate.

    Args:
        frame: [rows] frame numbers.
        frame_rate: their rate (Hz).
    """
    distinct = np.unique(frame)
    step = int(np.gcd.reduce(np.diff(distinct))) if len(distinct) > 1 else 1
    if step <= 1:
        return frame, frame_rate
    return (frame - distinct[0]) // step, frame_rate / step
