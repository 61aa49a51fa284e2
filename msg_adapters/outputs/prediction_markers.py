# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Predictions as a MarkerArray for RViz and Foxglove.

There is a box per agent, and per agent and mode one LINE_STRIP (the trajectory) and one LINE_LIST
(the ellipses). Colours show the class, opacity the weight of the mode. Ellipses of one mode share
a marker because the cost of a display is per marker, not per point.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from msg_adapters.outputs.ellipses import ellipse_sides, ellipse_steps
from msg_adapters.outputs.marker_encoding import (
    CUBE,
    DELETE,
    DELETE_ALL,
    LINE_LIST,
    LINE_STRIP,
    TEXT,
    Drawn,
    markers_to_cdr,
    markers_to_message,
)
from msg_adapters.outputs.marker_tracker import MODES_PER_AGENT, MarkerTracker
from msg_adapters.types import Types
from mtpgo_core.class_size import known_sizes
from mtpgo_core.prediction.output_assembly import heaviest_modes
from mtpgo_core.schema import AgentClass, Float64Array, Prediction, Source

BOXES, TRAJECTORIES, ELLIPSES, LABELS = "agents", "trajectories", "ellipses", "labels"
"""Namespaces of the markers; a display can switch each on and off."""


_COLOURS: dict[int, tuple[float, float, float]] = {
    AgentClass.CAR: (0.12, 0.47, 0.95),
    AgentClass.VAN: (0.12, 0.47, 0.95),
    AgentClass.TRUCK: (0.55, 0.30, 0.85),
    AgentClass.BUS: (0.55, 0.30, 0.85),
    AgentClass.TRAILER: (0.55, 0.30, 0.85),
    AgentClass.MOTORCYCLE: (0.95, 0.60, 0.10),
    AgentClass.BICYCLE: (0.10, 0.70, 0.35),
    AgentClass.PEDESTRIAN: (0.90, 0.20, 0.25),
}
_OTHER_COLOUR = (0.45, 0.75, 0.75)
_FALLBACK_COLOUR = (0.6, 0.6, 0.6)


@dataclass(frozen=True)
class MarkerStyle:
    """Settings of the drawing.

    Attributes:
        min_weight: modes lighter than this are not drawn, except an agent's heaviest.
        ellipse_min_weight: modes lighter than this are drawn without ellipses.
        ellipse_every_s: time between two ellipses of a mode (s).
        ellipse_sigma: Mahalanobis radius of the ellipses.
        ellipse_segments: corners of an ellipse.
        line_width_m: width of trajectories; ellipses are half as wide (m).
        box_height_m: height of the agents' boxes (m).
        labels: write class and lowest word of the identity over each agent.
        lifetime_s: time after which a display drops markers that are not renewed (s).
    """

    min_weight: float = 0.02
    ellipse_min_weight: float = 0.1
    ellipse_every_s: float = 1.0
    ellipse_sigma: float = 2.0
    ellipse_segments: int = 16
    line_width_m: float = 0.2
    box_height_m: float = 1.5
    labels: bool = False
    lifetime_s: float = 1.0


def prediction_to_markers(
    prediction: Prediction,
    types: Types,
    tracker: MarkerTracker,
    *,
    max_modes: int | None = None,
    style: MarkerStyle | None = None,
) -> Any:
    """Return the prediction as a MarkerArray; deletions of stale markers come first.

    Args:
        prediction: what to draw; stamp and frame go into every header.
        types: source of message classes.
        tracker: the ids in use; one per topic.
        max_modes: the heaviest modes to draw, renormalised; None draws all.
        style: settings, default :class:`MarkerStyle`.
    """
    style = style or MarkerStyle()
    return markers_to_message(
        draw(prediction, tracker, max_modes=max_modes, style=style),
        types,
        stamp_ns=prediction.stamp_ns,
        frame_id=prediction.frame_id,
        lifetime_s=style.lifetime_s,
    )


def prediction_to_marker_bytes(
    prediction: Prediction,
    tracker: MarkerTracker,
    *,
    max_modes: int | None = None,
    style: MarkerStyle | None = None,
) -> bytes:
    """Return the bytes of :func:`prediction_to_markers`, many times faster."""
    style = style or MarkerStyle()
    return markers_to_cdr(
        draw(prediction, tracker, max_modes=max_modes, style=style),
        stamp_ns=prediction.stamp_ns,
        frame_id=prediction.frame_id,
        lifetime_s=style.lifetime_s,
    )


def clear_markers(types: Types, *, stamp_ns: int, frame_id: str) -> Any:
    """Return a MarkerArray that deletes all markers of the topic."""
    everything = [Drawn("", 0, action=DELETE_ALL)]
    return markers_to_message(
        everything, types, stamp_ns=stamp_ns, frame_id=frame_id, lifetime_s=0.0
    )


