# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The agents ahead: a road context without a map (context ``leaders``).

In dense traffic, the motion of the next two vehicles ahead explains more of an agent's next five
seconds than its own past. Attention could find them among the neighbours, but does not learn to
from little data (docs/design.md, "Leaders"). They are found here by geometry, at every history
step, from the observations of that step.
"""

from __future__ import annotations

import functools
import math

import numpy as np

from mtpgo_core.scene.neighbour_geometry import NeighbourGeometry, in_blocks, nearness
from mtpgo_core.schema import Float64Array, HistoryWindow, IndexArray

LEADERS = 2
"""Agents ahead that are described."""
BAND_M = 2.0
"""Half the width of the path ahead (m); chosen: half a lane of 3.6 m and a margin."""
COLUMNS = ("gap", "near", "dv", "ax")


def leader_features(
    window: HistoryWindow, agents: IndexArray, reach_m: float = 80.0
) -> Float64Array:
    """Return [r, T, 8] features of the next two agents ahead of each of ``agents`` [r].

    An agent is ahead within ``BAND_M`` of the straight line along the agent's own yaw at that
    step, up to ``reach_m``, centre to centre. For each of the two in turn:

    * ``gap``: distance ahead (m), ``reach_m`` where no agent is;
    * ``near``: exp(-gap / ``NEAR_M``), 0 where no agent is;
    * ``dv``: its velocity minus the agent's, along the agent's yaw (m/s), else 0;
    * ``ax``: its acceleration along the agent's yaw (m/s^2), else 0.

    The values do not depend on the scene frame. They are meaningful where the agent is valid.
    """
    columns = functools.partial(_ahead_of, reach_m=reach_m)
    within_m = math.hypot(reach_m, BAND_M)
    return in_blocks(columns, LEADERS * len(COLUMNS), window, agents, within_m)


def _ahead_of(around: NeighbourGeometry, reach_m: float) -> Float64Array:
    """Return :func:`leader_features` of one block of agents."""
    along = around.along
    ahead = (along > 0.0) & (along < reach_m) & (np.abs(around.across) < BAND_M)
    parts = []
    for _ in range(LEADERS):
        leader, there = around.nearest(ahead, along)
        gap = around.offset(leader)[0]
        parts += [
            np.where(there, gap, reach_m),
            nearness(gap, there),
            np.where(there, around.relative_speed(leader), 0.0),
            np.where(there, around.acceleration(leader), 0.0),
        ]
        np.put_along_axis(ahead, leader[..., None], False, axis=2)
    return np.stack(parts, axis=-1)
