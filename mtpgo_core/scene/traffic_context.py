# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Who drives around: the road context of multi-lane traffic (context ``traffic``, design D13).

Beside what :mod:`mtpgo_core.scene.leader_context` says of the way ahead, a driver in a queue
answers to the third vehicle ahead within five seconds, a gap is what is left between bumpers, a
long vehicle accelerates slowly, and who changes a lane looks at those beside it. All of it is
geometry of what was observed at the step, without a map.
"""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.scene.leader_context import BAND_M
from mtpgo_core.scene.neighbour_geometry import NeighbourGeometry, in_blocks, nearness
from mtpgo_core.schema import BoolArray, Float64Array, HistoryWindow
from mtpgo_core.task.task_description import CONTEXT_FEATURES

LEADERS = 3
LANE_M = 3.6
"""Width of the bands to the left and right of one's own."""
USUAL_LENGTH_M = 4.5
"""Taken for a vehicle whose length the tracker does not tell."""


def traffic_features(
    window: HistoryWindow, agents: NDArray[np.intp], reach_m: float = 80.0
) -> Float64Array:
    """[r, T, 29] what drives around each of ``agents`` [r].

    The columns are those of ``CONTEXT_FEATURES["traffic"]``,
    :mod:`mtpgo_core.task.task_description`.

    The own band reaches ``BAND_M`` to either side of the straight line along the agent's yaw at
    that step, the ``left`` and ``right`` bands ``LANE_M`` farther. An agent counts as ahead or
    behind by its centre, up to ``reach_m`` away; of each place the nearest counts, in the own band
    the nearest three ahead (``lead1`` to ``lead3``). Of each of them:

    * ``gap``: the distance along the agent's yaw between the bumpers (m), negative beside each
      other, ``reach_m`` where nobody is;
    * ``near``: exp(-gap / 20 m), 0 where nobody is;
    * ``dv``: its velocity less the agent's, along the agent's yaw (m/s), else 0;
    * ``ax``: its acceleration along the agent's yaw (m/s^2), else 0;
    * ``across``: how far to the left its centre is (m), else 0.

    ``length`` is the agent's own (m). A length that is not known is ``USUAL_LENGTH_M``. The values
    do not depend on the scene frame. They are of use where the agent is valid.
    """
    columns = functools.partial(_around, reach_m=reach_m)
    return in_blocks(columns, len(CONTEXT_FEATURES["traffic"]), window, agents)


def _around(around: NeighbourGeometry, reach_m: float) -> Float64Array:
    """:func:`traffic_features` of a few agents."""
    length = np.nan_to_num(around.window.size[:, 0], nan=USUAL_LENGTH_M)
    own = length[around.agents, None]
    along, across = around.along, around.across
    distance = np.abs(along)
    sides = np.abs(across)
    band = (distance < reach_m) & (sides < BAND_M)
    ahead = band & (along > 0.0)
    parts = [np.broadcast_to(own, around.cos.shape)]
    leaders = []
    for _ in range(LEADERS):
        who, there = around.nearest(ahead, distance)
        parts += [
            *_place(around, who, there, own, length, reach_m),
            np.where(there, around.acceleration(who), 0.0),
        ]
        leaders.append((who, there))
        np.put_along_axis(ahead, who[..., None], False, axis=2)
    first, there = leaders[0]
    parts.append(np.where(there, around.offset(first)[1], 0.0))
    lane = (distance < reach_m) & (sides >= BAND_M) & (sides < BAND_M + LANE_M)
    left, right = lane & (across > 0.0), lane & (across < 0.0)
    for some in (
        band & (along < 0.0),
        left & (along > 0.0),
        left & (along < 0.0),
        right & (along > 0.0),
        right & (along < 0.0),
    ):
        who, there = around.nearest(some, distance)
        parts += _place(around, who, there, own, length, reach_m)
    return np.stack(parts, axis=-1)


def _place(
    around: NeighbourGeometry,
    who: NDArray[np.intp],
    there: BoolArray,
    own: Float64Array,
    length: Float64Array,
    reach_m: float,
) -> list[Float64Array]:
    """[r, T] each: gap, near and dv of the nearest at a place, where somebody is there."""
    gap = np.abs(around.offset(who)[0]) - 0.5 * (own + length[who])
    return [
        np.where(there, gap, reach_m),
        nearness(np.maximum(gap, 0.0), there),
        np.where(there, around.faster(who), 0.0),
    ]
