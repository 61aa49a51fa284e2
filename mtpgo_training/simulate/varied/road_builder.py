# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Geometry of curved roads, and the network elements that are made of it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mtpgo_core.schema import BoolArray, Float64Array
from mtpgo_training.simulate.drone_camera import InView
from mtpgo_training.simulate.sumo import RoadNetwork

SPACING_M = 2.0
"""Distance between the points of a line (m). Chosen: a chord of it is within 2 cm of a circle of
30 m radius."""

_EDGE_M = (20.0, 200.0)
"""Shortest and longest edge of a curved road (m), each with its own speed limit. Chosen."""

_SAME_SPEED = 1.12
"""Ratio of the speeds that share an edge. Chosen."""

_TRANSITION_M = 24.0
"""Length over which the curvature changes (m). Chosen."""


def curved_line(
    pieces: Sequence[tuple[float, float]],
    *,
    start: tuple[float, float] = (0.0, 0.0),
    heading: float = 0.0,
    transition_m: float = _TRANSITION_M,
) -> Float64Array:
    """Return the [n, 2] points of a line (m), SPACING_M apart.

    Args:
        pieces: (length in m, curvature in 1/m, positive to the left) of each piece.
        start: first point (m).
        heading: heading at the first point (rad).
        transition_m: length over which the curvature changes between two pieces (m).
    """
    curvature = np.concatenate([np.full(round(m / SPACING_M), k) for m, k in pieces])
    width = min(max(1, round(transition_m / SPACING_M)), len(curvature))
    padded = np.pad(curvature, (width // 2, width - 1 - width // 2), mode="edge")
    curvature = np.convolve(padded, np.full(width, 1.0 / width), mode="valid")
    turned = heading + SPACING_M * (np.cumsum(curvature) - curvature / 2)
    steps = SPACING_M * np.stack([np.cos(turned), np.sin(turned)], axis=1)
    return np.concatenate([[start], np.asarray(start) + np.cumsum(steps, axis=0)])


def curvature_of(line: Float64Array) -> Float64Array:
    """Return the [n] curvature (1/m, positive to the left) of an [n, 2] line."""
    heading = headings_of(line)
    length = np.linalg.norm(np.gradient(line, axis=0), axis=1)
    curvature: Float64Array = np.gradient(heading) / np.maximum(length, 1e-9)
    return curvature


def headings_of(line: Float64Array) -> Float64Array:
    """Return the [n] heading (rad, not wrapped) of an [n, 2] line."""
    ahead = np.gradient(line, axis=0)
    heading: Float64Array = np.unwrap(np.arctan2(ahead[:, 1], ahead[:, 0]))
    return heading


def shifted(line: Float64Array, left_m: float) -> Float64Array:
    """Return an [n, 2] line moved to its left by a distance (m), negative to the right."""
    heading = headings_of(line)
    return line + left_m * np.stack([-np.sin(heading), np.cos(heading)], axis=1)


def comes_near_itself(line: Float64Array, distance_m: float) -> bool:
    """Whether parts of a line that are far apart along it are close to each other."""
    points = line[:: max(1, round(distance_m / 4 / SPACING_M))]
    spacing = float(np.linalg.norm(points[1] - points[0]))
    apart = np.linalg.norm(points[:, None] - points[None], axis=2)
    index = np.arange(len(points))
    far_along = np.abs(index[:, None] - index[None]) * spacing > 3.0 * distance_m
    return bool((apart[far_along] < distance_m).any())


def box_view(middle: Sequence[float] | Float64Array, half_m: Sequence[float]) -> InView:
    """Return the view of a rectangular image, in which a road user is with its whole length.

    Args:
        middle: middle of the image (m).
        half_m: half its extent in x and in y (m).
    """

    def in_view(position: Float64Array, size: Float64Array) -> BoolArray:
        reach = np.abs(position - np.asarray(middle)) + size.max(axis=1)[:, None] / 2
        seen: BoolArray = (reach <= np.asarray(half_m)).all(axis=1)
        return seen

    return in_view


class RoadBuilder:
    """Collects nodes, edges and connections of a road network."""

    def __init__(self) -> None:
        """Begin with an empty network."""
        self._nodes: dict[str, str] = {}
        self._edges: list[str] = []
        self._connections: list[str] = []

    def network(self, *options: str) -> RoadNetwork:
        """Return the network, with further arguments of netconvert."""
        return RoadNetwork(list(self._nodes.values()), self._edges, self._connections, options)

    def node(self, name: str, point: Float64Array, **attributes: str) -> None:
        """Add a node, unless there is one of this name."""
        extra = "".join(f' {key}="{value}"' for key, value in attributes.items())
        x, y = point
        self._nodes.setdefault(name, f'<node id="{name}" x="{x:.3f}" y="{y:.3f}"{extra}/>')

    def edge(
        self,
        name: str,
        ends: tuple[str, str],
        line: Float64Array,
        *,
        lanes: int,
        speed_mps: float,
        **attributes: str,
    ) -> None:
        """Add an edge whose lanes lie to the right of a line.

        Args:
            name: name of the edge.
            ends: nodes at its start and end.
            line: [n, 2] points (m).
            lanes: number of lanes.
            speed_mps: speed limit (m/s).
            attributes: further attributes of the edge.
        """
        shape = " ".join(f"{x:.3f},{y:.3f}" for x, y in line)
        extra = "".join(f' {key}="{value}"' for key, value in attributes.items())
        self._edges.append(
            f'<edge id="{name}" from="{ends[0]}" to="{ends[1]}" numLanes="{lanes}" '
            f'speed="{speed_mps:.2f}" spreadType="right" shape="{shape}"{extra}/>'
        )

    def connect(self, one: str, other: str, pairs: Sequence[tuple[int, int]]) -> None:
        """Connect lanes of one edge with lanes of the next, lane 0 being the rightmost."""
        self._connections += [
            f'<connection from="{one}" to="{other}" fromLane="{a}" toLane="{b}"/>'
            for a, b in pairs
        ]

    def carriageway(
        self,
        name: str,
        line: Float64Array,
        *,
        lanes: int,
        lane_m: float,
        limit_mps: float,
        lateral_mps2: float,
        first: str | None = None,
        last: str | None = None,
    ) -> list[str]:
        """Add one direction of a road as a chain of edges and return their names.

        Args:
            name: prefix of the names.
            line: [n, 2] left edge of the leftmost lane (m).
            lanes: number of lanes.
            lane_m: width of a lane (m).
            limit_mps: speed limit where the road is straight (m/s).
            lateral_mps2: lateral acceleration that limits the speed in curves (m/s^2).
            first: name of the node at its start, of its own by default.
            last: name of the node at its end.
        """
        bend = np.abs(curvature_of(shifted(line, -lanes * lane_m / 2)))
        speeds = np.minimum(limit_mps, np.sqrt(lateral_mps2 / np.maximum(bend, 1e-6)))
        places = _cut(speeds)
        count = len(places) - 1
        nodes = [first or f"{name}.0", *(f"{name}.{i}" for i in range(1, count))]
        nodes.append(last or f"{name}.{count}")
        for node, place in zip(nodes, places, strict=True):
            self.node(node, line[place], radius="0.5")
        edges = [f"{name}_{i}" for i in range(count)]
        for i, edge in enumerate(edges):
            part = slice(places[i], places[i + 1] + 1)
            self.edge(
                edge,
                (nodes[i], nodes[i + 1]),
                line[part],
                lanes=lanes,
                speed_mps=float(speeds[part].min()),
                width=f"{lane_m:.2f}",
            )
            if i:
                self.connect(edges[i - 1], edge, [(lane, lane) for lane in range(lanes)])
        return edges


def _cut(speeds: Float64Array) -> list[int]:
    """Return the points at which a line is cut into edges of about one speed each."""
    shortest, longest = (round(length / SPACING_M) for length in _EDGE_M)
    places = [0]
    low = high = float(speeds[0])
    for i, speed in enumerate(speeds.tolist()):
        low, high = min(low, speed), max(high, speed)
        length = i - places[-1]
        differs = high > _SAME_SPEED * low and length >= shortest
        if (differs or length >= longest) and len(speeds) - 1 - i >= shortest:
            # The point before, so that a straight does not take the speed of the bend after it.
            places.append(i - 1 if length > shortest else i)
            begun = speeds[places[-1] : i + 1]
            low, high = float(begun.min()), float(begun.max())
    return [*places, len(speeds) - 1]
