# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Road network of the simulated street: carriageways, turn lanes, connections at the lights.

The street runs along x through two junctions, at each of which a road along y crosses it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mtpgo_core.schema import Float64Array
from mtpgo_training.simulate import sumo

MAIN_ENDS = ("west", "east")
"""Ends of the street."""

SIDE_ENDS = ("left_north", "left_south", "right_north", "right_south")
"""Ends of the crossing roads."""

_JUNCTION = {
    "west": "left",
    "east": "right",
    "left_north": "left",
    "left_south": "left",
    "right_north": "right",
    "right_south": "right",
}
_JUNCTIONS = ("left", "right")

# All chosen.
_MAIN_M = 420.0  # from the middle of the street to its ends (m)
_SIDE_M = 260.0  # from the street to the ends of the crossing roads (m)
_LANE_M = 3.5  # width of a lane (m)
_MEDIAN_M = 4.0  # width of the median, which the left-turn lane uses before the lights (m)
_TURN_LANE_M = 45.0  # length of the left-turn lane (m)
_SIDE_LIMIT_MPS = 11.2  # speed limit of the crossing roads (m/s), 25 mph


def entry(end: str) -> str:
    """Return the name of the edge on which traffic enters at an end."""
    return f"{end}.{_JUNCTION[end]}"


def exit_at(end: str) -> str:
    """Return the name of the edge on which traffic leaves at an end."""
    return f"{_JUNCTION[end]}.{end}"


def make_network(
    generator: np.random.Generator,
    *,
    middle: tuple[float, float],
    lanes: int,
    speed_limit_mps: float | None,
) -> sumo.RoadNetwork:
    """Return the network.

    Args:
        generator: random numbers for the distance of the junctions, the lanes of the crossing
            roads, the cycle of the lights, and the speed limit if none is given.
        middle: point halfway between the junctions (m).
        lanes: lanes of the street, per direction.
        speed_limit_mps: speed limit of the street (m/s); lower on the crossing roads.
    """
    half = float(generator.uniform(70.0, 110.0))
    limit = speed_limit_mps or float(generator.choice([11.2, 13.4, 15.6, 17.9]))
    side_lanes = int(generator.integers(1, max(lanes, 2) + 1))
    at = _places(middle, half)
    roads = [("west", "left", lanes, limit), ("east", "right", lanes, limit)]
    roads += [("left", "right", lanes, limit)]
    roads += [(end, _JUNCTION[end], side_lanes, min(limit, _SIDE_LIMIT_MPS)) for end in SIDE_ENDS]
    ways = [
        _carriageway(at, start, end, count, speed)
        for one, other, count, speed in roads
        for start, end in ((one, other), (other, one))
    ]
    nodes = [_node(name, place, lights=name in _JUNCTIONS) for name, place in at.items()]
    options = ["--tls.cycle.time", str(int(generator.integers(50, 101))), "--tls.yellow.time", "3"]
    # Offset of the second junction's lights from the first one's, as a share of the cycle.
    lag = str(generator.choice(["none", "quarter", "half"]))
    if lag != "none":
        options += [f"--tls.{lag}-offset", "right"]
    return sumo.RoadNetwork(
        [*nodes, *(node for way in ways for node in way.nodes())],
        [edge for way in ways for edge in way.edges()],
        [*(c for way in ways for c in way.openings()), *_crossings(ways)],
        options,
    )


