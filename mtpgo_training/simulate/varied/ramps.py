# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Simulates a motorway with ramps: on-ramps, off-ramps, weaving sections, lane drops.

Each direction has a section of its own. The line of the motorway, its lanes, the ramps' shapes and
the traffic are drawn from the seed. Recordings are in inD layout.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from mtpgo_core.options import option
from mtpgo_core.schema import Float64Array
from mtpgo_training.data.recording import Recording
from mtpgo_training.simulate import sumo
from mtpgo_training.simulate.drivers import Generator, between, departures
from mtpgo_training.simulate.drone_camera import make_recording
from mtpgo_training.simulate.simulation_config import VariedConfig
from mtpgo_training.simulate.varied.road_builder import (
    SPACING_M,
    RoadBuilder,
    box_view,
    curved_line,
    headings_of,
    shifted,
)
from mtpgo_training.simulate.varied.varied_drivers import draw_varied_types, motor_shares

SECTIONS = ("on_ramp", "off_ramp", "weaving", "lane_drop")
"""What a carriageway has in view."""

# All chosen.
_LINE_M = 1500.0  # length of the motorway, with the section in its middle
_ASIDE_M = 80.0  # from the middle of the motorway to that of the section, at most
_SECTION_M = {  # length of the acceleration, deceleration or weaving lane
    "on_ramp": (120.0, 280.0),
    "off_ramp": (100.0, 220.0),
    "weaving": (160.0, 380.0),
    "lane_drop": (100.0, 250.0),
}
_LEAST_RADIUS_M = 500.0  # of the motorway
_RAMP_M = 320.0  # length of a ramp
_HALF_VIEW_M = (170.0, 250.0)  # half the edge of the square image
_PER_HOUR = (800.0, 1700.0)  # demand per lane of the motorway (vehicles/h)
_RAMP_PER_HOUR = (200.0, 900.0)  # demand of an on-ramp (vehicles/h)


@dataclass(frozen=True)
class RampsConfig(VariedConfig):
    """What is simulated; None is drawn from the seed.

    Demand and ``lanes`` are per direction, without the ramps.

    Attributes:
        section: one of ``SECTIONS``, for both directions.
        speed_limit_mps: speed limit of the motorway (m/s).
    """

    lanes: int | None = option(None, low=1, high=4)
    section: str | None = option(None, choices=SECTIONS)
    speed_limit_mps: float | None = None


