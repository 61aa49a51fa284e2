# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Who drives around: the road context of multi-lane traffic (context ``traffic``, design D13).

Beside what :mod:`mtpgo_core.leaders` says of the way ahead, a driver in a queue answers to the
third vehicle ahead within five seconds, a gap is what is left between bumpers, a long vehicle
accelerates slowly, and who changes a lane looks at those beside it. All of it is geometry of what
was observed at the step, without a map.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.leaders import BAND_M
from mtpgo_core.schema import Float64Array, HistoryWindow
from mtpgo_core.surroundings import Surroundings, in_blocks, nearness
from mtpgo_core.task import CONTEXT_FEATURES

LEADERS = 3
LANE_M = 3.6
"""Width of the bands to the left and right of one's own."""
USUAL_LENGTH_M = 4.5
"""Taken for a vehicle whose length the tracker does not tell."""


def traffic_features(
    window: HistoryWindow, agents: NDArray[np.intp], reach_m: float = 80.0
) -> Float64Array:
    """[r, T, 29] what drives around each of ``agents`` [r].

    The columns are those of ``CONTEXT_FEATURES["traffic"]``, :mod:`mtpgo_core.task`.

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

    def columns(around: Surroundings) -> Float64Array:
        return _around(around, reach_m)

    return in_blocks(columns, len(CONTEXT_FEATURES["traffic"]), window, agents)


def _around(around: Surroundings, reach_m: float) -> Float64Array:
    """:func:`traffic_features` of a few agents."""
    length = np.nan_to_num(around.window.size[:, 0], nan=USUAL_LENGTH_M)
    own = length[around.agents]
    along, across = around.along, around.across
    zero = np.zeros_like(around.cos)
    parts = [zero + own[:, None]]

    def place(who: NDArray[np.intp], away: Float64Array) -> tuple[Float64Array, NDArray[np.bool_]]:
        """Columns gap, near and dv of the nearest, and whether there is one."""
        there = np.isfinite(away)
        gap = np.where(there, away - 0.5 * (own[:, None] + length[who]), reach_m)
        near = nearness(np.maximum(gap, 0.0), there)
        return np.stack([gap, near, np.where(there, around.faster(who), 0.0)]), there

    distance = np.abs(along)
    within = (distance < reach_m) & (distance > 0.0)
    band = np.abs(across) < BAND_M
    ahead = np.where(within & band & (along > 0.0), distance, np.inf)
    first_across = zero
    for i in range(LEADERS):
        who, away = around.nearest(ahead)
        of_place, there = place(who, away)
        parts += [*of_place, np.where(there, around.acceleration(who), 0.0)]
        if i == 0:
            aside = np.take_along_axis(across, who[:, None], axis=1)[:, 0]
            first_across = np.where(there, aside, 0.0)
        np.put_along_axis(ahead, who[:, None], np.inf, axis=1)
    parts.append(first_across)
    behind = np.where(within & band & (along < 0.0), distance, np.inf)
    parts += [*place(*around.nearest(behind))[0]]
    for sign in (1.0, -1.0):
        aside = sign * across
        lane = within & (aside >= BAND_M) & (aside < BAND_M + LANE_M)
        for direction in (1.0, -1.0):
            there = lane & (direction * along > 0.0)
            parts += [*place(*around.nearest(np.where(there, distance, np.inf)))[0]]
    return np.stack(parts, axis=-1)
