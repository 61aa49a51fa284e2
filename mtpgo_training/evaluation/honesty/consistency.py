# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""How far a prediction jumps from one instant to the next, for the same time in the future."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.quality.metrics import Array

LONGEST_CYCLE_S = 1.0
"""Predictions farther apart are not compared (s); chosen: a jump is one from cycle to cycle."""

TOLERANCE_NS = 2_000_000
"""Stamps that differ by less from a whole number of steps are compared (ns); chosen far below a
step and above the rounding of stamps."""

IntArray = NDArray[np.int64]


def earlier_rows(
    track: IntArray, stamp_ns: IntArray, horizon_steps: int, dt_s: float
) -> tuple[IntArray, IntArray]:
    """Find the latest earlier prediction of each row's agent, a whole number of steps before.

    Args:
        track: [n] who is predicted.
        stamp_ns: [n] when (ns).
        horizon_steps: H.
        dt_s: time between two steps (s).

    Returns:
        [n] row of that prediction, -1 where there is none within :data:`LONGEST_CYCLE_S`; [n] by
        how many steps it is earlier, 0 where there is none.
    """
    n = len(track)
    order = np.lexsort((stamp_ns, track))
    first_ns = stamp_ns.min(initial=np.iinfo(np.int64).max)
    span = int((stamp_ns - first_ns).max(initial=0)) + 2 * round((LONGEST_CYCLE_S + dt_s) * 1e9)
    _, code = np.unique(track, return_inverse=True)
    key = code * span + (stamp_ns - first_ns)
    ordered = key[order]
    row, steps = np.full(n, -1), np.zeros(n, dtype=np.int64)
    longest = min(horizon_steps - 1, int(LONGEST_CYCLE_S / dt_s + 1e-6))
    for k in range(1, longest + 1):
        wanted = key - round(k * dt_s * 1e9)
        place = np.minimum(np.searchsorted(ordered, wanted - TOLERANCE_NS), max(n - 1, 0))
        found = (row < 0) & (np.abs(ordered[place] - wanted) <= TOLERANCE_NS)
        row[found], steps[found] = order[place[found]], k
    return row, steps


def jumps(path: Array, row: IntArray, steps: IntArray) -> Array:
    """[n] distance of the last point predicted earlier from the one for the same time now (m).

    Args:
        path: [n, H, 2] (m).
        row: [n] the earlier prediction, see :func:`earlier_rows`.
        steps: [n] by how many steps it is earlier.

    Returns:
        NaN where there is no earlier prediction.
    """
    horizon = path.shape[1]
    now = path[np.arange(len(path)), horizon - 1 - steps]
    return np.where(row >= 0, np.linalg.norm(now - path[row, -1], axis=-1), np.nan)
