# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Predictions as a MarkerArray for RViz and Foxglove.

Per agent a box; per agent and mode one LINE_STRIP, the trajectory, and one LINE_LIST, the
ellipses. Colours tell the class, opacity the weight of the mode. Ellipses of one mode share a
marker because displays pay per marker, not per point.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from msg_adapters.common import make_duration, make_header, make_pose, make_vector
from msg_adapters.predictions import strongest_modes
from msg_adapters.types import Types
from mtpgo_core.schema import AgentClass, Float64Array, Prediction, Source

BOXES, TRAJECTORIES, ELLIPSES, LABELS = "agents", "trajectories", "ellipses", "labels"
"""Namespaces, so that a display can switch each kind on and off."""

MODES_PER_AGENT = 256
"""A marker's id is the agent's slot times this plus the mode."""

_CUBE, _LINE_STRIP, _LINE_LIST, _TEXT = 1, 4, 5, 9
_ADD, _DELETE, _DELETE_ALL = 0, 2, 3
_MARKER, _ARRAY = "visualization_msgs/msg/Marker", "visualization_msgs/msg/MarkerArray"
_MAX_SLOT = (1 << 31) // MODES_PER_AGENT

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
    """What is drawn.

    Attributes:
        min_weight: modes lighter than this are not drawn, except an agent's strongest.
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


@dataclass
class MarkerTracker:
    """Keeps marker ids stable from message to message and knows what must be deleted.

    An agent holds one slot for as long as it is predicted; slots are not reused before all are
    spent, so a display never mixes two agents up.
    """

    _slots: dict[bytes, int] = field(default_factory=dict)
    _drawn: set[tuple[str, int]] = field(default_factory=set)
    _next: int = 0

    def slots(self, key: NDArray[np.uint32]) -> list[int]:
        """The slot of each of [n, 4] keys; agents not among them lose theirs."""
        names = [row.tobytes() for row in key]
        kept = {name: self._slots[name] for name in names if name in self._slots}
        taken = set(kept.values())
        for name in names:
            if name not in kept:
                while self._next in taken:
                    self._next = (self._next + 1) % _MAX_SLOT
                kept[name] = self._next
                self._next = (self._next + 1) % _MAX_SLOT
        self._slots = kept
        return [kept[name] for name in names]

    def stale(self, drawn: set[tuple[str, int]]) -> list[tuple[str, int]]:
        """Namespace and id of what stood in the last message and does not in this one."""
        gone = sorted(self._drawn - drawn)
        self._drawn = drawn
        return gone

    def clear(self) -> None:
        """Forget everything, after a :func:`clear_markers` message."""
        self._slots, self._drawn = {}, set()


def prediction_to_markers(
    prediction: Prediction,
    types: Types,
    tracker: MarkerTracker,
    *,
    max_modes: int | None = None,
    style: MarkerStyle | None = None,
) -> Any:
    """The prediction as a MarkerArray; deletions of stale markers stand first.

    Args:
        prediction: what to draw; stamp and frame go into every header.
        types: where message classes come from.
        tracker: the ids in use; one per topic.
        max_modes: the strongest modes to draw, renormalised; None draws all.
        style: what is drawn, default :class:`MarkerStyle`.
    """
    painter = _Painter(prediction, types, style or MarkerStyle(), max_modes)
    slots = tracker.slots(prediction.key)
    drawn = [marker for agent, slot in enumerate(slots) for marker in painter.agent(agent, slot)]
    deletions = [
        types.make(_MARKER, header=painter.header, ns=ns, id=number, action=_DELETE)
        for ns, number in tracker.stale({(marker.ns, marker.id) for marker in drawn})
    ]
    return types.make(_ARRAY, markers=deletions + drawn)


def clear_markers(types: Types, *, stamp_ns: int, frame_id: str) -> Any:
    """A MarkerArray that deletes all markers of the topic."""
    header = make_header(types, stamp_ns, frame_id)
    return types.make(_ARRAY, markers=[types.make(_MARKER, header=header, action=_DELETE_ALL)])


class _Painter:
    """One prediction's geometry, computed for all agents at once, then cut into markers."""

    def __init__(
        self, prediction: Prediction, types: Types, style: MarkerStyle, max_modes: int | None
    ) -> None:
        self.prediction, self.types, self.style = prediction, types, style
        self.header = make_header(types, prediction.stamp_ns, prediction.frame_id)
        self.weight, modes = strongest_modes(prediction, max_modes)
        self.lifetime = make_duration(types, style.lifetime_s)
        self.z = np.where(np.isfinite(prediction.z), prediction.z, 0.0)
        present = np.broadcast_to(
            prediction.initial[:, None, None, :2], (len(prediction), modes, 1, 2)
        )
        self.lines = np.concatenate([present, prediction.mean[:, :modes, :, :2]], axis=2)
        self.drawable = np.isfinite(self.lines[:, :, 1:]).all(axis=(2, 3))
        self.rings = _ellipses(prediction, modes, style)
        self.has_rings = np.isfinite(self.rings).all(axis=(2, 3, 4)) & (self.rings.shape[2] > 0)
        self.opacity = _opacity(self.weight)
        self.point = types.message_class("geometry_msgs/msg/Point")
        self.colour = types.message_class("std_msgs/msg/ColorRGBA")

    def agent(self, agent: int, slot: int) -> Iterator[Any]:
        """The markers of one agent."""
        first_id = slot * MODES_PER_AGENT
        if np.isfinite(self.prediction.initial[agent, :2]).all():
            yield self._box(agent, first_id)
            if self.style.labels:
                yield self._label(agent, first_id)
        weight = self.weight[agent]
        heavy = weight >= min(self.style.min_weight, weight.max(initial=0.0))
        for mode in np.flatnonzero(self.drawable[agent] & heavy).tolist():
            yield self._trajectory(agent, mode, first_id + mode)
            if self.has_rings[agent, mode] and weight[mode] >= self.style.ellipse_min_weight:
                yield self._rings(agent, mode, first_id + mode)

    def _box(self, agent: int, number: int) -> Any:
        prediction, height = self.prediction, self.style.box_height_m
        size = prediction.size[agent]
        length, width = np.where(np.isfinite(size), size, 1.0).tolist()
        yaw = prediction.initial_yaw[agent]
        return self.types.make(
            _MARKER,
            header=self.header,
            ns=BOXES,
            id=number,
            type=_CUBE,
            action=_ADD,
            pose=make_pose(
                self.types,
                prediction.initial[agent, :2],
                self.z[agent],
                yaw if np.isfinite(yaw) else 0.0,
            ),
            scale=make_vector(self.types, length, width, height),
            color=self._colour(agent, 0.7),
            lifetime=self.lifetime,
        )

    def _label(self, agent: int, number: int) -> Any:
        above = self.z[agent] + self.style.box_height_m
        name = AgentClass(int(self.prediction.agent_class[agent])).name.lower()
        return self.types.make(
            _MARKER,
            header=self.header,
            ns=LABELS,
            id=number,
            type=_TEXT,
            action=_ADD,
            pose=make_pose(self.types, self.prediction.initial[agent, :2], above, 0.0),
            scale=make_vector(self.types, 0.0, 0.0, 1.0),
            color=self._colour(agent, 1.0),
            lifetime=self.lifetime,
            text=f"{name} {int(self.prediction.key[agent, 0])}",
        )

    def _trajectory(self, agent: int, mode: int, number: int) -> Any:
        z, point = float(self.z[agent]), self.point
        line = self.lines[agent, mode]
        start = 0 if np.isfinite(line[0]).all() else 1
        return self.types.make(
            _MARKER,
            header=self.header,
            ns=TRAJECTORIES,
            id=number,
            type=_LINE_STRIP,
            action=_ADD,
            scale=make_vector(self.types, self.style.line_width_m, 0.0),
            color=self._colour(agent, float(self.opacity[agent, mode])),
            lifetime=self.lifetime,
            points=[point(x=x, y=y, z=z) for x, y in line[start:].tolist()],
        )

    def _rings(self, agent: int, mode: int, number: int) -> Any:
        z, point = float(self.z[agent]), self.point
        points = []
        for ring in self.rings[agent, mode].tolist():
            corners = [point(x=x, y=y, z=z) for x, y in ring]
            for here, there in zip(corners, corners[1:] + corners[:1], strict=True):
                points += [here, there]
        return self.types.make(
            _MARKER,
            header=self.header,
            ns=ELLIPSES,
            id=number,
            type=_LINE_LIST,
            action=_ADD,
            scale=make_vector(self.types, self.style.line_width_m / 2.0, 0.0),
            color=self._colour(agent, 0.6 * float(self.opacity[agent, mode])),
            lifetime=self.lifetime,
            points=points,
        )

    def _colour(self, agent: int, opacity: float) -> Any:
        if self.prediction.source[agent] != Source.MODEL:
            r, g, b = _FALLBACK_COLOUR
        else:
            r, g, b = _COLOURS.get(int(self.prediction.agent_class[agent]), _OTHER_COLOUR)
        return self.colour(r=r, g=g, b=b, a=opacity)


