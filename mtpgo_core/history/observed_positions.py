# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Observed positions of the tracks of a history at past times: the truth of predictions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.schema import BoolArray, Float64Array


@dataclass(frozen=True)
class ObservedPositions:
    """Where n tracks were at k times.

    Attributes:
        number: [n] their numbers, ascending.
        last_ns: [n] when each was observed last (ns).
        position: [n, k, 2] in the history's frame (m), meaningless where not known.
        known: [n, k] the track was observed then, or closely before and after.
    """

    number: NDArray[np.int64]
    last_ns: NDArray[np.int64]
    position: Float64Array
    known: BoolArray
