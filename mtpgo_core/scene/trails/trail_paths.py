# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Paths ahead of an agent: the trails of earlier road users that pass it, followed from there."""

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
"""Largest lateral distance of a trail that counts as passing the agent (m); chosen: a third of a
lane."""
HEADING_RAD = 0.35
"""Largest difference of direction between such a trail and the agent (rad); chosen: 20 degrees."""
_ENDS = 0.25
"""Share of a trail's point spacing by which the segment next to the agent is extended at both
ends, so that no trail is missed in a bend; chosen."""
_REACH_M = 1.95
"""Radius of the search for the point behind the agent (m), around the place half a spacing behind
it: up to 1.5 m along and 1.2 m across."""
CANDIDATES = 16
"""Trails that are followed per agent; chosen, bounds the time."""
SETTLED_S = 5.0
"""Trails that passed at least this long ago are followed first, the most recent before others (s):
a younger trail is that of a road user right ahead and does not reach far yet; chosen: the usual
horizon."""
MAX_POINTS = 96
"""Most points of a trail that are followed: 192 m of a vehicle, 48 m of a pedestrian."""
MAX_AGE_S = 1800.0
"""Trails that passed earlier are not used (s); chosen: their weight is less than 0.3 %."""
FADE_S = 300.0
"""Time over which the weight of a trail falls to 1/e (s); chosen: lights and jams change in
minutes, roads do not."""
MERGE_M = 20.0
"""Distance over which a path moves from the agent's place onto the trail (m); chosen, measured."""
_SIGMA_ACROSS_M, _SIGMA_HEADING_RAD = 0.6, 0.1
"""Standard deviations of the Gaussian weight of a trail by its lateral distance (m) and by its
difference of direction (rad): nearer trails tell more; chosen, measured."""


@dataclass(frozen=True)
class Places:
    """Positions and headings of n agents at one instant.

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
    """Paths that up to C earlier road users took from the positions of n agents.

    Attributes:
        ahead: [H, n, C] x in the agent's frame at the distances asked for (m), 0 where unknown.
        left: [H, n, C] y in the agent's frame (m), 0 where unknown.
        reach: [n, C] horizon steps up to which the path is known.
        weight: [n, C] by age and by similarity to the agent's pose, 0 where there is no trail.
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
    """Return the paths that earlier road users took from the agents' positions.

    Args:
        memory: the trails.
        places: the agents.
        time_ns: only points known at this time are used (ns).
        distance: [n, H] ascending distances ahead (m).
        since_ns: only points that became known at this time or later are used (ns), None for all.
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
            - 0.5 * (found.across / _SIGMA_ACROSS_M) ** 2
            - 0.5 * (found.turn / _SIGMA_HEADING_RAD) ** 2
        )
        flat = row * CANDIDATES + place
        ahead[:, flat], left[:, flat], reach[row, place] = _follow(
            memory, found, places.heading[row], end, distance[row].T
        )
    shape = (horizon, n, CANDIDATES)
    return TrailPaths(ahead.reshape(shape), left.reshape(shape), reach, weight)


@dataclass(frozen=True)
class _Candidates:
    """Pairs of an agent and a trail that passes it: a pairs.

    Attributes:
        row: [a] the agent.
        place: [a] rank of the trail among those of the agent, 0 to :data:`CANDIDATES` - 1.
        number: [a] number of the trail's last point behind the agent.
        along: [a] distance along the trail from that point to the agent (m).
        across: [a] lateral distance from the trail to the agent, positive to the left (m).
        turn: [a] direction of the trail minus that of the agent (rad).
        spacing: [a] distance between the trail's points (m).
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
    """Return up to :data:`CANDIDATES` trails that pass each agent, in the order of their use.

    Args:
        memory: the trails.
        places: the agents.
        first: lowest number of a point (inclusive).
        end: highest number (exclusive).
        settled: points with lower numbers are used before the others.
    """
    points = memory.points
    agents = np.flatnonzero(np.isfinite(places.heading) & np.isfinite(places.position).all(axis=1))
    heading = places.heading[agents]
    position = places.position[agents] - memory.origin
    row, number = _points_behind(memory, position, heading, places.group[agents], first, end)

    trail_heading = points.column("heading", number).astype(np.float64)
    group = points.column("group", number)
    spacing = spacing_m(group)
    offset = rotate(position[row] - points.column("offset", number), -trail_heading)
    along, across = offset[:, 0], offset[:, 1]
    turn = wrap(trail_heading - heading[row])
    passes = (np.abs(across) < ACROSS_M) & (np.abs(turn) < HEADING_RAD)
    passes &= (along > -_ENDS * spacing) & (along < (1.0 + _ENDS) * spacing)
    passes &= join(group, places.group[agents][row])
    passes &= points.column("owner", number) != owner_hash(places.key[agents])[row]

    kept = np.flatnonzero(passes)
    kept = _latest_of_each(row[kept], points.column("trail", number[kept]), number[kept], kept)
    # By agent, the settled trails first, the most recent first: one sort of one number is faster.
    late = (number[kept] >= settled).astype(np.int64)
    kept = kept[np.argsort(((2 * row[kept] + late) * (LARGEST_NUMBER + 1)) - number[kept])]
    place = np.arange(len(kept)) - np.searchsorted(row[kept], row[kept])
    kept, place = kept[place < CANDIDATES], place[place < CANDIDATES]
    return _Candidates(
        row=agents[row[kept]],
        place=place,
        number=number[kept],
        along=along[kept],
        across=across[kept],
        turn=turn[kept],
        spacing=spacing[kept],
    )


