# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The ways on from an agent's place: the trails that pass it, followed from there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mtpgo_core.frames import rotate, wrap
from mtpgo_core.scene.trails.class_groups import join, spacing_m
from mtpgo_core.scene.trails.trail_memory import TrailMemory, owner_hash
from mtpgo_core.scene.trails.trail_points import IntArray
from mtpgo_core.schema import BoolArray, ClassArray, Float64Array, KeyArray

ACROSS_M = 1.2
"""A trail farther to the side passes by (m); chosen: a third of a lane."""
HEADING_RAD = 0.35
"""A trail in a direction that differs more is another way (rad); chosen: 20 degrees."""
CANDIDATES = 16
"""Trails that are followed per agent, the most recent; chosen, bounds the time."""
MAX_POINTS = 96
"""Most points of a trail that are followed: 192 m of a vehicle, 48 m of a pedestrian."""
MAX_AGE_S = 1800.0
"""Trails that passed earlier are not used (s); chosen: their weight is less than 0.3 %."""
FADE_S = 300.0
"""Time over which the weight of a trail falls to 1/e (s); chosen: lights and jams change in
minutes, roads do not."""
MERGE_M = 10.0
"""Distance over which a path moves from the agent's place onto the trail (m); chosen, measured."""
_ACROSS_M, _HEADING_RAD = 0.6, 0.15
"""Differences in place (m) and direction (rad) at which the weight of a trail falls to 0.6 (a
normal distribution): the nearer ones tell more; chosen, measured."""


@dataclass(frozen=True)
class Places:
    """Where n agents are and go at one instant.

    Attributes:
        key: [n, 4] identities; an agent's own trails are not used.
        group: [n] class groups.
        position: [n, 2] in the fixed frame (m).
        heading: [n] (rad); no trail passes an agent whose heading is NaN.
    """

    key: KeyArray
    group: ClassArray
    position: Float64Array
    heading: Float64Array


@dataclass(frozen=True)
class TrailPaths:
    """Paths of up to C earlier road users from the places of n agents on, the latest first.

    Attributes:
        path: [n, C, H, 2] in the agent's frame at the distances asked for (m).
        known: [n, C, H] whether the trail is known so far.
        weight: [n, C] by age and likeness, 0 where there is no trail.
    """

    path: Float64Array
    known: BoolArray
    weight: Float64Array


def trail_paths(
    memory: TrailMemory,
    places: Places,
    time_ns: int,
    distance: Float64Array,
    since_ns: int | None = None,
) -> TrailPaths:
    """Return the paths of earlier road users from the agents' places on.

    Args:
        memory: the trails.
        places: the agents.
        time_ns: only what was known then is used (ns).
        distance: [n, H] ascending distances ahead (m).
        since_ns: only what became known then or later is used (ns), None for all.
    """
    n, horizon = distance.shape
    paths = np.zeros((n, CANDIDATES, horizon, 2))
    known = np.zeros((n, CANDIDATES, horizon), dtype=bool)
    weight = np.zeros((n, CANDIDATES))
    oldest_ns = max(time_ns - round(MAX_AGE_S * 1e9), since_ns or 0)
    first, end = memory.points.since(oldest_ns), memory.points.known_at(time_ns)
    if n and first < end:
        found = _candidates(memory, places, first, end)
        row, place = found.row, found.place
        age_s = 1e-9 * (time_ns - memory.points.column("time_ns", found.number))
        weight[row, place] = np.exp(
            -age_s / FADE_S
            - 0.5 * (found.across / _ACROSS_M) ** 2
            - 0.5 * (found.turn / _HEADING_RAD) ** 2
        )
        ahead, there = _follow(memory, found, end, distance[row])
        path = rotate(ahead, -places.heading[row][:, None])
        path[..., :2] += _merged(found, places, distance[row])
        paths[row, place] = np.where(there[..., None], path, 0.0)
        known[row, place] = there
    return TrailPaths(paths, known, weight)


@dataclass(frozen=True)
class _Candidates:
    """Trails that pass the agents.

    Attributes:
        row: [a] the agent. place: [a] 0 for its latest trail, and so on.
        number: [a] the trail's point next to the agent, behind it.
        along: [a] from there to the agent along the trail (m).
        across: [a] from the trail to the agent, to the left of the trail (m).
        turn: [a] direction of the trail minus the agent's (rad).
        spacing: [a] distance of the trail's points (m).
    """

    row: IntArray
    place: IntArray
    number: IntArray
    along: Float64Array
    across: Float64Array
    turn: Float64Array
    spacing: Float64Array


