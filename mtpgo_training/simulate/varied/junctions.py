# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Simulates a junction with three or four arms: motor traffic, bicycles and pedestrians.

Right of way (lights, priority, right before left, all-way stop), angles and lanes of the arms,
sidewalks, demand and turns are drawn from the seed. Recordings are in inD layout.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mtpgo_core.options import option
from mtpgo_core.schema import Float64Array
from mtpgo_training.data.recording import Recording
from mtpgo_training.simulate import sumo
from mtpgo_training.simulate.drivers import Generator, between, departures
from mtpgo_training.simulate.drone_camera import make_recording
from mtpgo_training.simulate.simulation_config import VariedConfig
from mtpgo_training.simulate.varied.road_builder import RoadBuilder, box_view, curved_line
from mtpgo_training.simulate.varied.varied_drivers import draw_varied_types, motor_shares

RIGHTS_OF_WAY = ("traffic_light", "priority", "right_before_left", "allway_stop")
"""Rights of way by SUMO's node types."""

# All chosen.
_ARM_M = 150.0  # from the junction to the outer end of an arm (m)
_VIEW_M = (55.0, 80.0)  # half the edge of the square image (m)
_LEAST_ANGLE = np.radians(55.0)  # between two arms (rad)
# Right of way -> demand per lane and arm (vehicles/h); lights carry more.
_DEMAND = {
    "traffic_light": (250.0, 500.0),
    "priority": (180.0, 420.0),
    "right_before_left": (100.0, 280.0),
    "allway_stop": (100.0, 260.0),
}


@dataclass(frozen=True)
class JunctionsConfig(VariedConfig):
    """What is simulated; None is drawn from the seed.

    The demand is the total of all arms, without pedestrians.

    Attributes:
        right_of_way: one of ``RIGHTS_OF_WAY``.
        bicycle_share: share of bicycles in the demand, 0 to 1.
        pedestrians_per_hour: pedestrians (1/h).
    """

    lanes: int | None = option(None, low=1, high=3)
    right_of_way: str | None = option(None, choices=RIGHTS_OF_WAY)
    bicycle_share: float | None = option(None, low=0.0, high=1.0)
    pedestrians_per_hour: float | None = option(None, low=0.0)


def simulate_junctions(config: JunctionsConfig, name: str = "00") -> Recording:
    """Return one recording of a junction.

    Raises:
        SimulationError: SUMO is missing or fails.
    """
    generator = np.random.default_rng(config.seed)
    rule = config.right_of_way or str(generator.choice(RIGHTS_OF_WAY, p=[0.5, 0.25, 0.15, 0.1]))
    bearings = _draw_bearings(generator)
    lanes = _draw_lanes(generator, config, rule, len(bearings))
    network = _network(generator, rule, bearings, lanes)
    bicycles = config.bicycle_share
    if bicycles is None:
        bicycles = between(generator, 0.03, 0.3)
    motor = motor_shares(generator, config.truck_share, 0.06)
    shares = {label: share * (1 - bicycles) for label, share in motor.items()}
    types, probability = draw_varied_types(generator, shares | {"bicycle": bicycles})
    walkers, walker_probability = draw_varied_types(generator, {"pedestrian": 1.0})
    per_hour = config.vehicles_per_hour or sum(lanes) * between(generator, *_DEMAND[rule])
    elements = _trips(generator, config, per_hour, types, probability, lanes)
    walks = config.pedestrians_per_hour
    if walks is None:
        walks = between(generator, 400.0, 1600.0)
    if walks > 0:
        elements += _walks(generator, config, walks, walkers, walker_probability, len(bearings))
    seen = sumo.run_simulation(
        network, [*types, *walkers], [xml for _, xml in sorted(elements)], config
    )
    half = between(generator, *_VIEW_M)
    view = box_view((0.0, 0.0), (half, half))
    return make_recording(seen, [*types, *walkers], view, config, name=name, layout="ind")


def _draw_bearings(generator: Generator) -> list[float]:
    """Draw the directions of three or four arms (rad, ascending)."""
    arms = int(generator.choice([3, 4], p=[0.4, 0.6]))
    tee = arms == 3 and generator.random() < 0.6
    regular = np.array([0.0, 0.5, 1.0]) * np.pi if tee else np.arange(arms) * 2 * np.pi / arms
    turned = between(generator, 0.0, 2 * np.pi)
    while True:
        bearings = regular + generator.uniform(-0.35, 0.35, arms)
        gaps = np.diff([*bearings, bearings[0] + 2 * np.pi])
        if gaps.min() >= _LEAST_ANGLE:
            return [float(angle) for angle in bearings + turned]