def simulate_ramps(config: RampsConfig, name: str = "00") -> Recording:
    """Return one recording of a motorway with ramps.

    Raises:
        SimulationError: SUMO is missing or fails.
    """
    generator = np.random.default_rng(config.seed)
    builder = RoadBuilder()
    line = _draw_line(generator)
    half_median = between(generator, 1.5, 4.0)
    limit = config.speed_limit_mps or between(generator, 19.0, 36.0)
    lane_m = between(generator, 3.4, 3.8)
    types, probability = draw_varied_types(
        generator, motor_shares(generator, config.truck_share, 0.2)
    )
    elements: list[tuple[float, str]] = []
    routes: list[str] = []
    for side, way in (("forward", line), ("backward", line[::-1])):
        section = config.section or str(generator.choice(SECTIONS, p=[0.3, 0.2, 0.35, 0.15]))
        lanes = config.lanes or int(generator.integers(2, 4))
        road = _Carriageway(generator, builder, side, section, lanes, lane_m, limit)
        own = road.add(shifted(way, -half_median))
        routes += [f'<route id="{key}" edges="{" ".join(r)}"/>' for key, r in own.items()]
        total = config.vehicles_per_hour or lanes * between(generator, *_PER_HOUR)
        ramp = between(generator, *_RAMP_PER_HOUR) if f"{side}.on.through" in own else 0.0
        leaving = between(generator, 0.1, 0.4)
        for departure in departures(config, generator, total + ramp, types, probability):
            start = "on" if generator.random() * (total + ramp) < ramp else "main"
            goal = "off" if generator.random() < leaving else "through"
            key = f"{side}.{start}.{goal}"
            if key not in own:
                key = f"{side}.{start}.through"
            elements.append(
                (
                    departure.time_s,
                    f'<vehicle id="{side}.{departure.number}" type="{departure.kind.name}" '
                    f'route="{key}" depart="{departure.time_s:.2f}" departLane="best" '
                    'departSpeed="max" departPos="base"/>',
                )
            )
    network = builder.network()
    demand = [*routes, *(xml for _, xml in sorted(elements))]
    seen = sumo.run_simulation(network, types, demand, config)
    half = between(generator, *_HALF_VIEW_M)
    view = box_view(line[len(line) // 2], (half, half))
    return make_recording(seen, types, view, config, name=name, layout="ind")


def _draw_line(generator: Generator) -> Float64Array:
    """Draw the [n, 2] middle line of a gently curved motorway (m)."""
    pieces = [(_LINE_M / 4, between(generator, -1.0, 1.0) / _LEAST_RADIUS_M) for _ in range(4)]
    return curved_line(pieces, heading=between(generator, -np.pi, np.pi), transition_m=100.0)


@dataclass(frozen=True)
class _Carriageway:
    """One direction with its section, to be added to a network.

    Attributes:
        generator: random numbers.
        builder: the network.
        side: prefix of its names.
        section: one of ``SECTIONS``.
        lanes: lanes of the main road.
        lane_m: width of a lane (m).
        limit_mps: speed limit of the main road (m/s).
    """

    generator: Generator
    builder: RoadBuilder
    side: str
    section: str
    lanes: int
    lane_m: float
    limit_mps: float

    def add(self, line: Float64Array) -> dict[str, list[str]]:
        """Add the carriageway along the [n, 2] left edge of its leftmost lane.

        Returns:
            Name of a route -> its edges, from the main road or the on-ramp to the main road or
            the off-ramp.
        """
        length = between(self.generator, *_SECTION_M[self.section])
        start = (_LINE_M - length) / 2 + between(self.generator, -_ASIDE_M, _ASIDE_M)
        at = [0, round(start / SPACING_M), round((start + length) / SPACING_M), len(line) - 1]
        parts = [line[one : other + 1] for one, other in itertools.pairwise(at)]
        wide, after = self.lanes + 1, self.lanes
        if self.section == "lane_drop":
            wide, after = self.lanes, max(1, self.lanes - 1)
        begin, end = f"{self.side}.begin", f"{self.side}.end"
        one = self._part("before", parts[0], self.lanes, last=begin)
        two = self._part("section", parts[1], wide, first=begin, last=end)
        three = self._part("after", parts[2], after, first=end)
        added = wide - self.lanes
        pairs = [(lane, lane + added) for lane in range(self.lanes)]
        if self.section == "off_ramp":
            pairs.append((0, 0))
        self.builder.connect(one[-1], two[0], pairs)
        # The right lane ends, or the left one.
        dropped = wide - after
        left = self.section == "lane_drop" and self.generator.random() < 0.5
        shift = 0 if left else dropped
        self.builder.connect(two[-1], three[0], [(lane + shift, lane) for lane in range(after)])
        routes = {f"{self.side}.main.through": [*one, *two, *three]}
        if self.section in ("on_ramp", "weaving"):
            ramp = self._ramp("on", shifted(parts[1], -self.lanes * self.lane_m), begin)
            self.builder.connect(ramp[-1], two[0], [(0, 0)])
            routes[f"{self.side}.on.through"] = [*ramp, *two, *three]
        if self.section in ("off_ramp", "weaving"):
            ramp = self._ramp("off", shifted(parts[1], -self.lanes * self.lane_m), end)
            self.builder.connect(two[-1], ramp[0], [(0, 0)])
            routes[f"{self.side}.main.off"] = [*one, *two, *ramp]
        return routes

    def _part(
        self,
        name: str,
        line: Float64Array,
        lanes: int,
        first: str | None = None,
        last: str | None = None,
    ) -> list[str]:
        return self.builder.carriageway(
            f"{self.side}.{name}",
            line,
            lanes=lanes,
            lane_m=self.lane_m,
            limit_mps=self.limit_mps,
            lateral_mps2=3.5,
            first=first,
            last=last,
        )

    def _ramp(self, name: str, edge: Float64Array, node: str) -> list[str]:
        """Add a ramp at one end of the added lane and return its edges.

        Args:
            name: on or off.
            edge: [n, 2] left edge of the added lane (m).
            node: node of the main road.
        """
        generator, on = self.generator, name == "on"
        # Off-ramps turn to the right; seen against the direction of travel, on-ramps turn left.
        sign = 1.0 if on else -1.0
        tight = generator.random() < 0.35
        radius = between(generator, 40.0, 80.0) if tight else between(generator, 90.0, 400.0)
        turn = np.radians(between(generator, 60.0, 230.0) if tight else between(generator, 8, 60))
        bow = min(radius * turn, _RAMP_M - 80.0)
        # A gentle angle first, so that the ramp clears the main road.
        pieces = [(30.0, sign / 300.0), (between(generator, 10.0, 40.0), 0.0)]
        pieces += [(bow, sign / radius), (max(_RAMP_M - bow - 60.0, 20.0), 0.0)]
        heading = float(headings_of(edge)[0] + np.pi) if on else float(headings_of(edge)[-1])
        place = edge[0] if on else edge[-1]
        line = curved_line(pieces, start=(float(place[0]), float(place[1])), heading=heading)
        return self.builder.carriageway(
            f"{self.side}.{name}",
            line[::-1] if on else line,
            lanes=1,
            lane_m=self.lane_m,
            limit_mps=min(self.limit_mps, between(generator, 14.0, 24.0)),
            lateral_mps2=between(generator, 2.0, 3.2),
            first=None if on else node,
            last=node if on else None,
        )