def draw(
    prediction: Prediction, tracker: MarkerTracker, *, max_modes: int | None, style: MarkerStyle
) -> list[Drawn]:
    """Return deletions of stale markers, then the markers to draw; arguments as above."""
    painter = _Painter(prediction, style, max_modes)
    slots = tracker.slots(prediction.key)
    drawn = [marker for agent, slot in enumerate(slots) for marker in painter.agent(agent, slot)]
    stale = tracker.stale({(marker.ns, marker.number) for marker in drawn})
    return [Drawn(ns, number, action=DELETE) for ns, number in stale] + drawn


class _Painter:
    """The geometry of a prediction, computed for all agents together."""

    def __init__(self, prediction: Prediction, style: MarkerStyle, max_modes: int | None) -> None:
        self.style = style
        self.weight, modes = heaviest_modes(prediction, max_modes)
        self.classes = prediction.agent_class.tolist()
        self.low_words = prediction.key[:, 0].tolist()
        self.initial = prediction.initial[:, :2].tolist()
        self.known = [math.isfinite(x) and math.isfinite(y) for x, y in self.initial]
        self.yaw = np.nan_to_num(prediction.initial_yaw).tolist()
        self.size = known_sizes(prediction.size, prediction.agent_class).tolist()
        z = np.where(np.isfinite(prediction.z), prediction.z, 0.0)
        self.z = z.tolist()
        present = np.broadcast_to(
            prediction.initial[:, None, None, :2], (len(prediction), modes, 1, 2)
        )
        self.lines = _with_z(
            np.concatenate([present, prediction.mean[:, :modes, :, :2]], axis=2), z
        )
        chosen = ellipse_steps(prediction.time_s, style.ellipse_every_s)
        rings = ellipse_sides(
            prediction.mean[:, :modes, chosen, :2],
            prediction.covariance[:, :modes, chosen],
            sigma=style.ellipse_sigma,
            corners=style.ellipse_segments,
        )
        self.rings = _with_z(rings, z)
        self.opacity = _opacity(self.weight)
        heaviest = self.weight.max(axis=1, keepdims=True, initial=0.0)
        heavy = self.weight >= np.minimum(style.min_weight, heaviest)
        drawable = heavy & np.isfinite(self.lines[:, :, 1:]).all(axis=(2, 3))
        self.drawable = [np.flatnonzero(row).tolist() for row in drawable]
        ringed = np.isfinite(self.rings).all(axis=(2, 3)) & (self.rings.shape[2] > 0)
        self.ringed = (ringed & (self.weight >= style.ellipse_min_weight)).tolist()
        self.served = (prediction.source == Source.MODEL).tolist()

    def agent(self, agent: int, slot: int) -> Iterator[Drawn]:
        """Return the markers of one agent."""
        first_id = slot * MODES_PER_AGENT
        if self.known[agent]:
            yield self._box(agent, first_id)
            if self.style.labels:
                yield self._label(agent, first_id)
        for mode in self.drawable[agent]:
            line = self.lines[agent, mode]
            opacity = float(self.opacity[agent, mode])
            yield Drawn(
                TRAJECTORIES,
                first_id + mode,
                LINE_STRIP,
                scale=(self.style.line_width_m, 0.0, 0.0),
                colour=self._colour(agent, opacity),
                points=line if self.known[agent] else line[1:],
            )
            if self.ringed[agent][mode]:
                yield Drawn(
                    ELLIPSES,
                    first_id + mode,
                    LINE_LIST,
                    scale=(self.style.line_width_m / 2.0, 0.0, 0.0),
                    colour=self._colour(agent, 0.6 * opacity),
                    points=self.rings[agent, mode],
                )

    def _box(self, agent: int, number: int) -> Drawn:
        x, y = self.initial[agent]
        length, width = self.size[agent]
        return Drawn(
            BOXES,
            number,
            CUBE,
            position=(x, y, self.z[agent]),
            yaw=self.yaw[agent],
            scale=(length, width, self.style.box_height_m),
            colour=self._colour(agent, 0.7),
        )

    def _label(self, agent: int, number: int) -> Drawn:
        x, y = self.initial[agent]
        name = AgentClass.from_code(self.classes[agent]).name.lower()
        return Drawn(
            LABELS,
            number,
            TEXT,
            position=(x, y, self.z[agent] + self.style.box_height_m),
            scale=(0.0, 0.0, 1.0),
            colour=self._colour(agent, 1.0),
            text=f"{name} {self.low_words[agent]}",
        )

    def _colour(self, agent: int, opacity: float) -> tuple[float, float, float, float]:
        if not self.served[agent]:
            return (*_FALLBACK_COLOUR, opacity)
        return (*_COLOURS.get(self.classes[agent], _OTHER_COLOUR), opacity)


def _with_z(points: Float64Array, z: Float64Array) -> Float64Array:
    """Return [n, M, k, 3] the points [n, M, k, 2] at the agents' [n] heights (m)."""
    height = np.broadcast_to(z[:, None, None, None], (*points.shape[:-1], 1))
    return np.concatenate([points, height], axis=-1)


def _opacity(weight: Float64Array) -> Float64Array:
    """Return [n, M] the opacity in 0.1..1: the weight relative to the agent's heaviest mode."""
    return np.clip(weight / weight.max(axis=1, keepdims=True, initial=1e-12), 0.1, 1.0)
