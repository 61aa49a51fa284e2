# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Simulates a city street with two signalised junctions: queues, their discharge, turns.

Lanes, speeds, signal cycles, demand and turns are drawn from the seed unless they are given.
Recordings are in inD layout: y up, the origin in the upper left corner of the image.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mtpgo_core.options import option
from mtpgo_core.schema import BoolArray, Float64Array
from mtpgo_training.data.recording import Recording
from mtpgo_training.simulate import drivers, sumo
from mtpgo_training.simulate.drone_camera import make_recording
from mtpgo_training.simulate.simulation_config import SimulationConfig
from mtpgo_training.simulate.street_network import (
    MAIN_ENDS,
    SIDE_ENDS,
    entry,
    exit_at,
    make_network,
)

MIDDLE = (170.0, -90.0)
"""Point of the street halfway between its junctions, in the recording (m)."""

VIEW_M = (165.0, 85.0)
"""Half the length of the image along the street and across it (m)."""


@dataclass(frozen=True)
class StreetConfig(SimulationConfig):
    """What is simulated; None is drawn from the seed.

    The demand is the total of all ends; ``lanes`` is per direction of the street, without the
    left-turn lanes at the junctions.

    Attributes:
        bicycle_share: share of bicycles in the demand, 0 to 1.
        speed_limit_mps: speed limit of the street (m/s); lower on the crossing roads.
    """

    lanes: int | None = option(None, low=1, high=3)
    bicycle_share: float = 0.01
    speed_limit_mps: float | None = None


def simulate_street(config: StreetConfig, name: str = "00") -> Recording:
    """Return one recording of the street.

    Raises:
        SimulationError: SUMO is missing or fails.
    """
    generator = np.random.default_rng(config.seed)
    lanes = config.lanes or int(generator.choice([1, 2, 3], p=[0.2, 0.5, 0.3]))
    truck_share = config.truck_share
    if truck_share is None:
        truck_share = float(generator.uniform(0.01, 0.06))
    motor = 1 - truck_share - config.bicycle_share
    types, probability = drivers.draw_types(
        generator,
        {
            "car": 0.92 * motor,
            "van": 0.08 * motor,
            "truck": truck_share,
            "bicycle": config.bicycle_share,
        },
        count=20,
        desired_spread=0.12,
    )
    per_hour = config.vehicles_per_hour
    if per_hour is None:
        per_hour = float(generator.uniform(500.0, 1200.0)) * (lanes + 1)
    network = make_network(
        generator, middle=MIDDLE, lanes=lanes, speed_limit_mps=config.speed_limit_mps
    )
    trips = _trips(config, generator, per_hour, types, probability)
    seen = sumo.run_simulation(network, types, trips, config)
    return make_recording(seen, types, _in_view, config, name=name, layout="ind")


def _in_view(position: Float64Array, size: Float64Array) -> BoolArray:
    reach = np.abs(position - MIDDLE) + size.max() / 2
    seen: BoolArray = (reach <= VIEW_M).all(axis=1)
    return seen


def _trips(
    config: StreetConfig,
    generator: np.random.Generator,
    per_hour: float,
    types: list[sumo.VehicleType],
    probability: Float64Array,
) -> list[str]:
    """Return XML elements of trips; most vehicles enter along the street and stay on it."""
    ends = [*MAIN_ENDS, *SIDE_ENDS]
    busy = np.array([6.0] * len(MAIN_ENDS) + [1.5] * len(SIDE_ENDS))
    start_share = generator.dirichlet(2 * busy)
    # No U-turns.
    goal_share = np.stack([generator.dirichlet(2 * busy) for _ in ends])
    np.fill_diagonal(goal_share, 0.0)
    goal_share /= goal_share.sum(axis=1, keepdims=True)
    trips = []
    for departure in drivers.departures(config, generator, per_hour, types, probability):
        start = int(generator.choice(len(ends), p=start_share))
        goal = int(generator.choice(len(ends), p=goal_share[start]))
        trips.append(
            f'<trip id="{departure.number}" type="{departure.kind.name}" '
            f'from="{entry(ends[start])}" to="{exit_at(ends[goal])}" '
            f'depart="{departure.time_s:.2f}" '
            'departLane="best" departSpeed="desired" departPos="base"/>'
        )
    return trips
