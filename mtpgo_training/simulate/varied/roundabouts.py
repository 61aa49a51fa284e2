# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Simulates roundabouts of many sizes: islands of 8 to 40 m radius, three to five arms.

Size, arms and their directions, lanes, demand and turns are drawn from the seed. Recordings are in
inD layout.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mtpgo_core.options import option
from mtpgo_training.data.recording import Recording
from mtpgo_training.simulate import sumo
from mtpgo_training.simulate.drivers import Generator, between
from mtpgo_training.simulate.drone_camera import make_recording
from mtpgo_training.simulate.roundabout import (
    CENTRE,
    ring_mouth,
    ring_network,
    ring_routes,
    ring_vehicles,
)
from mtpgo_training.simulate.simulation_config import VariedConfig
from mtpgo_training.simulate.varied.road_builder import box_view
from mtpgo_training.simulate.varied.varied_drivers import draw_varied_types, motor_shares

# All chosen.
_RADIUS_M = (8.0, 40.0)  # of the island
_TWO_LANES_FROM_M = 14.0  # radius of the island from which a ring may have two lanes
_BETWEEN_RAD = 0.3  # between the mouths of two arms
_ARM_MPS = (7.5, 13.0)  # speed limit of the arms
_MARGIN_M = (35.0, 60.0)  # from the island to the edge of the image
_PER_HOUR = (350.0, 650.0)  # demand per arm and lane (vehicles/h); more blocks a small ring


@dataclass(frozen=True)
class RoundaboutsConfig(VariedConfig):
    """What is simulated; None is drawn from the seed.

    The demand is the total of all arms; ``lanes`` applies to the ring and to the arms.

    Attributes:
        radius_m: radius of the central island (m).
        arms: number of arms, fewer where they do not fit.
        bicycle_share: share of bicycles in the demand, 0 to 1.
    """

    lanes: int | None = option(None, low=1, high=2)
    radius_m: float | None = option(None, low=_RADIUS_M[0], high=60.0)
    arms: int | None = option(None, low=3, high=6)
    bicycle_share: float | None = option(None, low=0.0, high=1.0)


def simulate_roundabouts(config: RoundaboutsConfig, name: str = "00") -> Recording:
    """Return one recording of a roundabout.

    Raises:
        SimulationError: SUMO is missing or fails.
    """
    generator = np.random.default_rng(config.seed)
    # Small radii are as frequent as large ones on a logarithmic scale.
    radius = config.radius_m or float(np.exp(generator.uniform(*np.log(_RADIUS_M))))
    lanes = config.lanes
    if lanes is None:
        lanes = 2 if radius >= _TWO_LANES_FROM_M and generator.random() < 0.5 else 1
    arms = config.arms or int(generator.choice([3, 4, 5], p=[0.3, 0.45, 0.25]))
    angles = _draw_angles(generator, arms, 2 * ring_mouth(radius, lanes) + _BETWEEN_RAD)
    bicycles = config.bicycle_share
    if bicycles is None:
        bicycles = between(generator, 0.0, 0.15)
    motor = motor_shares(generator, config.truck_share, 0.12)
    shares = {label: share * (1 - bicycles) for label, share in motor.items()}
    types, probability = draw_varied_types(generator, shares | {"bicycle": bicycles})
    per_hour = config.vehicles_per_hour
    if per_hour is None:
        per_hour = len(angles) * lanes * between(generator, *_PER_HOUR)
    demand = [
        *ring_routes(len(angles)),
        *ring_vehicles(config, generator, per_hour, types, probability, len(angles)),
    ]
    network = ring_network(radius, lanes, angles, between(generator, *_ARM_MPS))
    seen = sumo.run_simulation(network, types, demand, config)
    half = radius + lanes * 3.6 + between(generator, *_MARGIN_M)
    view = box_view(CENTRE, (half, half))
    return make_recording(seen, types, view, config, name=name, layout="ind")


def _draw_angles(generator: Generator, arms: int, least: float) -> list[float]:
    """Draw the directions of arms (rad, ascending) that are at least an angle apart.

    An arm is dropped where they do not fit.
    """
    arms = min(arms, int(2 * np.pi / least))
    free = 2 * np.pi - arms * least
    # Gaps beyond the least one share what is left; the shape 4 is chosen.
    gaps = least + free * generator.dirichlet(np.full(arms, 4.0))
    start = between(generator, 0.0, 2 * np.pi)
    return [float(angle) for angle in start + np.concatenate([[0.0], np.cumsum(gaps[:-1])])]
