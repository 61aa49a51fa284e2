# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Simulates a straight motorway without ramps: two carriageways, 420 m in view, as in highD.

Demand, speeds and traffic state are drawn from the seed unless they are given. Speed
signs downstream of the section in view cause congestion, which travels upstream through it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mtpgo_core.options import option
from mtpgo_core.schema import BoolArray, Float64Array
from mtpgo_training.data.recording import Recording
from mtpgo_training.simulate import drivers, sumo
from mtpgo_training.simulate.drone_camera import make_recording
from mtpgo_training.simulate.simulation_config import TRAFFIC_STATES, SimulationConfig

# Lengths along the road (m). The section in view has the length of highD's; the others are chosen.
_SEEN_M = 420.0
_MARGIN_M = 60.0  # observed by SUMO on either side, so that smoothing has no edges in the section
_BEFORE_M = 1000.0  # upstream, where vehicles enter
_BEHIND_M = 60.0  # downstream, without speed signs
_SIGNS_M = 500.0  # further downstream, with speed signs

# Across the road (m), chosen: upper edge of the image to the first lane, and the median.
_TOP_M = 8.0
_MEDIAN_M = 4.6

# Traffic state -> range of demand per lane (vehicles/h). Chosen.
_DEMAND = {
    "free": (500.0, 1100.0),
    "dense": (1200.0, 1800.0),
    "congested": (1500.0, 2000.0),
    "stop-and-go": (1500.0, 2000.0),
}


@dataclass(frozen=True)
class HighwayConfig(SimulationConfig):
    """What is simulated; None is drawn from the seed.

    Demand and ``lanes`` are per direction.

    Attributes:
        traffic: one of ``TRAFFIC_STATES``, for both directions.
        speed_limit_mps: desired speed of an average driver (m/s).
    """

    lanes: int | None = option(None, low=2, high=4)
    traffic: str | None = option(None, choices=TRAFFIC_STATES)
    speed_limit_mps: float | None = None


@dataclass(frozen=True)
class _Direction:
    """One carriageway, with all values drawn."""

    name: str
    traffic: str
    per_hour: float
    limit_mps: float


def simulate_highway(config: HighwayConfig, name: str = "01") -> Recording:
    """Return one recording of the motorway.

    Raises:
        SimulationError: SUMO is missing or fails.
    """
    generator = np.random.default_rng(config.seed)
    lanes = config.lanes or int(generator.integers(2, 4))
    lane_width = float(generator.uniform(3.5, 3.9))
    truck_share = config.truck_share
    if truck_share is None:
        truck_share = float(generator.uniform(0.08, 0.3))
    types, probability = drivers.draw_types(
        generator,
        {"car": 0.92 * (1 - truck_share), "van": 0.08 * (1 - truck_share), "truck": truck_share},
        count=25,
        desired_spread=0.11,
    )
    directions = [_draw_direction(config, generator, side, lanes) for side in ("east", "west")]
    seen = sumo.run_simulation(
        _network(directions, lanes, lane_width),
        types,
        _demand(config, generator, directions, lanes, types, probability),
        config,
        observed_edges=["east_seen", "west_seen"],
        additional=_signs(config, generator, directions, lanes),
    )
    return make_recording(
        seen,
        types,
        _whole_vehicle_seen,
        config,
        name=name,
        layout="highd",
        lanes=_markings(lanes, lane_width),
    )


def _whole_vehicle_seen(position: Float64Array, size: Float64Array) -> BoolArray:
    """Return [rows] whether the whole vehicle is within the section."""
    reach = np.abs(position[:, 0] - _SEEN_M / 2) + size[:, 0] / 2
    seen: BoolArray = reach <= _SEEN_M / 2
    return seen


def _draw_direction(
    config: HighwayConfig, generator: np.random.Generator, name: str, lanes: int
) -> _Direction:
    traffic = config.traffic or str(generator.choice(TRAFFIC_STATES, p=[0.35, 0.3, 0.2, 0.15]))
    per_hour = float(generator.uniform(*_DEMAND[traffic])) * lanes
    limit = float(generator.choice([27.8, 33.3, 36.1, 38.9], p=[0.2, 0.3, 0.3, 0.2]))
    return _Direction(
        name=name,
        traffic=traffic,
        per_hour=config.vehicles_per_hour or per_hour,
        limit_mps=config.speed_limit_mps or limit,
    )


