# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A few graphs that together contain every agent, kept from cycle to cycle.

The policy ``cover`` of docs/design.md, decision 14.
"""

from __future__ import annotations

import numpy as np

from mtpgo_core.schema import BoolArray, Float64Array, IndexArray
from mtpgo_core.task.task_description import SceneConfig

KEEP = 0.8
"""A centre is dropped when the others contain all its agents within this share of the limits;
chosen so that a centre at the limit is not dropped and chosen again in turns."""
_CANDIDATES = 16
"""Agents tried as a new centre; more hardly reduce the number of graphs (measured)."""


def neighbourhoods(
    position: Float64Array, centre: IndexArray, max_neighbours: int, radius_m: float
) -> tuple[IndexArray, Float64Array]:
    """Return the agents around each centre: the centre first, then by ascending distance.

    Args:
        position: [n, 2] (m).
        centre: [B] positions of the centres among the agents.
        max_neighbours: most agents besides the centre.
        radius_m: largest distance of a neighbour (m).

    Returns:
        [B, K] positions among the agents, -1 for padding, and [B, K] distances (m), inf there;
        K is at most ``max_neighbours + 1``.
    """
    n = position.shape[0]
    most = min(n, max_neighbours + 1)
    members = np.full((centre.shape[0], most), -1, dtype=np.intp)
    distance = np.full((centre.shape[0], most), np.inf)
    rows_at_once = max(1, 1_000_000 // max(n, 1))
    for begin in range(0, centre.shape[0], rows_at_once):
        some = centre[begin : begin + rows_at_once]
        rows = np.arange(some.shape[0])[:, None]
        offset = position[some][:, None, :] - position[None, :, :]
        squared = np.einsum("bnk,bnk->bn", offset, offset)
        # The centre comes first, even before an agent at the same position.
        squared[rows[:, 0], some] = -1.0
        if most < n:
            nearest = np.argpartition(squared, most - 1, axis=1)[:, :most]
            nearest.sort(axis=1)  # equal distances: the order of the agents decides
        else:
            nearest = np.broadcast_to(np.arange(n), (some.shape[0], n))
        by_distance = np.argsort(squared[rows, nearest], axis=1, kind="stable")
        nearest = nearest[rows, by_distance]
        reach = np.maximum(squared[rows, nearest], 0.0)
        within = (reach <= radius_m**2) | (np.arange(most) == 0)
        members[begin : begin + rows_at_once] = np.where(within, nearest, -1)
        distance[begin : begin + rows_at_once] = np.where(within, np.sqrt(reach), np.inf)
    longest = max(1, int((members >= 0).sum(axis=1).max(initial=0)))
    return members[:, :longest], distance[:, :longest]


def _reached(members: IndexArray, n: int) -> BoolArray:
    """Return [B, n] whether each graph contains each agent."""
    reached = np.zeros((members.shape[0], n + 1), dtype=bool)
    reached[np.arange(members.shape[0])[:, None], members] = True  # padding: the last column
    return reached[:, :n]


def cover_centres(
    position: Float64Array,
    config: SceneConfig,
    ego: int,
    kept: IndexArray,
    served: BoolArray | None = None,
) -> IndexArray:
    """Return the centres: the ego first, then previous ones still needed, then new ones.

    Args:
        position: [n, 2] (m).
        config: limits of a graph.
        ego: position of the ego among the agents, -1 for none.
        kept: previous centres.
        served: [n] the agents that the graphs together contain, and among which all centres are;
            all by default.
    """
    n = position.shape[0]
    served = np.ones(n, dtype=bool) if served is None else served
    fixed = np.array([ego] if ego >= 0 else [], dtype=np.intp)
    centre = np.concatenate([fixed, kept])
    limits = config.max_neighbours, config.radius_m
    members, distance = neighbourhoods(position, centre, *limits)
    reached = _reached(members, n)
    if kept.shape[0]:
        rank = np.arange(members.shape[1]) <= KEEP * config.max_neighbours
        inside = rank & (distance <= KEEP * config.radius_m)
        well_inside = _reached(np.where(inside, members, -1), n)
        use = _useful(reached & served, well_inside & served, fixed.shape[0])
        centre, reached = centre[use], reached[use]
    covered = np.asarray(reached.any(axis=0))
    covered |= ~served
    new = []
    while not covered.all():
        candidate, members = _new_centre(position, limits, covered, served)
        new.append(candidate)
        covered[members] = True
    return np.concatenate([centre, np.array(new, dtype=np.intp)])


def _useful(reached: BoolArray, well_inside: BoolArray, fixed: int) -> BoolArray:
    """Return [B] which centres to keep: all but those whose agents are well inside other graphs.

    Args:
        reached: [B, n] agents of each graph.
        well_inside: [B, n] of these, the ones within :data:`KEEP` of the limits.
        fixed: number of centres at the start that are always kept.
    """
    use = np.ones(reached.shape[0], dtype=bool)
    graphs_of = well_inside.sum(axis=0)  # [n] graphs that have the agent well inside
    for row in np.argsort(reached.sum(axis=1), kind="stable"):
        if row >= fixed and (graphs_of - well_inside[row])[reached[row]].all():
            use[row] = False
            graphs_of = graphs_of - well_inside[row]
    return use


def _new_centre(
    position: Float64Array, limits: tuple[int, float], covered: BoolArray, served: BoolArray
) -> tuple[int, IndexArray]:
    """Return the next centre and the agents of its graph.

    Of the served agents whose graphs would contain the outermost uncovered agent, the one whose
    graph covers the most uncovered agents (greedy set cover).
    """
    uncovered = np.flatnonzero(~covered)
    middle = position[uncovered].mean(axis=0)
    outermost = uncovered[np.argmax(((position[uncovered] - middle) ** 2).sum(axis=1))]
    around = neighbourhoods(position, np.array([outermost]), *limits)[0][0]
    around = around[(around >= 0) & served[around]]
    pick = np.unique(np.linspace(0, around.shape[0] - 1, _CANDIDATES).round().astype(np.intp))
    members = neighbourhoods(position, around[pick], *limits)[0]
    gain = ((members >= 0) & ~covered[members]).sum(axis=1)
    gain[~(members == outermost).any(axis=1)] = 0
    best = int(np.argmax(gain))
    return int(around[pick[best]]), members[best][members[best] >= 0]
