# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Draws vehicle types with their drivers, and departure times.

The ranges are chosen so that drivers differ. Units are SUMO's: m, s, m/s and m/s^2.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mtpgo_core.schema import Float64Array
from mtpgo_training.simulate.simulation_config import SimulationConfig
from mtpgo_training.simulate.sumo import EXTRA_S, VehicleType

Generator = np.random.Generator

Maker = Callable[[Generator, str, float], VehicleType]
"""Random numbers, name, and spread of the desired speed -> vehicle type."""


def draw_types(
    generator: Generator,
    shares: Mapping[str, float],
    count: int,
    *,
    desired_spread: float,
    makers: Mapping[str, Maker] | None = None,
) -> tuple[list[VehicleType], Float64Array]:
    """Draw vehicle types and their probabilities.

    Args:
        generator: random numbers.
        shares: class label -> share of the traffic.
        count: number of types per label.
        desired_spread: standard deviation of a car's desired speed, as a share of the speed limit.
        makers: label -> function that draws a type, ``MAKERS`` by default.

    Returns:
        The types, and the [types] probability of each.
    """
    types, probability = [], []
    for label, share in shares.items():
        for i in range(count if share > 0 else 0):
            types.append((makers or MAKERS)[label](generator, f"{label}{i}", desired_spread))
            probability.append(share / count)
    weights = np.array(probability)
    return types, weights / weights.sum()


@dataclass(frozen=True)
class Departure:
    """A vehicle that enters the simulation.

    Attributes:
        number: number of the vehicle, from 0.
        time_s: time of entry since the start of the simulation (s).
        kind: its type.
    """

    number: int
    time_s: float
    kind: VehicleType


def departures(
    config: SimulationConfig,
    generator: Generator,
    per_hour: float,
    types: Sequence[VehicleType],
    probability: Float64Array,
) -> Iterator[Departure]:
    """Yield vehicles with exponentially distributed gaps until the end of the simulation.

    Each is drawn when it is asked for, so that the caller can draw further properties of a vehicle
    in between from the same generator.

    Args:
        config: length of the simulation.
        generator: random numbers.
        per_hour: demand (vehicles/h).
        types: vehicle types.
        probability: [types] probability of each type.
    """
    time_s, number = 0.0, 0
    while time_s < config.warm_up_s + config.seconds + EXTRA_S:
        kind = types[int(generator.choice(len(types), p=probability))]
        yield Departure(number, time_s, kind)
        time_s += float(generator.exponential(3600.0 / per_hour))
        number += 1


def between(generator: Generator, low: float, high: float) -> float:
    """Return a number drawn uniformly from a range."""
    return float(generator.uniform(low, high))


def _steering(generator: Generator) -> dict[str, str]:
    """Return attributes of SUMO's sublane model; a high lcSublane returns to the lane's centre."""
    return {
        "laneChangeModel": "SL2015",
        "latAlignment": "center",
        "lcSublane": "5",
        "minGapLat": "0.6",
        "lcSpeedGain": f"{between(generator, 0.6, 2.5):.2f}",
        "lcKeepRight": f"{between(generator, 0.3, 1.5):.2f}",
        "lcAssertive": f"{between(generator, 1.0, 1.6):.2f}",
        "maxSpeedLat": f"{between(generator, 0.7, 1.5):.2f}",
        "lcAccelLat": f"{between(generator, 0.5, 1.0):.2f}",
        # No lateral motion at rest, and none at an angle that steering cannot reach.
        "lcMaxSpeedLatStanding": "0",
        "lcMaxSpeedLatFactor": "0.3",
    }


def _car(generator: Generator, name: str, spread: float) -> VehicleType:
    desired = float(np.clip(generator.normal(1.0, spread), 0.72, 1.4))
    return VehicleType(
        name,
        "car",
        length=between(generator, 3.7, 5.1),
        width=between(generator, 1.65, 1.95),
        attributes={
            "vClass": "passenger",
            "carFollowModel": "EIDM",
            "accel": f"{between(generator, 1.4, 2.6):.2f}",
            "decel": f"{between(generator, 2.5, 4.0):.2f}",
            "tau": f"{between(generator, 0.8, 1.7):.2f}",
            "minGap": f"{between(generator, 1.5, 3.0):.2f}",
            "speedFactor": f"{desired:.3f}",
            **_steering(generator),
        },
    )


def _van(generator: Generator, name: str, spread: float) -> VehicleType:
    car = _car(generator, name, spread)
    return VehicleType(
        name,
        "van",
        length=between(generator, 5.0, 6.9),
        width=between(generator, 1.9, 2.1),
        attributes={**car.attributes, "accel": f"{between(generator, 1.1, 1.8):.2f}"},
    )


def _truck(generator: Generator, name: str, spread: float) -> VehicleType:
    long = generator.random() < 0.7
    return VehicleType(
        name,
        "truck",
        length=between(generator, 13.0, 18.5) if long else between(generator, 7.5, 12.0),
        width=between(generator, 2.4, 2.55),
        attributes={
            "vClass": "truck",
            "carFollowModel": "EIDM",
            "accel": f"{between(generator, 0.6, 1.1):.2f}",
            "decel": f"{between(generator, 2.0, 3.0):.2f}",
            "tau": f"{between(generator, 1.3, 2.2):.2f}",
            "minGap": f"{between(generator, 2.5, 4.0):.2f}",
            "maxSpeed": f"{between(generator, 21.5, 25.0):.2f}",
            "speedFactor": "1.0",
            **_steering(generator),
            "lcSpeedGain": f"{between(generator, 0.2, 0.8):.2f}",
        },
    )


def _bicycle(generator: Generator, name: str, spread: float) -> VehicleType:
    return VehicleType(
        name,
        "bicycle",
        length=between(generator, 1.6, 1.9),
        width=between(generator, 0.55, 0.7),
        attributes={
            "vClass": "bicycle",
            "carFollowModel": "EIDM",
            "accel": f"{between(generator, 0.7, 1.2):.2f}",
            "decel": f"{between(generator, 1.5, 3.0):.2f}",
            "tau": f"{between(generator, 0.8, 1.4):.2f}",
            "minGap": "0.8",
            "maxSpeed": f"{between(generator, 3.8, 7.0):.2f}",
            **_steering(generator),
        },
    )


MAKERS: dict[str, Maker] = {"car": _car, "van": _van, "truck": _truck, "bicycle": _bicycle}
"""Label -> function that draws a vehicle type of that label."""
