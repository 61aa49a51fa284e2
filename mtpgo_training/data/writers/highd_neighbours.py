# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Neighbours of the vehicles on a straight carriageway, as highD lists them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.schema import BoolArray, Float64Array

NEIGHBOURS = (
    "preceding",
    "following",
    "leftPreceding",
    "leftAlongside",
    "leftFollowing",
    "rightPreceding",
    "rightAlongside",
    "rightFollowing",
)
"""The eight neighbours, in highD's order of columns."""


def neighbours(
    along: Float64Array, length: Float64Array, lane: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Return [n, 8] the index of each neighbour of the vehicles of a carriageway, -1 for none.

    All vehicles are of one frame. A vehicle in the next lane is alongside where the two boxes
    overlap lengthwise; of several, the one with the nearest centre counts.

    Args:
        along: [n] centre along the direction of travel (m).
        length: [n] (m).
        lane: [n] lane number, counted from the right.
    """
    n = len(along)
    ahead = along[None, :] - along[:, None]
    side = lane[None, :] - lane[:, None]
    other = ~np.eye(n, dtype=np.bool_)
    overlap = np.abs(ahead) < (length[None, :] + length[:, None]) / 2
    same, left, right = side == 0, side == 1, side == -1
    # Boxes in one lane hardly ever overlap; the order of their centres is the order in the lane.
    candidates = [same & other & (ahead > 0), same & other & (ahead <= 0)]
    for lanes in (left, right):
        candidates += [
            lanes & (ahead > 0) & ~overlap,
            lanes & overlap,
            lanes & (ahead <= 0) & ~overlap,
        ]
    out = np.stack([_nearest(np.abs(ahead), mask) for mask in candidates], axis=1)
    return out


def _nearest(distance: Float64Array, mask: BoolArray) -> NDArray[np.int64]:
    if not mask.shape[1]:
        return np.empty(0, dtype=np.int64)
    masked = np.where(mask, distance, np.inf)
    best = masked.argmin(axis=1)
    return np.where(mask.any(axis=1), best, -1).astype(np.int64)