@dataclass(frozen=True)
class _Carriageway:
    """One direction of a road, from one junction or end to another.

    Attributes:
        start, end: names of the junctions or ends.
        line: [2, 2] left edge of its leftmost lane, start and end point (m).
        ahead: [2] unit vector along it.
        lanes: number of lanes.
        speed: speed limit (m/s).
        lights: it ends at traffic lights, before which a left-turn lane opens.
    """

    start: str
    end: str
    line: Float64Array
    ahead: Float64Array
    lanes: int
    speed: float
    lights: bool

    @property
    def first(self) -> str:
        """Name of the edge at the start."""
        return f"{self.start}.{self.end}"

    @property
    def last(self) -> str:
        """Name of the edge at the end."""
        return f"{self.first}.turn" if self.lights else self.first

    def nodes(self) -> list[str]:
        """Return the node where the left-turn lane opens, if there is one."""
        return [_node(f"{self.first}.open", self._opening())] if self.lights else []

    def edges(self) -> list[str]:
        """Return one edge, or two if a left-turn lane opens."""
        start, end = self.line
        if not self.lights:
            return [self._edge(self.first, (self.start, self.end), [start, end], self.lanes)]
        opening = self._opening()
        aside = _LANE_M * _left_of(self.ahead)
        return [
            self._edge(
                self.first, (self.start, f"{self.first}.open"), [start, opening], self.lanes
            ),
            self._edge(
                self.last,
                (f"{self.first}.open", self.end),
                [opening + aside, end + aside],
                self.lanes + 1,
            ),
        ]

    def openings(self) -> list[str]:
        """Return the connections where the left-turn lane opens from the leftmost lane."""
        if not self.lights:
            return []
        pairs = [*((lane, lane) for lane in range(self.lanes)), (self.lanes - 1, self.lanes)]
        return [_connection(self.first, self.last, *pair) for pair in pairs]

    def _opening(self) -> Float64Array:
        opening: Float64Array = self.line[1] - _TURN_LANE_M * self.ahead
        return opening

    def _edge(
        self, name: str, ends: tuple[str, str], shape: list[Float64Array], lanes: int
    ) -> str:
        points = " ".join(f"{x:.3f},{y:.3f}" for x, y in shape)
        return (
            f'<edge id="{name}" from="{ends[0]}" to="{ends[1]}" numLanes="{lanes}" '
            f'width="{_LANE_M}" speed="{self.speed:.2f}" priority="{self.lanes}" '
            f'spreadType="right" shape="{points}"/>'
        )


def _places(middle: tuple[float, float], half: float) -> dict[str, Float64Array]:
    """Return the positions of junctions and ends, each [2] (m)."""
    places = {"left": (-half, 0.0), "right": (half, 0.0)}
    places |= {"west": (-_MAIN_M, 0.0), "east": (_MAIN_M, 0.0)}
    for junction in _JUNCTIONS:
        places[f"{junction}_north"] = (places[junction][0], _SIDE_M)
        places[f"{junction}_south"] = (places[junction][0], -_SIDE_M)
    return {name: np.add(middle, place) for name, place in places.items()}


def _carriageway(
    at: dict[str, Float64Array], start: str, end: str, lanes: int, speed: float
) -> _Carriageway:
    ahead = at[end] - at[start]
    ahead = ahead / np.linalg.norm(ahead)
    aside = -_MEDIAN_M / 2 * _left_of(ahead)
    return _Carriageway(
        start=start,
        end=end,
        line=np.stack([at[start] + aside, at[end] + aside]),
        ahead=ahead,
        lanes=lanes,
        speed=speed,
        lights=end in _JUNCTIONS,
    )


def _crossings(ways: list[_Carriageway]) -> list[str]:
    """Return the connections at the lights, where left turns have a separate lane."""
    connections = []
    for way in ways:
        for other in ways:
            if way.end != other.start or way.start == other.end:
                continue
            turn = float(np.dot(_left_of(way.ahead), other.ahead))
            if turn < -0.5:
                pairs = [(0, 0)]
            elif turn > 0.5:
                pairs = [(way.lanes, other.lanes - 1)]
            else:
                pairs = [(lane, lane) for lane in range(min(way.lanes, other.lanes))]
            connections += [_connection(way.last, other.first, *pair) for pair in pairs]
    return connections


def _left_of(direction: Float64Array) -> Float64Array:
    return np.array([-direction[1], direction[0]])


def _node(name: str, place: Float64Array, *, lights: bool = False) -> str:
    kind = "traffic_light" if lights else "priority"
    return f'<node id="{name}" x="{place[0]:.3f}" y="{place[1]:.3f}" type="{kind}" radius="6"/>'


def _connection(one: str, other: str, from_lane: int, to_lane: int) -> str:
    return f'<connection from="{one}" to="{other}" fromLane="{from_lane}" toLane="{to_lane}"/>'
