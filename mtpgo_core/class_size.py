# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Length and width of road users whose size is not known."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.schema import LARGEST_SIZE_M, AgentClass, ClassArray, Float64Array

CLASS_SIZE_M = {
    AgentClass.UNKNOWN: (4.0, 1.8),
    AgentClass.CAR: (4.5, 1.8),
    AgentClass.TRUCK: (10.0, 2.5),
    AgentClass.BUS: (12.0, 2.5),
    AgentClass.TRAILER: (10.0, 2.5),
    AgentClass.MOTORCYCLE: (2.2, 0.8),
    AgentClass.BICYCLE: (1.8, 0.6),
    AgentClass.PEDESTRIAN: (0.5, 0.5),
    AgentClass.ANIMAL: (1.0, 0.5),
    AgentClass.VAN: (5.5, 2.0),
}
"""Length and width (m) of road users whose size is not known; chosen as usual for the class."""

_SIZES = np.array([CLASS_SIZE_M[kind] for kind in AgentClass])


def known_sizes(size: NDArray[np.floating[Any]], agent_class: ClassArray) -> Float64Array:
    """Return [n, 2] length and width (m), the class's usual ones where ``size`` [n, 2] is unknown.

    A size is unknown where it is NaN, not above zero or above :data:`LARGEST_SIZE_M`. A number
    that is not a class counts as the class unknown.
    """
    kind = np.where(agent_class < len(_SIZES), agent_class, AgentClass.UNKNOWN)
    known = (size > 0.0) & (size <= LARGEST_SIZE_M)
    return np.where(known, size.astype(np.float64), _SIZES[kind])
