# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The ways on from an agent's place: the trails that pass it, followed from there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mtpgo_core.frames import rotate, wrap
from mtpgo_core.scene.trails.class_groups import join, spacing_m
from mtpgo_core.scene.trails.trail_index import LARGEST_NUMBER
from mtpgo_core.scene.trails.trail_memory import TrailMemory, owner_hash
from mtpgo_core.scene.trails.trail_points import IntArray
from mtpgo_core.schema import ClassArray, Float32Array, Float64Array, KeyArray

ACROSS_M = 1.2
"""A trail farther to the side passes by (m); chosen: a third of a lane."""
HEADING_RAD = 0.35
"""A trail in a direction that differs more is another way (rad); chosen: 20 degrees."""
_ENDS = 0.25
"""Share of its points' distance by which a trail's stretch next to the agent is longer than from
one point to the next, so that none is missed in a bend; chosen."""
_REACH_M = 1.95
"""From the middle of the places of those points, half a point's distance behind the agent, to the
farthest (m): 1.5 m along, 1.2 m across."""
CANDIDATES = 16
"""Trails that are followed per agent; chosen, bounds the time."""
SETTLED_S = 5.0
"""Trails that passed this long ago are followed first, the most recent ones before others (s):
those of road users right ahead are not known far yet; chosen: the usual horizon."""
MAX_POINTS = 96
"""Most points of a trail that are followed: 192 m of a vehicle, 48 m of a pedestrian."""
MAX_AGE_S = 1800.0
"""Trails that passed earlier are not used (s); chosen: their weight is less than 0.3 %."""
FADE_S = 300.0
"""Time over which the weight of a trail falls to 1/e (s); chosen: lights and jams change in
minutes, roads do not."""
MERGE_M = 20.0
"""Distance over which a path moves from the agent's place onto the trail (m); chosen, measured."""
_ACROSS_M, _HEADING_RAD = 0.6, 0.1
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
    """Paths of up to C earlier road users from the places of n agents on.

    Attributes:
        ahead: [H, n, C] place in the agent's frame at the distances asked for (m), 0 where not
            known, as ``left``.
        left: [H, n, C] (m).
        reach: [n, C] horizon steps up to which the path is known.
        weight: [n, C] by age and likeness, 0 where there is no trail.
    """

    ahead: Float32Array
    left: Float32Array
    reach: IntArray
    weight: Float32Array


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
    ahead, left = np.zeros((2, horizon, n * CANDIDATES), dtype=np.float32)
    reach = np.zeros((n, CANDIDATES), dtype=np.int64)
    weight = np.zeros((n, CANDIDATES), dtype=np.float32)
    oldest_ns = time_ns - round(MAX_AGE_S * 1e9)
    oldest_ns = oldest_ns if since_ns is None else max(oldest_ns, since_ns)
    first, end = memory.points.since(oldest_ns), memory.points.known_at(time_ns)
    if n and first < end:
        settled = memory.points.known_at(time_ns - round(SETTLED_S * 1e9))
        found = _candidates(memory, places, first, end, settled)
        row, place = found.row, found.place
        age_s = 1e-9 * (time_ns - memory.points.column("time_ns", found.number))
        weight[row, place] = np.exp(
            -age_s / FADE_S
            - 0.5 * (found.across / _ACROSS_M) ** 2
            - 0.5 * (found.turn / _HEADING_RAD) ** 2
        )
        flat = row * CANDIDATES + place
        ahead[:, flat], left[:, flat], reach[row, place] = _follow(
            memory, found, places.heading[row], end, distance[row].T
        )
    shape = (horizon, n, CANDIDATES)
    return TrailPaths(ahead.reshape(shape), left.reshape(shape), reach, weight)


