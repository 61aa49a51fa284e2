# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Simulates a roundabout with four arms and one or two lanes; entering traffic yields.

Size, lanes, demand and turns are drawn from the seed unless they are given. Recordings are in inD
layout: y up, the origin in the upper left corner of the image.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from mtpgo_core.options import option
from mtpgo_core.schema import BoolArray, Float64Array
from mtpgo_training.data.recording import Recording
from mtpgo_training.simulate import drivers, sumo
from mtpgo_training.simulate.drone_camera import make_recording
from mtpgo_training.simulate.simulation_config import SimulationConfig

CENTRE = (60.0, -60.0)
"""Centre of the roundabout in the recording (m)."""

# All chosen.
_VIEW_M = 58.0  # half the edge of the square image (m)
_ARM_M = 160.0  # from the centre to the outer end of an arm (m)
_LANE_M = 3.6  # width of a lane (m)
FOUR_ARMS = tuple(arm * 2 * np.pi / 4 for arm in range(4))
"""Directions of four arms at right angles (rad)."""
_LATERAL_MPS2 = 2.6  # comfortable lateral acceleration in the ring (m/s^2)


@dataclass(frozen=True)
class RoundaboutConfig(SimulationConfig):
    """What is simulated; None is drawn from the seed.

    The demand is the total of all arms; ``lanes`` applies to the ring and to the arms.

    Attributes:
        bicycle_share: share of bicycles in the demand, 0 to 1.
    """

    lanes: int | None = option(None, low=1, high=2)
    bicycle_share: float = 0.03
    warm_up_s: float = 60.0


def simulate_roundabout(config: RoundaboutConfig, name: str = "00") -> Recording:
    """Return one recording of the roundabout.

    Raises:
        SimulationError: SUMO is missing or fails.
    """
    generator = np.random.default_rng(config.seed)
    lanes = config.lanes or int(generator.choice([1, 2], p=[0.6, 0.4]))
    radius = float(generator.uniform(13.0, 18.0)) + (lanes - 1) * 4.0
    truck_share = config.truck_share
    if truck_share is None:
        truck_share = float(generator.uniform(0.03, 0.12))
    motor = 1 - truck_share - config.bicycle_share
    types, probability = drivers.draw_types(
        generator,
        {
            "car": 0.9 * motor,
            "van": 0.1 * motor,
            "truck": truck_share,
            "bicycle": config.bicycle_share,
        },
        count=15,
        desired_spread=0.08,
    )
    per_hour = config.vehicles_per_hour
    if per_hour is None:
        # Chosen: a higher demand blocks the ring, where vehicles do not give way.
        per_hour = float(generator.uniform(1000.0, 1900.0))
    vehicles = ring_vehicles(config, generator, per_hour, types, probability)
    seen = sumo.run_simulation(
        ring_network(radius, lanes), types, [*ring_routes(), *vehicles], config
    )
    return make_recording(seen, types, _in_view, config, name=name, layout="ind")


def _in_view(position: Float64Array, size: Float64Array) -> BoolArray:
    seen: BoolArray = (np.abs(position - CENTRE) + size.max() / 2 <= _VIEW_M).all(axis=1)
    return seen


def _point(radius: float, angle: float) -> tuple[float, float]:
    return CENTRE[0] + radius * float(np.cos(angle)), CENTRE[1] + radius * float(np.sin(angle))


def _shape(points: Iterable[tuple[float, float]]) -> str:
    return " ".join(f"{x:.3f},{y:.3f}" for x, y in points)


def _arc(radius: float, start: float, end: float) -> list[tuple[float, float]]:
    count = max(3, int(np.ceil((end - start) / np.radians(5.0))))
    return [_point(radius, angle) for angle in np.linspace(start, end, count)]


def ring_mouth(radius: float, lanes: int) -> float:
    """Return the angle between an arm's axis and its two ends at the ring (rad)."""
    return (lanes * _LANE_M + 1.5) / radius