def _network(directions: list[_Direction], lanes: int, lane_width: float) -> sumo.RoadNetwork:
    """Return the network: east drives along +x on the lower side, west along -x on the upper."""
    lengths = (_BEFORE_M, _SEEN_M + 2 * _MARGIN_M, _BEHIND_M, _SIGNS_M)
    nodes, edges = [], []
    for direction in directions:
        sign = 1 if direction.name == "east" else -1
        start = -(_BEFORE_M + _MARGIN_M) if sign > 0 else _SEEN_M + _MARGIN_M + _BEFORE_M
        places = start + sign * np.concatenate([[0.0], np.cumsum(lengths)])
        # The lanes lie to the right of the edge's line, which is the inner edge line.
        y = _inner_line(direction.name, lanes, lane_width)
        for i, x in enumerate(places):
            nodes.append(f'<node id="{direction.name}{i}" x="{x:.3f}" y="{y:.3f}"/>')
        for i, part in enumerate(("before", "seen", "behind", "signs")):
            edges.append(
                f'<edge id="{direction.name}_{part}" from="{direction.name}{i}" '
                f'to="{direction.name}{i + 1}" numLanes="{lanes}" width="{lane_width:.3f}" '
                f'speed="{direction.limit_mps:.2f}" spreadType="right"/>'
            )
    return sumo.RoadNetwork(nodes, edges)


def _inner_line(direction: str, lanes: int, lane_width: float) -> float:
    """Return y of the marking next to the median (m), internal frame."""
    upper = -(_TOP_M + lanes * lane_width)
    return upper if direction == "west" else upper - _MEDIAN_M


def _demand(
    config: HighwayConfig,
    generator: np.random.Generator,
    directions: list[_Direction],
    lanes: int,
    types: list[sumo.VehicleType],
    probability: Float64Array,
) -> list[str]:
    """Return XML elements of routes and vehicles, vehicles sorted by departure."""
    routes, vehicles = [], []
    for direction in directions:
        parts = " ".join(f"{direction.name}_{p}" for p in ("before", "seen", "behind", "signs"))
        routes.append(f'<route id="{direction.name}" edges="{parts}"/>')
        per_hour = direction.per_hour
        for departure in drivers.departures(config, generator, per_hour, types, probability):
            lane = 0 if departure.kind.label == "truck" else int(generator.integers(lanes))
            vehicles.append(
                (
                    departure.time_s,
                    f'<vehicle id="{direction.name}.{departure.number}" '
                    f'type="{departure.kind.name}" route="{direction.name}" '
                    f'depart="{departure.time_s:.2f}" departLane="{lane}" '
                    'departSpeed="desired" departPos="base"/>',
                )
            )
    return [*routes, *(xml for _, xml in sorted(vehicles))]


def _signs(
    config: HighwayConfig,
    generator: np.random.Generator,
    directions: list[_Direction],
    lanes: int,
) -> list[str]:
    """Return speed signs downstream: slow for congestion, alternately slow and fast for waves."""
    signs = []
    for direction in directions:
        if direction.traffic not in ("congested", "stop-and-go"):
            continue
        steps = [(0.0, direction.limit_mps)]
        time = float(generator.uniform(0.1, 0.3)) * config.warm_up_s
        while time < config.warm_up_s + config.seconds + sumo.EXTRA_S:
            if direction.traffic == "congested":
                steps.append((time, float(generator.uniform(2.5, 9.0))))
                time += float(generator.uniform(30.0, 80.0))
            else:
                steps.append((time, float(generator.uniform(0.5, 3.0))))
                time += float(generator.uniform(15.0, 30.0))
                steps.append((time, float(generator.uniform(12.0, 25.0))))
                time += float(generator.uniform(25.0, 50.0))
        places = " ".join(f"{direction.name}_signs_{lane}" for lane in range(lanes))
        inner = "".join(f'<step time="{t:.2f}" speed="{v:.2f}"/>' for t, v in steps)
        signs.append(
            f'<variableSpeedSign id="{direction.name}_sign" lanes="{places}">{inner}'
            "</variableSpeedSign>"
        )
    return signs


def _markings(lanes: int, lane_width: float) -> tuple[Float64Array, ...]:
    """Return the lane markings from top to bottom, each [2, 2] in the direction of travel (m)."""
    out = []
    for direction, (start, end) in (("west", (_SEEN_M, 0.0)), ("east", (0.0, _SEEN_M))):
        inner = _inner_line(direction, lanes, lane_width)
        outward = np.arange(lanes + 1) * lane_width
        ys = sorted(inner + outward if direction == "west" else inner - outward, reverse=True)
        out += [np.array([[start, y], [end, y]]) for y in ys]
    return tuple(out)
