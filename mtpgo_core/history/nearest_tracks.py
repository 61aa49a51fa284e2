# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Selects the road users to keep where there are too many: the nearest to the ego or the middle.

The middle is the median position, which a few distant objects do not move. Hysteresis: those kept
in the last cycle are preferred, so that two road users at the limit do not alternate.
"""

from __future__ import annotations

import numpy as np

from mtpgo_core.history.track_index import SortKeyArray, sort_keys
from mtpgo_core.schema import BoolArray, Float64Array, KeyArray

_KEEP = 0.8
"""Distances of road users that were kept in the last cycle are scaled by this; chosen."""


def centre_of(
    position: Float64Array, keys: SortKeyArray, ego_key: KeyArray | None
) -> Float64Array:
    """Return [2] the ego's position (m) or, if it is not among the agents, the median.

    Args:
        position: [n, 2] finite (m), n > 0.
        keys: [n] sort keys.
        ego_key: [4] identity of the ego, None for none.
    """
    if ego_key is not None:
        found = np.flatnonzero(keys == sort_keys(ego_key.reshape(1, 4))[0])
        if found.shape[0]:
            return position[found[0]]
    return np.asarray(np.median(position, axis=0))


def nearest(position: Float64Array, centre: Float64Array, most: int, kept: BoolArray) -> BoolArray:
    """Return [n] the ``most`` agents nearest to the centre.

    Args:
        position: [n, 2] (m).
        centre: [2] (m).
        most: how many.
        kept: [n] those kept in the last cycle.
    """
    chosen = np.zeros(position.shape[0], dtype=bool)
    distance = np.linalg.norm(position - centre, axis=1)
    distance[kept] *= _KEEP
    chosen[np.argsort(distance, kind="stable")[:most]] = True
    return chosen