def _candidates(memory: TrailMemory, places: Places, first: int, end: int) -> _Candidates:
    """Return the trails that pass the agents, of points ``first`` to ``end``."""
    points = memory.points
    some = np.flatnonzero(np.isfinite(places.heading) & np.isfinite(places.position).all(axis=1))
    heading = places.heading[some]
    position = places.position[some] - memory.origin
    back = 0.5 * spacing_m(places.group[some])[:, None]
    centre = position - back * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    row, number = memory.index.find(centre, heading, HEADING_RAD, first, end)
    toward = points.column("heading", number).astype(np.float64)
    group = points.column("group", number)
    spacing = spacing_m(group)
    offset = position[row] - points.column("offset", number)
    offset = rotate(offset, -toward)
    along, across = offset[:, 0], offset[:, 1]
    turn = wrap(toward - heading[row])
    passes = (np.abs(across) < ACROSS_M) & (np.abs(turn) < HEADING_RAD)
    passes &= (along > -0.25 * spacing) & (along < 1.25 * spacing)
    passes &= join(group, places.group[some][row])
    passes &= points.column("owner", number) != owner_hash(places.key[some])[row]
    kept = np.flatnonzero(passes)
    kept = _latest_of_each(row[kept], points.column("trail", number[kept]), number[kept], kept)
    kept = kept[np.lexsort((-number[kept], row[kept]))]
    begin = np.searchsorted(row[kept], row[kept])
    place = np.arange(len(kept)) - begin
    kept, place = kept[place < CANDIDATES], place[place < CANDIDATES]
    return _Candidates(
        row=some[row[kept]],
        place=place,
        number=number[kept],
        along=along[kept],
        across=across[kept],
        turn=turn[kept],
        spacing=spacing[kept],
    )


def _latest_of_each(row: IntArray, trail: IntArray, number: IntArray, of: IntArray) -> IntArray:
    """Return those ``of`` [k] with the highest number of the same row and trail."""
    order = np.lexsort((number, trail, row))
    row, trail = row[order], trail[order]
    last = np.append((row[1:] != row[:-1]) | (trail[1:] != trail[:-1]), True)[: len(order)]
    return of[order[last]]


def _follow(
    memory: TrailMemory, found: _Candidates, end: int, distance: Float64Array
) -> tuple[Float64Array, BoolArray]:
    """Return [a, H, 2] ways from the agents' places along the trails and whether they are known.

    Args:
        memory: the trails.
        found: the trails that pass the agents.
        end: points from this number on are not known yet.
        distance: [a, H] along the trail (m).
    """
    points = memory.points
    way = (found.along[:, None] + distance) / found.spacing[:, None]  # in points
    wanted = int(min(MAX_POINTS, np.ceil(way.max(initial=0.0)) + 1))
    chain = np.empty((len(found.number), wanted + 1), dtype=np.int64)
    chain[:, 0] = found.number
    length = np.zeros(len(found.number), dtype=np.int64)
    going = np.arange(len(found.number))
    for step in range(wanted):
        here = chain[going, step]
        chain[:, step + 1] = chain[:, step]
        following = points.column("following", here)
        on = (following > 0) & (here + following < end) & (step <= way[going, -1])
        going, there = going[on], (here + following)[on]
        if not going.shape[0]:
            chain[:, step + 1 :] = chain[:, step, None]
            break
        chain[going, step + 1] = there
        length[going] = step + 1
    index = np.clip(np.floor(way).astype(np.int64), 0, wanted - 1)
    rows = np.arange(len(found.number))[:, None]
    left = points.column("offset", chain[rows, index]).astype(np.float64)
    right = points.column("offset", chain[rows, index + 1]).astype(np.float64)
    at = left + (way - index)[..., None] * (right - left)
    first = points.column("offset", chain[:, 0]).astype(np.float64)
    second = points.column("offset", chain[:, 1]).astype(np.float64)
    start = first + (found.along / found.spacing)[:, None] * (second - first)
    return at - start[:, None], way <= length[:, None]


def _merged(found: _Candidates, places: Places, distance: Float64Array) -> Float64Array:
    """Return [a, H, 2] how far paths have moved from the agents' places onto the trails (m)."""
    side = np.stack([np.zeros_like(found.across), -found.across], axis=-1)
    side = rotate(side, found.turn)
    share = np.clip(distance / MERGE_M, 0.0, 1.0)
    return side[:, None] * (share * share * (3.0 - 2.0 * share))[..., None]