def ring_network(
    radius: float, lanes: int, angles: Sequence[float] = FOUR_ARMS, arm_mps: float = 13.9
) -> sumo.RoadNetwork:
    """Return the network.

    Args:
        radius: radius of the central island (m).
        lanes: lanes of the ring and of each arm, per direction.
        angles: directions of the arms, ascending (rad).
        arm_mps: speed limit of the arms (m/s).

    The ring runs counter-clockwise; at each arm the exit comes before the entry. The ring's edges
    are drawn along their left, inner side, so ``radius`` is that of the island (m).
    """
    half = ring_mouth(radius, lanes)
    speed = float(np.sqrt(_LATERAL_MPS2 * (radius + lanes * _LANE_M / 2)))
    nodes, edges, ring_edges, ring_nodes = [], [], [], []

    def node(name: str, point: tuple[float, float]) -> None:
        nodes.append(f'<node id="{name}" x="{point[0]:.3f}" y="{point[1]:.3f}" radius="4"/>')

    def edge(
        name: str, ends: tuple[str, str], points: list[tuple[float, float]], ring: bool
    ) -> None:
        edges.append(
            f'<edge id="{name}" from="{ends[0]}" to="{ends[1]}" numLanes="{lanes}" '
            f'width="{_LANE_M}" speed="{speed if ring else arm_mps:.2f}" '
            f'priority="{10 if ring else 1}" spreadType="right" shape="{_shape(points)}"/>'
        )

    arms = len(angles)
    for arm, angle in enumerate(angles):
        following = angles[arm + 1] if arm + 1 < arms else angles[0] + 2 * np.pi
        outside = np.array([np.cos(angle), np.sin(angle)])
        side = np.array([-outside[1], outside[0]])

        def along_arm(
            distance: float, offset: float, o: Float64Array = outside, s: Float64Array = side
        ) -> tuple[float, float]:
            x, y = np.array(CENTRE) + distance * o + offset * s
            return float(x), float(y)

        mouth_in, mouth_out = _point(radius, angle + half), _point(radius, angle - half)
        node(f"enter{arm}", mouth_in)
        node(f"leave{arm}", mouth_out)
        node(f"from{arm}", along_arm(_ARM_M, 0.5))
        node(f"to{arm}", along_arm(_ARM_M, -0.5))
        # The arms widen towards the ring around a splitter island.
        wide = radius + lanes * _LANE_M + 14.0
        narrow = radius + lanes * _LANE_M + 3.0
        approach = [along_arm(_ARM_M, 0.5), along_arm(wide, 0.5), along_arm(narrow, 1.8), mouth_in]
        departure = [
            mouth_out,
            along_arm(narrow, -1.8),
            along_arm(wide, -0.5),
            along_arm(_ARM_M, -0.5),
        ]
        edge(f"in{arm}", (f"from{arm}", f"enter{arm}"), approach, ring=False)
        edge(f"out{arm}", (f"leave{arm}", f"to{arm}"), departure, ring=False)
        edge(
            f"mouth{arm}",
            (f"leave{arm}", f"enter{arm}"),
            _arc(radius, angle - half, angle + half),
            ring=True,
        )
        edge(
            f"ring{arm}",
            (f"enter{arm}", f"leave{(arm + 1) % arms}"),
            _arc(radius, angle + half, following - half),
            ring=True,
        )
        ring_nodes += [f"leave{arm}", f"enter{arm}"]
        ring_edges += [f"mouth{arm}", f"ring{arm}"]
    edges.append(f'<roundabout nodes="{" ".join(ring_nodes)}" edges="{" ".join(ring_edges)}"/>')
    return sumo.RoadNetwork(nodes, edges)


def ring_routes(arms: int = 4) -> list[str]:
    """Return XML elements of routes from every arm to every other, without U-turns (rare)."""
    routes = []
    for start in range(arms):
        for turn in range(1, arms):
            edges = [f"in{start}"]
            for passed in range(turn):
                edges.append(f"ring{(start + passed) % arms}")
                if passed < turn - 1:
                    edges.append(f"mouth{(start + passed + 1) % arms}")
            edges.append(f"out{(start + turn) % arms}")
            routes.append(f'<route id="r{start}{turn}" edges="{" ".join(edges)}"/>')
    return routes


def ring_vehicles(
    config: SimulationConfig,
    generator: np.random.Generator,
    per_hour: float,
    types: list[sumo.VehicleType],
    probability: Float64Array,
    arms: int = 4,
) -> list[str]:
    """Return XML elements of the vehicles, sorted by departure."""
    arm_share = generator.dirichlet(np.full(arms, 6.0))
    turn_share = generator.dirichlet(np.full(arms - 1, 6.0), size=arms)
    vehicles = []
    for departure in drivers.departures(config, generator, per_hour, types, probability):
        arm = int(generator.choice(arms, p=arm_share))
        turn = 1 + int(generator.choice(arms - 1, p=turn_share[arm]))
        vehicles.append(
            f'<vehicle id="{departure.number}" type="{departure.kind.name}" '
            f'route="r{arm}{turn}" '
            f'depart="{departure.time_s:.2f}" '
            'departLane="best" departSpeed="desired" departPos="base"/>'
        )
    return vehicles
