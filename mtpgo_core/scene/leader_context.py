# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Who drives ahead: the road context that needs no map (context ``leaders``, design D13).

On recordings of dense traffic, what the next two vehicles ahead do explains more of an agent's
next five seconds than its own past does. Attention could find them among the neighbours, but from
little data it does not: they are found by geometry here, at every history step, from what was
observed at that step.
"""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.scene.neighbour_geometry import NeighbourGeometry, in_blocks, nearness
from mtpgo_core.schema import Float64Array, HistoryWindow

LEADERS = 2
BAND_M = 2.0
"""Half the width of the path ahead: half a lane and a little."""
COLUMNS = ("gap", "near", "dv", "ax")


def leader_features(
    window: HistoryWindow, agents: NDArray[np.intp], reach_m: float = 80.0
) -> Float64Array:
    """[r, T, 8] what is known of the two next agents ahead of each of ``agents`` [r].

    Ahead is what lies within ``BAND_M`` of the straight line along the agent's own yaw at that
    step, up to ``reach_m``, centre to centre. For each of the two in turn:

    * ``gap``: distance ahead (m), ``reach_m`` where nobody is;
    * ``near``: exp(-gap / ``NEAR_M``), 0 where nobody is;
    * ``dv``: its velocity less the agent's, along the agent's yaw (m/s), else 0;
    * ``ax``: its acceleration along the agent's yaw (m/s^2), else 0.

    The values do not depend on the scene frame. They are of use where the agent is valid.
    """
    columns = functools.partial(_ahead_of, reach_m=reach_m)
    return in_blocks(columns, LEADERS * len(COLUMNS), window, agents)


def _ahead_of(around: NeighbourGeometry, reach_m: float) -> Float64Array:
    """:func:`leader_features` of a few agents."""
    along = around.along
    ahead = (along > 0.0) & (along < reach_m) & (np.abs(around.across) < BAND_M)
    parts = []
    for _ in range(LEADERS):
        leader, there = around.nearest(ahead, along)
        gap = around.offset(leader)[0]
        parts += [
            np.where(there, gap, reach_m),
            nearness(gap, there),
            np.where(there, around.faster(leader), 0.0),
            np.where(there, around.acceleration(leader), 0.0),
        ]
        np.put_along_axis(ahead, leader[..., None], False, axis=2)
    return np.stack(parts, axis=-1)
