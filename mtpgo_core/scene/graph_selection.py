# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Which agents share a graph, and which graph gives the published prediction of each agent.

Policies (docs/design.md, decision 14): ``ego`` one graph around a given agent, the paper's choice
(section "Graph-based Traffic Modeling"); ``cover`` a few graphs that together contain every agent;
``each`` one graph around every agent; ``scene`` one graph of all. A graph is its centre and the
``max_neighbours`` agents nearest to it within ``radius_m``; only ``scene`` has no limit (its
caller limits the number of agents served). Agents outside the ego's graph are covered as by
``cover``, so every agent is predicted exactly once under every policy.

Where not all agents are served, only those served are centres and predicted. The others fill the
graphs as neighbours, except under ``scene``, whose only graph would grow without limit.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from mtpgo_core.history.track_index import SortKeyArray, find_sort_keys, sort_keys
from mtpgo_core.scene.graph_cover import KEEP, cover_centres, neighbourhoods
from mtpgo_core.schema import BoolArray, Float64Array, HistoryWindow, IndexArray, KeyArray
from mtpgo_core.task.task_description import SceneConfig

_STAY = 0.5
"""An agent leaves its graph when another centre is nearer than this share of the distance to its
own; chosen against flicker."""
_FORESIGHT_S = 1.0
"""The relative motion of this time counts as distance to a centre (s), so that agents belong to
the traffic they move with, not to oncoming traffic; chosen."""


def _no_keys() -> SortKeyArray:
    return np.empty(0, dtype="S16")


@dataclass
class GraphState:
    """The graphs of the previous cycle, by sort keys, kept so that predictions do not flicker.

    :func:`choose_graphs` reads and updates it.

    Attributes:
        centre: [B] centres.
        agent: [n] agents that were predicted, ascending.
        owner: [n] the centre of each agent's graph.
    """

    centre: SortKeyArray = field(default_factory=_no_keys)
    agent: SortKeyArray = field(default_factory=_no_keys)
    owner: SortKeyArray = field(default_factory=_no_keys)


@dataclass(frozen=True)
class Graphs:
    """The graphs of one instant.

    Attributes:
        members: [B, N] positions in the window, the centre first, then by ascending distance,
            -1 for padding.
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
    served: BoolArray | None = None,
) -> Graphs:
    """Return the graphs of the agents of a window.

    Args:
        window: the history, all of whose agents are present at its time.
        config: policy and limits.
        ego_key: [4] identity of the ego for ``ego`` (and the centre of ``scene``); where it is
            missing or absent, ``ego`` acts as ``cover``.
        state: the state of the previous cycle, updated here.
        served: [n] the agents that are predicted, all by default; an ego that is not served
            counts as absent.
    """
    if config.policy == "scene" and served is not None and not served.all():
        some = np.flatnonzero(served)
        graphs = choose_graphs(window.select(some), config, ego_key=ego_key, state=state)
        return Graphs(np.where(graphs.members >= 0, some[graphs.members], -1), graphs.primary)
    n = len(window)
    served = np.ones(n, dtype=bool) if served is None else served
    if not served.any():
        return Graphs(np.zeros((0, 1), dtype=np.intp), np.zeros((0, 1), dtype=bool))
    state = GraphState() if state is None else state
    position = window.position[:, -1]
    keys = sort_keys(window.key)
    order = np.argsort(keys, kind="stable")
    ego = -1
    if ego_key is not None:
        ego = int(_positions(keys, order, sort_keys(ego_key.reshape(1, 4)))[0])
        ego = ego if served[ego] else -1
    kept = _positions(keys, order, state.centre)
    kept = np.where(served[kept], kept, -1)

    if config.policy == "each":
        centre = np.flatnonzero(served)
    elif config.policy == "scene":
        centre = _scene_centre(position, ego, kept)
    else:
        first = ego if config.policy == "ego" else -1
        kept = kept[(kept >= 0) & (kept != first)]
        centre = cover_centres(position, config, first, kept, served)
    whole = config.policy == "scene"
    members, distance = neighbourhoods(
        position,
        centre,
        n if whole else config.max_neighbours,
        np.inf if whole else config.radius_m,
    )

    if config.policy == "each":
        owner = np.cumsum(served) - 1
    else:
        before = find_sort_keys(state.agent, keys)
        owned = np.where(before >= 0, before, 0)
        previous = np.full(keys.shape[0], -1, dtype=np.intp)
        if state.owner.shape[0]:
            by_centre = np.argsort(keys[centre], kind="stable")
            previous = _positions(keys[centre], by_centre, state.owner[owned])
            previous[before < 0] = -1
        velocity = np.nan_to_num(window.velocity[:, -1])
        parting = np.linalg.norm(velocity[members] - velocity[centre][:, None], axis=2)
        distance = distance + _FORESIGHT_S * parting
        owner = _owners(members, distance, previous, ego_first=config.policy == "ego" and ego >= 0)
    state.centre = keys[centre]
    mine = order[served[order]]
    state.agent, state.owner = keys[mine], keys[centre[owner[mine]]]
    primary = (members >= 0) & (owner[members] == np.arange(centre.shape[0])[:, None])
    return Graphs(members, primary & served[members])


def graphs_around(window: HistoryWindow, config: SceneConfig, centres: IndexArray) -> Graphs:
    """Return one graph around each given agent, as for training: all members are primary.

    Args:
        window: the history, all of whose agents are present at its time.
        config: limits; of the policy it only matters whether it is ``scene``, which has none.
        centres: [B] positions in the window.
    """
    whole = config.policy == "scene"
    members, _ = neighbourhoods(
        window.position[:, -1],
        centres,
        len(window) if whole else config.max_neighbours,
        np.inf if whole else config.radius_m,
    )
    return Graphs(members, members >= 0)


def _positions(keys: SortKeyArray, order: IndexArray, wanted: SortKeyArray) -> IndexArray:
    """Return the positions of ``wanted`` in ``keys``, which ``order`` sorts, -1 where absent."""
    place = find_sort_keys(keys[order], wanted)
    return np.where(place >= 0, order[place], -1)


def _scene_centre(position: Float64Array, ego: int, kept: IndexArray) -> IndexArray:
    """Return the ego, else the agent nearest to the middle, with hysteresis."""
    if ego >= 0:
        return np.array([ego])
    off_m = np.linalg.norm(position - position.mean(axis=0), axis=1)
    best = int(np.argmin(off_m))
    # 5 m, a vehicle's length, so that two agents of a small scene do not alternate.
    if kept.shape[0] and kept[0] >= 0 and KEEP * off_m[kept[0]] <= off_m[best] + 5.0:
        best = int(kept[0])
    return np.array([best])


def _owners(
    members: IndexArray, distance: Float64Array, previous: IndexArray, *, ego_first: bool
) -> IndexArray:
    """Return [n] the graph that predicts each agent: the nearest centre, with hysteresis.

    Args:
        members: [B, K] agents of each graph.
        distance: [B, K] their distances (m).
        previous: [n] the graph whose centre predicted the agent in the previous cycle, -1 for
            none.
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