def _points_behind(
    memory: TrailMemory,
    position: Float64Array,
    heading: Float64Array,
    group: ClassArray,
    first: int,
    end: int,
) -> tuple[IntArray, IntArray]:
    """Return pairs of an agent and a trail point closely behind it: rows and point numbers.

    Args:
        memory: the trails.
        position: [n, 2] of the agents, relative to the memory's origin (m).
        heading: [n] of the agents (rad).
        group: [n] class groups of the agents.
        first: lowest number of a point (inclusive).
        end: highest number (exclusive).
    """
    half_spacing = 0.5 * spacing_m(group)[:, None]
    behind = position - half_spacing * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    row, number = memory.index.find(behind, heading, _REACH_M, HEADING_RAD, first, end)
    apart = memory.points.column("offset", number) - behind.astype(np.float32).take(row, axis=0)
    near = np.flatnonzero((apart * apart) @ np.ones(2, np.float32) < _REACH_M**2)
    return row[near], number[near]


def _latest_of_each(row: IntArray, trail: IntArray, number: IntArray, of: IntArray) -> IntArray:
    """Return the items of ``of`` [k] with the highest point number for each row and trail."""
    row_and_trail = (row << 32) | trail
    newest_first = np.argsort(number)[::-1]
    _, latest = np.unique(row_and_trail[newest_first], return_index=True)
    return of[newest_first[latest]]


def _follow(
    memory: TrailMemory,
    found: _Candidates,
    heading: Float64Array,
    end: int,
    distance: Float64Array,
) -> tuple[Float32Array, Float32Array, IntArray]:
    """Follow the trails over given distances.

    Args:
        memory: the trails.
        found: the trails that pass the agents.
        heading: [a] of the agents (rad).
        end: points from this number on are not known yet.
        distance: [H, a] along the trail (m).

    Returns:
        x and y in the agents' frames (m), [H, a] each, 0 where unknown, and [a] the number of
        steps that are known.
    """
    spacing = found.spacing.astype(np.float32)
    begin = (found.along / found.spacing).astype(np.float32)
    progress = begin + distance.astype(np.float32) / spacing  # in units of the point spacing
    index = np.maximum(progress, 0.0).astype(np.int64)
    wanted = int(min(MAX_POINTS, index.max(initial=0) + 1))
    chain, length = _chain(memory, found.number, end, wanted)
    known = progress <= length
    np.minimum(index, wanted - 1, out=index)
    fraction = progress - index.astype(np.float32)  # between points index and index + 1

    position = memory.points.column("offset", chain)  # [wanted + 1, a, 2]
    origin = position[0] + begin[:, None] * (position[1] - position[0])
    position = position - origin
    cos, sin = np.cos(heading).astype(np.float32), np.sin(heading).astype(np.float32)
    in_agent_frame = (
        cos * position[..., 0] + sin * position[..., 1],
        cos * position[..., 1] - sin * position[..., 0],
    )
    # The path starts at the agent and blends (smoothstep) over to the trail, which is ``across``
    # to the agent's right.
    blend = np.minimum(distance.astype(np.float32) * np.float32(1.0 / MERGE_M), 1.0)
    aside = blend * blend * (3.0 - 2.0 * blend) * -found.across.astype(np.float32)
    to_left = (-np.sin(found.turn)).astype(np.float32), np.cos(found.turn).astype(np.float32)
    flat = index * len(found.number) + np.arange(len(found.number))  # of [wanted + 1, a]
    ahead, left = (
        _interpolated(values, flat, fraction) + aside * side
        for values, side in zip(in_agent_frame, to_left, strict=True)
    )
    return np.where(known, ahead, 0.0), np.where(known, left, 0.0), known.sum(axis=0)


def _interpolated(values: Float32Array, flat: IntArray, fraction: Float32Array) -> Float32Array:
    """Return [H, a] values [p, a] interpolated between flat positions [H, a] and a row later."""
    before = values.take(flat)
    return before + fraction * (values.take(flat + values.shape[1]) - before)


def _chain(
    memory: TrailMemory, number: IntArray, end: int, wanted: int
) -> tuple[IntArray, IntArray]:
    """Return the points that follow ``number`` [a] on their trails.

    Returns:
        [wanted + 1, a] numbers of the points, beginning with ``number``; the last known point of a
        trail is repeated. [a] how many points follow.
    """
    chain = np.empty((wanted + 1, len(number)), dtype=np.int64)
    chain[0] = current = number
    length = np.zeros(len(number), dtype=np.int64)
    for step in range(1, wanted + 1):
        following = current + memory.points.column("following", current)
        goes_on = (following > current) & (following < end)
        if not goes_on.any():
            chain[step:] = current
            break
        chain[step] = current = np.where(goes_on, following, current)
        length += goes_on
    return chain, length
