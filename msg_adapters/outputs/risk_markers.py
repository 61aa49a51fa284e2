# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Markers coloured by risk: road users' ways, their boxes at the worst moment, the ego's plan."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from msg_adapters.outputs.marker_encoding import CUBE, DELETE, LINE_STRIP, TEXT, Drawn
from msg_adapters.outputs.marker_tracker import MODES_PER_AGENT, MarkerTracker
from mtpgo_core.risk.collision_risk import CollisionRisk
from mtpgo_core.risk.ego_plan import EgoFootprint, EgoPlan
from mtpgo_core.schema import Float64Array

WAYS, BOXES, LABELS, PLAN = "risk_ways", "risk_boxes", "risk_labels", "risk_plan"
"""Namespaces of the markers."""

LIFETIME_S = 1.0
"""Time after which displays drop markers that are not renewed (s)."""

_COLOURS = (
    (0.0, (0.20, 0.70, 0.30)),
    (0.01, (0.55, 0.75, 0.20)),
    (0.05, (0.95, 0.75, 0.10)),
    (0.2, (0.95, 0.45, 0.10)),
    (0.5, (0.90, 0.10, 0.15)),
)
"""Colours from a probability on; between them it is interpolated. Chosen: green is negligible,
yellow 5 %, red 50 % and more."""

UNKNOWN_COLOUR = (0.65, 0.25, 0.90)
"""Of a risk that is not known: none of the colours above."""

_PLAN_COLOUR = (0.95, 0.95, 0.95)
_LABEL_FROM = 0.01
"""Risks from here on are written beside the box (chosen)."""

_LINE_M, _HEIGHT_M, _LETTER_M = 0.25, 1.5, 1.2
_EGO = 0


def risk_colour(probability: float) -> tuple[float, float, float]:
    """Return red, green and blue (0..1) of a probability; NaN has a colour of its own."""
    if not math.isfinite(probability):
        return UNKNOWN_COLOUR
    levels = [level for level, _ in _COLOURS]
    r, g, b = (np.interp(probability, levels, [c[i] for _, c in _COLOURS]) for i in range(3))
    return float(r), float(g), float(b)


def draw_risk(
    risk: CollisionRisk,
    tracker: MarkerTracker,
    plan: EgoPlan | None = None,
    footprint: EgoFootprint | None = None,
) -> list[Drawn]:
    """Return deletions of stale markers, then the markers to draw.

    Args:
        risk: what to draw.
        tracker: the ids in use; one per topic.
        plan: the ego's way, if there is one; it needs its footprint.
        footprint: of the ego.
    """
    drawn = [
        marker
        for agent, slot in enumerate(tracker.slots(risk.key))
        for marker in _agent(risk, agent, slot * MODES_PER_AGENT)
    ]
    if plan is not None and footprint is not None:
        drawn += _plan(risk, plan, footprint)
    stale = tracker.stale({(marker.ns, marker.number) for marker in drawn})
    return [Drawn(ns, number, action=DELETE) for ns, number in stale] + drawn


def _agent(risk: CollisionRisk, agent: int, number: int) -> Iterator[Drawn]:
    way, peak = risk.position[agent], float(risk.peak[agent])
    way = way[np.isfinite(way).all(axis=1)]
    if not len(way):
        return
    z = float(np.nan_to_num(risk.z[agent]))
    colour = (*risk_colour(peak), 0.9)
    yield Drawn(
        WAYS, number, LINE_STRIP, scale=(_LINE_M, 0.0, 0.0), colour=colour, points=_raised(way, z)
    )
    step = int(risk.peak_step[agent])
    x, y = risk.position[agent, step]
    if not math.isfinite(x) or not math.isfinite(y):
        return
    length, width = risk.size[agent]
    yield Drawn(
        BOXES,
        number,
        CUBE,
        position=(float(x), float(y), z),
        yaw=float(risk.yaw[agent, step]),
        scale=(float(length), float(width), _HEIGHT_M),
        colour=(*risk_colour(peak), 0.6),
    )
    if peak >= _LABEL_FROM or not math.isfinite(peak):
        known = f"{peak:.0%} in {risk.peak_time_s[agent]:.1f} s"
        yield Drawn(
            LABELS,
            number,
            TEXT,
            position=(float(x), float(y), z + 2.0 * _HEIGHT_M),
            scale=(0.0, 0.0, _LETTER_M),
            colour=(*risk_colour(peak), 1.0),
            text=known if math.isfinite(peak) else "risk unknown",
        )


def _plan(risk: CollisionRisk, plan: EgoPlan, footprint: EgoFootprint) -> Iterator[Drawn]:
    time_s = np.concatenate([[0.0], risk.time_s])
    position, yaw = plan.at(risk.stamp_ns, time_s)
    center = footprint.center(position, yaw)
    known = np.isfinite(center).all(axis=1)
    if not known.any():
        return
    yield Drawn(
        PLAN,
        _EGO,
        LINE_STRIP,
        scale=(_LINE_M, 0.0, 0.0),
        colour=(*_PLAN_COLOUR, 0.9),
        points=_raised(center[known], 0.0),
    )
    first = int(np.flatnonzero(known)[0])
    length, width = footprint.size
    yield Drawn(
        PLAN,
        _EGO + 1,
        CUBE,
        position=(float(center[first, 0]), float(center[first, 1]), 0.0),
        yaw=float(yaw[first]),
        scale=(float(length), float(width), _HEIGHT_M),
        colour=(*_PLAN_COLOUR, 0.6),
    )


def _raised(points: Float64Array, z: float) -> Float64Array:
    """Return [k, 3] points at a height (m)."""
    return np.column_stack([points, np.full(len(points), z)])
