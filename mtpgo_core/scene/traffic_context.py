# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The agents all around: the road context of multi-lane traffic (context ``traffic``).

Extends :mod:`mtpgo_core.scene.leader_context`: a driver in a queue reacts to the third vehicle
ahead within five seconds, a gap is measured between bumpers, a long vehicle accelerates slowly,
and a lane change depends on the vehicles in the neighbouring lanes (docs/design.md, "Traffic").
All features are geometry of the observations of one step, without a map.
"""

from __future__ import annotations

import functools
import math

import numpy as np

from mtpgo_core.scene.leader_context import BAND_M
from mtpgo_core.scene.neighbour_geometry import NeighbourGeometry, in_blocks, nearness
from mtpgo_core.schema import BoolArray, Float64Array, HistoryWindow, IndexArray
from mtpgo_core.task.task_description import CONTEXT_FEATURES

LEADERS = 3
"""Agents ahead in the agent's own band that are described."""
LANE_M = 3.6
"""Width of the bands to the left and right of the agent's own (m): a motorway lane."""
USUAL_LENGTH_M = 4.5
"""Length of an agent whose tracker gives none (m): a car."""


def traffic_features(
    window: HistoryWindow, agents: IndexArray, reach_m: float = 80.0
) -> Float64Array:
    """Return [r, T, 29] features of the agents around each of ``agents`` [r].

    The columns are those of ``CONTEXT_FEATURES["traffic"]``,
    :mod:`mtpgo_core.task.task_description`.

    The own band reaches ``BAND_M`` to either side of the straight line along the agent's yaw at
    that step, the ``left`` and ``right`` bands ``LANE_M`` farther. An agent counts as ahead or
    behind by its centre, up to ``reach_m`` away; the nearest in each place is described, in the
    own band the nearest three ahead (``lead1`` to ``lead3``). For each of them:

    * ``gap``: the distance along the agent's yaw between the bumpers (m), negative if they
      overlap, ``reach_m`` where no agent is;
    * ``near``: exp(-gap / 20 m), 0 where no agent is;
    * ``dv``: its velocity minus the agent's, along the agent's yaw (m/s), else 0;
    * ``ax``: its acceleration along the agent's yaw (m/s^2), else 0;
    * ``across``: the distance to the left of its centre (m), else 0.

    ``length`` is the agent's own (m). An unknown length is ``USUAL_LENGTH_M``. The values
    do not depend on the scene frame. They are meaningful where the agent is valid.
    """
    columns = functools.partial(_around, reach_m=reach_m)
    within_m = math.hypot(reach_m, BAND_M + LANE_M)
    return in_blocks(columns, len(CONTEXT_FEATURES["traffic"]), window, agents, within_m)


def _around(around: NeighbourGeometry, reach_m: float) -> Float64Array:
    """Return :func:`traffic_features` of one block of agents."""
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
    who: IndexArray,
    there: BoolArray,
    own: Float64Array,
    length: Float64Array,
    reach_m: float,
) -> list[Float64Array]:
    """Return gap, near and dv, [r, T] each, of the nearest agent ``who`` in a place."""
    gap = np.abs(around.offset(who)[0]) - 0.5 * (own + length[who])
    return [
        np.where(there, gap, reach_m),
        nearness(np.maximum(gap, 0.0), there),
        np.where(there, around.relative_speed(who), 0.0),
    ]
