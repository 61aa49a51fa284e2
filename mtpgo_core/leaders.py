# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Who drives ahead: the road context that needs no map (context ``leaders``, design D13).

On recordings of dense traffic, what the next two vehicles ahead do explains more of an agent's
next five seconds than its own past does. Attention could find them among the neighbours, but from
little data it does not: they are found by geometry here, at every history step, from what was
observed at that step.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.schema import Float64Array, HistoryWindow

LEADERS = 2
BAND_M = 2.0
"""Half the width of the path ahead: half a lane and a little."""
NEAR_M = 20.0
"""Distance over which nearness falls to 1/e."""
COLUMNS = ("gap", "near", "dv", "ax")

_BLOCK = 1 << 20
"""Pairs times steps that are worked on at a time, which bounds the memory for large scenes."""


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
    steps = window.valid.shape[1]
    out = np.empty((len(agents), steps, LEADERS * len(COLUMNS)))
    rows = max(1, _BLOCK // max(1, len(window) * steps))
    for start in range(0, len(agents), rows):
        some = agents[start : start + rows]
        out[start : start + rows] = _ahead_of(window, some, reach_m)
    return out


def _ahead_of(window: HistoryWindow, agents: NDArray[np.intp], reach_m: float) -> Float64Array:
    """:func:`leader_features` of a few agents."""
    yaw = np.nan_to_num(window.yaw[agents])[:, None]  # [r, 1, T]
    cos, sin = np.cos(yaw), np.sin(yaw)
    offset = window.position[None] - window.position[agents][:, None]  # [r, n, T, 2]
    along = cos * offset[..., 0] + sin * offset[..., 1]
    across = cos * offset[..., 1] - sin * offset[..., 0]
    with np.errstate(invalid="ignore"):  # NaN where somebody is absent compares as not ahead
        ahead = (along > 0.0) & (along < reach_m) & (np.abs(across) < BAND_M)
    along = np.where(ahead, along, np.inf)
    row = np.arange(len(agents))[:, None]
    step = np.arange(along.shape[2])
    speed = (
        cos[:, 0] * window.velocity[agents][..., 0] + sin[:, 0] * window.velocity[agents][..., 1]
    )
    parts = []
    for _ in range(LEADERS):
        leader = along.argmin(axis=1)  # [r, T]
        gap = along[row, leader, step]
        there = np.isfinite(gap)
        velocity = window.velocity[leader, step]
        acceleration = window.acceleration[leader, step]
        dv = cos[:, 0] * velocity[..., 0] + sin[:, 0] * velocity[..., 1] - speed
        ax = cos[:, 0] * acceleration[..., 0] + sin[:, 0] * acceleration[..., 1]
        parts += [
            np.where(there, gap, reach_m),
            np.where(there, np.exp(-np.where(there, gap, 0.0) / NEAR_M), 0.0),
            np.where(there, dv, 0.0),
            np.where(there, ax, 0.0),
        ]
        along[row, leader, step] = np.inf
    return np.stack(parts, axis=-1)
