# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Detects tracks whose observations alternate between two places.

Two publishers that use the same identity for different road users a few metres apart look like one
track that jumps back and forth by less than an impossible move. Each observation then deviates
from the line between its neighbours, to alternating sides; neither noise nor motion does so for
long.
"""

from __future__ import annotations

import numpy as np

from mtpgo_core.history.resampling import NEVER_NS
from mtpgo_core.history.sample_rings import longer
from mtpgo_core.schema import BoolArray, Float64Array, IndexArray

LEAST_M = 1.0
"""Smallest deviation that counts (m); chosen above a tracker's noise."""

_OPPOSITE = -0.5
"""Largest cosine between two deviations to opposite sides; chosen: within 60 degrees of it."""

IN_A_ROW = 4
"""Deviations in a row, each opposite to the one before, after which a track alternates; chosen."""


class AlternationDetector:
    """The last observations of each track, as far as the detection needs them.

    Args:
        capacity: number of slots.
    """

    def __init__(self, capacity: int) -> None:
        self._before_ns = np.full(capacity, NEVER_NS, dtype=np.int64)
        self._before = np.zeros((capacity, 2))
        self._deviation = np.zeros((capacity, 2))
        self._in_a_row = np.zeros(capacity, dtype=np.int64)

    def reset(self, slot: IndexArray) -> None:
        """Forget the slots."""
        self._before_ns[slot] = NEVER_NS
        self._deviation[slot] = 0.0
        self._in_a_row[slot] = 0

    def grow(self, capacity: int) -> None:
        """Make room for ``capacity`` slots; new ones are reset before their first use."""
        for name, array in vars(self).items():
            setattr(self, name, longer(array, capacity))

    def step(
        self,
        slot: IndexArray,
        stamp_ns: int,
        position: Float64Array,
        last_ns: IndexArray,
        last: Float64Array,
    ) -> BoolArray:
        """Return [n] which tracks alternate, and remember their observations.

        Args:
            slot: [n] tracks with a sample.
            stamp_ns: time of the new observations (ns).
            position: [n, 2] their positions (m).
            last_ns: [n] time of each track's last sample (ns).
            last: [n, 2] its position (m).
        """
        before_ns, before = self._before_ns[slot], self._before[slot]
        known = before_ns != NEVER_NS
        span = np.where(known, stamp_ns - before_ns, 1)
        share = np.where(known, last_ns - before_ns, 0) / span
        deviation = deviations(share, before, last, position)
        deviation[~known] = 0.0
        turned = turned_back(deviation, self._deviation[slot])
        row = np.where(turned, self._in_a_row[slot] + 1, 0)
        self._before_ns[slot], self._before[slot] = last_ns, last
        self._deviation[slot], self._in_a_row[slot] = deviation, row
        return np.asarray(row >= IN_A_ROW)


def deviations(
    share: Float64Array, before: Float64Array, last: Float64Array, position: Float64Array
) -> Float64Array:
    """Return [n, 2] how far observations are off the line between their neighbours (m).

    Args:
        share: [n] of the time between the neighbours that was over.
        before: [n, 2] position of the neighbour before (m).
        last: [n, 2] of the observation (m).
        position: [n, 2] of the neighbour after it (m).
    """
    return last - (before + share[:, None] * (position - before))


def turned_back(deviation: Float64Array, earlier: Float64Array) -> BoolArray:
    """Return [n] which deviations are large, and to the other side than those before.

    Args:
        deviation: [n, 2] see :func:`deviations`.
        earlier: [n, 2] of the observation before, 0 for none.
    """
    length = np.linalg.norm(deviation, axis=1)
    product = length * np.linalg.norm(earlier, axis=1)
    opposite = (deviation * earlier).sum(axis=1) < _OPPOSITE * product
    return np.asarray(opposite & (length > LEAST_M))