def _draw_lanes(generator: Generator, config: JunctionsConfig, rule: str, arms: int) -> list[int]:
    """Draw the lanes of each arm, per direction; two arms are the main road."""
    if config.lanes:
        return [config.lanes] * arms
    wide = rule == "traffic_light" or (rule == "priority" and generator.random() < 0.3)
    main = int(generator.integers(1, 3)) if wide else 1
    side = int(generator.integers(1, main + 1))
    return [main if arm % 2 == 0 else side for arm in range(arms)]


def _network(
    generator: Generator, rule: str, bearings: list[float], lanes: list[int]
) -> sumo.RoadNetwork:
    """Return the network: edges in0, out0, ... towards and away from the junction."""
    builder = RoadBuilder()
    builder.node("middle", np.zeros(2), type=rule, radius=f"{between(generator, 4.0, 10.0):.1f}")
    limit = float(generator.choice([8.3, 11.1, 13.9, 16.7]))
    lane_m, sidewalk_m = between(generator, 3.0, 3.6), between(generator, 2.0, 4.5)
    bike_lane = generator.random() < 0.35
    for arm, (bearing, count) in enumerate(zip(bearings, lanes, strict=True)):
        outward = _arm_line(generator, bearing)
        builder.node(f"end{arm}", outward[-1])
        # The main road has priority.
        common = {
            "priority": str(2 if arm % 2 == 0 else 1),
            "width": f"{lane_m:.2f}",
            "sidewalkWidth": f"{sidewalk_m:.2f}",
        }
        if bike_lane:
            common["bikeLaneWidth"] = "1.6"
        ways = ((f"in{arm}", outward[::-1]), (f"out{arm}", outward))
        for (name, line), ends in zip(
            ways, ((f"end{arm}", "middle"), ("middle", f"end{arm}")), strict=True
        ):
            builder.edge(name, ends, line, lanes=count, speed_mps=limit, **common)
    return builder.network(
        "--crossings.guess",
        *("--junctions.limit-turn-speed", f"{between(generator, 2.0, 3.5):.2f}"),
        *("--tls.cycle.time", str(int(generator.integers(40, 91)))),
        *("--tls.yellow.time", "3"),
    )


def _arm_line(generator: Generator, bearing: float) -> Float64Array:
    """Draw the line of an arm from the junction outwards (m); some bend."""
    curvature = float(generator.choice([-1.0, 1.0])) * between(generator, 0.0, 1.0 / 120.0)
    bent = generator.random() < 0.4
    return curved_line([(40.0, 0.0), (_ARM_M - 40.0, curvature if bent else 0.0)], heading=bearing)


def _trips(
    generator: Generator,
    config: JunctionsConfig,
    per_hour: float,
    types: list[sumo.VehicleType],
    probability: Float64Array,
    lanes: list[int],
) -> list[tuple[float, str]]:
    """Return (departure in s, XML element) of the vehicles."""
    arms = len(lanes)
    start_share = generator.dirichlet(6.0 * np.array(lanes) / np.mean(lanes))
    goal_share = generator.dirichlet(np.full(arms, 3.0), size=arms)
    np.fill_diagonal(goal_share, 0.0)
    goal_share /= goal_share.sum(axis=1, keepdims=True)
    trips = []
    for departure in departures(config, generator, per_hour, types, probability):
        start = int(generator.choice(arms, p=start_share))
        goal = int(generator.choice(arms, p=goal_share[start]))
        trips.append(
            (
                departure.time_s,
                f'<trip id="{departure.number}" type="{departure.kind.name}" from="in{start}" '
                f'to="out{goal}" depart="{departure.time_s:.2f}" departLane="best" '
                'departSpeed="max" departPos="base"/>',
            )
        )
    return trips


def _walks(
    generator: Generator,
    config: JunctionsConfig,
    per_hour: float,
    walkers: list[sumo.VehicleType],
    probability: Float64Array,
    arms: int,
) -> list[tuple[float, str]]:
    """Return (departure in s, XML element) of pedestrians, some in groups of the same speed."""
    walks = []
    edges = [f"{way}{arm}" for arm in range(arms) for way in ("in", "out")]
    for departure in departures(config, generator, per_hour / 1.3, walkers, probability):
        start, goal = (edges[i] for i in generator.choice(len(edges), 2, replace=False))
        position = between(generator, 0.15, 0.9) * (_ARM_M - 15.0)
        size = int(generator.choice([1, 2, 3], p=[0.78, 0.16, 0.06]))
        for member in range(size):
            time_s = departure.time_s + 0.3 * member
            walks.append(
                (
                    time_s,
                    f'<person id="p{departure.number}.{member}" type="{departure.kind.name}" '
                    f'depart="{time_s:.2f}" departPos="{position:.1f}" departPosLat="random">'
                    f'<walk from="{start}" to="{goal}"/></person>',
                )
            )
    return walks
