# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Which agents share a graph, and which graph's prediction is an agent's own (design D14).

Policies: ``ego`` one graph around a named agent, the paper's choice (sec. Graph-based Traffic
Modeling); ``cover`` a few graphs that reach every agent; ``each`` one graph around every agent;
``scene`` one graph of all. A graph is its centre and the ``max_neighbours`` agents nearest to it
within ``radius_m``; ``scene`` alone knows no limit (whoever calls bounds the number of agents).
Agents that the ego's graph does not reach are covered like those of ``cover``, so every agent is
predicted exactly once, whatever the policy.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from mtpgo_core.history.track_index import NameArray, find_names, names_of
from mtpgo_core.scene.graph_cover import KEEP, IndexArray, cover_centres, neighbourhoods
from mtpgo_core.schema import BoolArray, Float64Array, HistoryWindow, KeyArray
from mtpgo_core.task.task_description import SceneConfig

_STAY = 0.5
"""An agent leaves its graph when another centre is nearer than this times its own."""
_FORESIGHT_S = 1.0
"""A centre counts as farther by what it moves apart in this time, so that agents belong to those
they move along with, not to the oncoming ones that pass by."""


def _no_names() -> NameArray:
    return np.empty(0, dtype="S16")


@dataclass
class GraphState:
    """What one cycle leaves to the next so that predictions do not flicker.

    :func:`choose_graphs` reads and renews it. Attributes: ``centre`` names of the centres,
    ``agent`` sorted names of the agents and ``owner`` the name of each one's centre.
    """

    centre: NameArray = field(default_factory=_no_names)
    agent: NameArray = field(default_factory=_no_names)
    owner: NameArray = field(default_factory=_no_names)


@dataclass(frozen=True)
class Graphs:
    """The graphs of one instant.

    Attributes:
        members: [B, N] positions in the window, the centre first, then by rising distance, -1
            for padding.
        primary: [B, N] this graph's prediction is the agent's published one.
    """

    members: IndexArray
    primary: BoolArray


def choose_graphs(
    window: HistoryWindow,
    config: SceneConfig,
    *,
    ego_key: KeyArray | None = None,
    state: GraphState | None = None,
) -> Graphs:
    """The graphs of the agents present at the window's common time.

    Args:
        window: the history; agents absent at t take no part.
        config: policy and limits.
        ego_key: [4] identity of the ego for ``ego`` (and the centre of ``scene``); where it is
            missing or not present, ``ego`` does as ``cover``.
        state: the memory of the cycles before, renewed here.
    """
    present = np.flatnonzero(window.valid[:, -1])
    if present.shape[0] == 0:
        return Graphs(np.zeros((0, 1), dtype=np.intp), np.zeros((0, 1), dtype=bool))
    state = GraphState() if state is None else state
    position = window.position[present, -1]
    names = names_of(window.key[present])
    by_name = np.argsort(names, kind="stable")
    ego = -1
    if ego_key is not None:
        ego = int(_positions(names, by_name, names_of(ego_key.reshape(1, 4)))[0])
    kept = _positions(names, by_name, state.centre)

    if config.policy == "each":
        centre = np.arange(present.shape[0])
    elif config.policy == "scene":
        centre = _scene_centre(position, ego, kept)
    else:
        named = ego if config.policy == "ego" else -1
        centre = cover_centres(position, config, named, kept[(kept >= 0) & (kept != named)])
    whole = config.policy == "scene"
    members, distance = neighbourhoods(
        position,
        centre,
        position.shape[0] if whole else config.max_neighbours,
        np.inf if whole else config.radius_m,
    )

    if config.policy == "each":
        owner = np.arange(present.shape[0])
    else:
        before = find_names(state.agent, names)
        owned = np.where(before >= 0, before, 0)
        previous = np.full(names.shape[0], -1, dtype=np.intp)
        if state.owner.shape[0]:
            order = np.argsort(names[centre], kind="stable")
            previous = _positions(names[centre], order, state.owner[owned])
            previous[before < 0] = -1
        velocity = np.nan_to_num(window.velocity[present, -1])
        parting = np.linalg.norm(velocity[members] - velocity[centre][:, None], axis=2)
        distance = distance + _FORESIGHT_S * parting
        owner = _owners(members, distance, previous, ego_first=config.policy == "ego" and ego >= 0)
    state.centre = names[centre]
    state.agent, state.owner = names[by_name], names[centre[owner]][by_name]
    primary = (members >= 0) & (owner[members] == np.arange(centre.shape[0])[:, None])
    return Graphs(np.where(members >= 0, present[members], -1), primary)


def graphs_around(window: HistoryWindow, config: SceneConfig, centres: IndexArray) -> Graphs:
    """One graph around each of the given agents, as for training: all members are primary.

    Args:
        window: the history; agents absent at t take no part.
        config: limits; of the policies only ``scene`` matters, which has none.
        centres: [B] positions in the window of agents that are present at t.
    """
    present = np.flatnonzero(window.valid[:, -1])
    whole = config.policy == "scene"
    members, _ = neighbourhoods(
        window.position[present, -1],
        np.searchsorted(present, centres),
        present.shape[0] if whole else config.max_neighbours,
        np.inf if whole else config.radius_m,
    )
    return Graphs(np.where(members >= 0, present[members], -1), members >= 0)


def _positions(names: NameArray, order: IndexArray, wanted: NameArray) -> IndexArray:
    """Where the wanted names stand in ``names`` (sorted by ``order``), -1 where nowhere."""
    place = find_names(names[order], wanted)
    return np.where(place >= 0, order[place], -1)


def _scene_centre(position: Float64Array, ego: int, kept: IndexArray) -> IndexArray:
    """The ego, else the agent nearest to the middle, the previous one while nearly as near."""
    if ego >= 0:
        return np.array([ego])
    off_m = np.linalg.norm(position - position.mean(axis=0), axis=1)
    best = int(np.argmin(off_m))
    # Slack of a vehicle's length, so that in a small scene two agents do not take turns.
    if kept.shape[0] and kept[0] >= 0 and KEEP * off_m[kept[0]] <= off_m[best] + 5.0:
        best = int(kept[0])
    return np.array([best])


def _owners(
    members: IndexArray, distance: Float64Array, previous: IndexArray, *, ego_first: bool
) -> IndexArray:
    """[n] the graph that predicts each agent: the nearest centre, with hysteresis.

    Args:
        members: [B, K] agents of each graph.
        distance: [B, K] their distances (m).
        previous: [n] the graph whose centre predicted the agent last, -1 for none.
        ego_first: the first graph predicts all its agents.
    """
    n, rows = previous.shape[0], np.arange(members.shape[0])
    reach = np.full((members.shape[0], n + 1), np.inf)
    reach[rows[:, None], members] = distance  # padding: the last column
    reach = reach[:, :n]
    owner = np.argmin(reach, axis=0)
    agents = np.arange(n)
    held = np.where(previous >= 0, reach[previous, agents], np.inf)
    stay = np.isfinite(held) & (_STAY * held <= reach[owner, agents])
    owner = np.where(stay, previous, owner)
    if ego_first:
        owner = np.where(np.isfinite(reach[0]), 0, owner)
    return owner