@dataclass(frozen=True)
class _Candidates:
    """Trails that pass the agents.

    Attributes:
        row: [a] the agent.
        place: [a] 0 for the trail that is used first, and so on.
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


def _candidates(
    memory: TrailMemory, places: Places, first: int, end: int, settled: int
) -> _Candidates:
    """Return the trails that pass the agents.

    Args:
        memory: the trails.
        places: the agents.
        first: lowest number of a point (inclusive).
        end: highest number (exclusive).
        settled: points with lower numbers go before the others.
    """
    points = memory.points
    some = np.flatnonzero(np.isfinite(places.heading) & np.isfinite(places.position).all(axis=1))
    heading = places.heading[some]
    position = places.position[some] - memory.origin
    back = 0.5 * spacing_m(places.group[some])[:, None]
    centre = position - back * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    row, number = memory.index.find(centre, heading, _REACH_M, HEADING_RAD, first, end)
    apart = points.column("offset", number) - centre.astype(np.float32).take(row, axis=0)
    near = np.flatnonzero((apart * apart) @ np.ones(2, np.float32) < _REACH_M**2)
    row, number = row[near], number[near]
    toward = points.column("heading", number).astype(np.float64)
    group = points.column("group", number)
    spacing = spacing_m(group)
    offset = position[row] - points.column("offset", number)
    offset = rotate(offset, -toward)
    along, across = offset[:, 0], offset[:, 1]
    turn = wrap(toward - heading[row])
    passes = (np.abs(across) < ACROSS_M) & (np.abs(turn) < HEADING_RAD)
    passes &= (along > -_ENDS * spacing) & (along < (1.0 + _ENDS) * spacing)
    passes &= join(group, places.group[some][row])
    passes &= points.column("owner", number) != owner_hash(places.key[some])[row]
    kept = np.flatnonzero(passes)
    kept = _latest_of_each(row[kept], points.column("trail", number[kept]), number[kept], kept)
    # By agent, the settled ones first, the most recent first: one sort of one number is faster.
    late = (number[kept] >= settled).astype(np.int64)
    kept = kept[np.argsort(((2 * row[kept] + late) * (LARGEST_NUMBER + 1)) - number[kept])]
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
    of_trail = (row << 32) | trail
    newest_first = np.argsort(number)[::-1]
    _, latest = np.unique(of_trail[newest_first], return_index=True)
    return of[newest_first[latest]]


def _follow(
    memory: TrailMemory,
    found: _Candidates,
    heading: Float64Array,
    end: int,
    distance: Float64Array,
) -> tuple[Float32Array, Float32Array, IntArray]:
    """Return [H, a] ways ahead and left along the trails (m), [a] the steps that are known.

    Args:
        memory: the trails.
        found: the trails that pass the agents.
        heading: [a] the agents' (rad).
        end: points from this number on are not known yet.
        distance: [H, a] along the trail (m).
    """
    spacing = found.spacing.astype(np.float32)
    begin = (found.along / found.spacing).astype(np.float32)
    way = begin + distance.astype(np.float32) / spacing  # in points
    index = np.maximum(way, 0.0).astype(np.int64)
    wanted = int(min(MAX_POINTS, index.max(initial=0) + 1))
    chain, length = _chain(memory, found.number, end, wanted)
    known = way <= length
    np.minimum(index, wanted - 1, out=index)
    part = way - index.astype(np.float32)  # of the way between two points
    place = memory.points.column("offset", chain)  # [wanted + 1, a, 2]
    origin = place[0] + begin[:, None] * (place[1] - place[0])
    place = place - origin
    flat = index * len(found.number) + np.arange(len(found.number))
    cos, sin = (f(heading).astype(np.float32) for f in (np.cos, np.sin))
    turned = (
        cos * place[..., 0] + sin * place[..., 1],
        cos * place[..., 1] - sin * place[..., 0],
    )
    # The path starts at the agent and moves over to the trail, which is ``across`` to its right.
    share = np.minimum(distance.astype(np.float32) * np.float32(1.0 / MERGE_M), 1.0)
    aside = share * share * (3.0 - 2.0 * share) * -found.across.astype(np.float32)
    ahead, left = (
        _between(one, flat, len(found.number), part) + aside * side
        for one, side in zip(turned, _side(found.turn), strict=True)
    )
    return np.where(known, ahead, 0.0), np.where(known, left, 0.0), known.sum(axis=0)


def _side(turn: Float64Array) -> tuple[Float32Array, Float32Array]:
    """Return ahead and left [a] of the unit vector to the left of a direction (rad)."""
    return (-np.sin(turn)).astype(np.float32), np.cos(turn).astype(np.float32)


def _between(values: Float32Array, flat: IntArray, row: int, part: Float32Array) -> Float32Array:
    """Return values [p, a] between the flat places [H, a] and those a row later."""
    left = values.take(flat)
    return left + part * (values.take(flat + row) - left)


def _chain(
    memory: TrailMemory, number: IntArray, end: int, wanted: int
) -> tuple[IntArray, IntArray]:
    """Return [wanted + 1, a] the next points of the trails, [a] how many of them there are.

    After the last point of a trail that is known, it is repeated.
    """
    chain = np.empty((wanted + 1, len(number)), dtype=np.int64)
    chain[0] = here = number
    length = np.zeros(len(number), dtype=np.int64)
    for step in range(1, wanted + 1):
        there = here + memory.points.column("following", here)
        on = (there > here) & (there < end)
        if not on.any():
            chain[step:] = here
            break
        chain[step] = here = np.where(on, there, here)
        length += on
    return chain, length
