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
"""An agent changes its graph when another centre is nearer than this share of the distance to its
own centre; chosen against flicker."""
_FORESIGHT_S = 1.0
"""The relative speed times this time is added to the distance to a centre (s), so that agents join
the traffic that they move with, not oncoming traffic; chosen."""


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
    served = np.ones(len(window), dtype=bool) if served is None else served
    if not served.any():
        return Graphs(np.zeros((0, 1), dtype=np.intp), np.zeros((0, 1), dtype=bool))
    state = GraphState() if state is None else state
    keys = sort_keys(window.key)
    order = np.argsort(keys, kind="stable")
    ego = -1
    if ego_key is not None:
        ego = int(_positions(keys, order, sort_keys(ego_key.reshape(1, 4)))[0])
        ego = ego if served[ego] else -1
    kept = _positions(keys, order, state.centre)
    kept = np.where(served[kept], kept, -1)

    centre = _centres(window.position[:, -1], config, ego, kept, served)
    members, distance = _members(window, config, centre)
    if config.policy == "each":
        owner = np.cumsum(served) - 1
    else:
        velocity = np.nan_to_num(window.velocity[:, -1])
        relative_speed = np.linalg.norm(velocity[members] - velocity[centre][:, None], axis=2)
        owner = _owners(
            members,
            distance + _FORESIGHT_S * relative_speed,
            _previous_owners(state, keys, keys[centre]),
            ego_first=config.policy == "ego" and ego >= 0,
        )
    state.centre = keys[centre]
    predicted = order[served[order]]
    state.agent, state.owner = keys[predicted], keys[centre[owner[predicted]]]
    primary = (members >= 0) & (owner[members] == np.arange(centre.shape[0])[:, None])
    return Graphs(members, primary & served[members])


def graphs_around(window: HistoryWindow, config: SceneConfig, centres: IndexArray) -> Graphs:
    """Return one graph around each given agent, as for training: all members are primary.

    Args:
        window: the history, all of whose agents are present at its time.
        config: limits; of the policy it only matters whether it is ``scene``, which has none.
        centres: [B] positions in the window.
    """
    members, _ = _members(window, config, centres)
    return Graphs(members, members >= 0)


def _members(
    window: HistoryWindow, config: SceneConfig, centres: IndexArray
) -> tuple[IndexArray, Float64Array]:
    """Return :func:`neighbourhoods` of the centres [B] within the limits of the policy."""
    unlimited = config.policy == "scene"
    return neighbourhoods(
        window.position[:, -1],
        centres,
        len(window) if unlimited else config.max_neighbours,
        np.inf if unlimited else config.radius_m,
    )


def _centres(
    position: Float64Array,
    config: SceneConfig,
    ego: int,
    kept: IndexArray,
    served: BoolArray,
) -> IndexArray:
    """Return [B] the centres of the graphs by the policy.

    Args:
        position: [n, 2] (m).
        config: policy and limits.
        ego: position of the ego among the agents, -1 for none.
        kept: centres of the previous cycle, -1 for those that are gone.
        served: [n] the agents that are predicted.
    """
    if config.policy == "each":
        return np.flatnonzero(served)
    if config.policy == "scene":
        return _scene_centre(position, ego, kept)
    first = ego if config.policy == "ego" else -1
    return cover_centres(position, config, first, kept[(kept >= 0) & (kept != first)], served)


def _previous_owners(
    state: GraphState, keys: SortKeyArray, centre_keys: SortKeyArray
) -> IndexArray:
    """Return [n] the graph whose centre predicted each agent in the previous cycle, -1 for none.

    Args:
        state: the state of the previous cycle.
        keys: [n] of the agents.
        centre_keys: [B] of the present centres.
    """
    if not state.owner.shape[0]:
        return np.full(keys.shape[0], -1, dtype=np.intp)
    before = find_sort_keys(state.agent, keys)
    order = np.argsort(centre_keys, kind="stable")
    owner = _positions(centre_keys, order, state.owner[np.maximum(before, 0)])
    return np.where(before >= 0, owner, -1)


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
    distance_of = np.full((members.shape[0], n + 1), np.inf)  # [B, n + 1] inf outside the graph
    distance_of[rows[:, None], members] = distance  # padding: the last column
    distance_of = distance_of[:, :n]
    owner = np.argmin(distance_of, axis=0)
    agents = np.arange(n)
    to_previous = np.where(previous >= 0, distance_of[previous, agents], np.inf)
    stays = np.isfinite(to_previous) & (_STAY * to_previous <= distance_of[owner, agents])
    owner = np.where(stays, previous, owner)
    if ego_first:
        owner = np.where(np.isfinite(distance_of[0]), 0, owner)
    return owner