def _opacity(weight: Float64Array) -> Float64Array:
    """[n, M] opacity in 0.1..1: the weight relative to the agent's strongest mode."""
    return np.clip(weight / weight.max(axis=1, keepdims=True, initial=1e-12), 0.1, 1.0)


def _ellipses(prediction: Prediction, modes: int, style: MarkerStyle) -> Float64Array:
    """[n, M, E, C, 2] corners of the ellipses at E chosen steps (m)."""
    chosen = _ellipse_steps(prediction.time_s, style.ellipse_every_s)
    mean = prediction.mean[:, :modes, chosen, :2]
    covariance = prediction.covariance[:, :modes, chosen]
    angle = np.linspace(0.0, 2.0 * np.pi, style.ellipse_segments, endpoint=False)
    # The Cholesky factor maps the circle of radius sigma onto the ellipse.
    variance = np.maximum(covariance[..., 0, 0], 1e-12)
    a = np.sqrt(variance)
    b = covariance[..., 1, 0] / a
    c = np.sqrt(np.maximum(covariance[..., 1, 1] - b**2, 0.0))
    cos, sin = style.ellipse_sigma * np.cos(angle), style.ellipse_sigma * np.sin(angle)
    x = mean[..., 0, None] + a[..., None] * cos
    y = mean[..., 1, None] + b[..., None] * cos + c[..., None] * sin
    return np.stack([x, y], axis=-1)


def _ellipse_steps(time_s: Float64Array, every_s: float) -> NDArray[np.intp]:
    """Steps nearest to the multiples of ``every_s`` within the horizon."""
    if len(time_s) == 0:
        return np.empty(0, dtype=np.intp)
    wanted = every_s * np.arange(1, int(time_s[-1] / every_s + 1e-6) + 1)
    steps: NDArray[np.intp] = np.unique(np.abs(time_s - wanted[:, None]).argmin(axis=1))
    return steps
