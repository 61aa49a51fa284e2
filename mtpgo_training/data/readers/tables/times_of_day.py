# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Times of day that begin again at midnight."""

from __future__ import annotations

import numpy as np

from mtpgo_core.schema import Float64Array
from mtpgo_training.data.recording import Int64Array

DAY_S = 86400.0

_LONGEST_STEP_S = 5.0
"""Longest pause at midnight (s) over which a recording goes on; chosen, as in bags."""


def midnight_in(time_s: Float64Array, track: Int64Array) -> float | None:
    """Return below which time of day (s) the rows are of the next day, None if none are.

    They are where all times are within a day, half of which or more has no row, while rows come
    shortly before and after midnight and a road user has both.

    Args:
        time_s: [rows] times (s), in any order, at least one.
        track: [rows] index of the track.
    """
    distinct = np.unique(time_s)
    if len(distinct) < 2 or distinct[0] < 0.0 or distinct[-1] > DAY_S:
        return None
    gaps_s = np.diff(distinct)
    widest = int(np.argmax(gaps_s))
    begin_s = float(distinct[widest + 1])
    over_midnight_s = distinct[0] + DAY_S - distinct[-1]
    if gaps_s[widest] < 0.5 * DAY_S or over_midnight_s > _LONGEST_STEP_S:
        return None
    next_day = time_s < begin_s
    return begin_s if np.isin(track[next_day], track[~next_day]).any() else None


def after_midnight(time_s: Float64Array, begin_s: float | None) -> Float64Array:
    """Return times with those of the next day a day later.

    Args:
        time_s: times of day (s).
        begin_s: of :func:`midnight_in`.
    """
    return time_s if begin_s is None else np.where(time_s < begin_s, time_s + DAY_S, time_s)
