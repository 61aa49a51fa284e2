# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Agents that left before the common time, as members of the past graphs (paper, temporal graph).

The paper's graphs G_i have the agents of each step i, so one that has left by t still takes part
in the graphs of its own steps. It is not predicted. By default scenes leave such agents out;
``scene.departed_agents`` keeps them.
"""

from __future__ import annotations

import numpy as np

from mtpgo_core.schema import BoolArray, HistoryWindow, IndexArray
from mtpgo_core.task.task_description import SceneConfig


def with_departed(
    window: HistoryWindow, members: IndexArray, primary: BoolArray, config: SceneConfig
) -> tuple[IndexArray, BoolArray]:
    """Return the members and the primary flags of graphs with the departed agents appended.

    A departed agent belongs to a graph if it was within ``radius_m`` of the centre when it was
    last seen, the nearest first; together with the agents present there are at most
    ``max_neighbours``. The policy ``scene`` has neither limit.

    Args:
        window: the whole history, departed agents included.
        members: [B, N] positions in the window, the centre first, -1 for padding.
        primary: [B, N].
        config: policy and limits.
    """
    gone = np.flatnonzero(~window.valid[:, -1] & window.valid.any(axis=1))
    if not len(gone) or not len(members):
        return members, primary
    steps = window.valid.shape[1]
    last = steps - 1 - np.argmax(window.valid[gone, ::-1], axis=1)  # [g]
    centre = members[:, 0]
    # Where the centre was then, or where it is now if it was not there yet.
    when = np.where(window.valid[centre[:, None], last], last, steps - 1)  # [B, g]
    offset = window.position[gone, last] - window.position[centre[:, None], when]
    distance = np.hypot(offset[..., 0], offset[..., 1])
    rows = []
    for graph, row in enumerate(members):
        here = row[row >= 0]
        order = np.argsort(distance[graph], kind="stable")
        if config.policy != "scene":
            order = order[distance[graph, order] <= config.radius_m]
            order = order[: max(0, config.max_neighbours + 1 - len(here))]
        rows.append(np.concatenate([here, gone[order]]))
    width = max(members.shape[1], *(len(row) for row in rows))
    joined = np.full((len(rows), width), -1, dtype=members.dtype)
    for graph, row in enumerate(rows):
        joined[graph, : len(row)] = row
    published = np.zeros(joined.shape, dtype=bool)
    published[:, : primary.shape[1]] = primary
    return joined, published
