# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Draws road users and their behaviour from wide ranges: driver models, motion, walking speeds.

All ranges are chosen, so that a model cannot rely on how one simulated driver behaves. Units are
SUMO's: m, s, m/s and m/s^2.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

from mtpgo_core.schema import Float64Array
from mtpgo_training.simulate.drivers import MAKERS, Generator, Maker, between, draw_types
from mtpgo_training.simulate.motion_config import MotionConfig
from mtpgo_training.simulate.sumo import VehicleType

_TYPES = 16
"""Types per label, each of which is a driver with a vehicle."""

_MODELS = ("EIDM", "IDM", "Krauss")
_MODEL_SHARES = (0.4, 0.3, 0.3)


def draw_varied_types(
    generator: Generator, shares: Mapping[str, float], *, desired_spread: float = 0.13
) -> tuple[list[VehicleType], Float64Array]:
    """Draw vehicle types and their probabilities.

    Args:
        generator: random numbers.
        shares: class label -> share of the traffic.
        desired_spread: standard deviation of a car's desired speed, as a share of the speed limit.

    Returns:
        The types, and the [types] probability of each.
    """
    return draw_types(
        generator, shares, _TYPES, desired_spread=desired_spread, makers=VARIED_MAKERS
    )


def motor_shares(generator: Generator, truck_share: float | None, high: float) -> dict[str, float]:
    """Return class label -> share of the motor traffic.

    Args:
        generator: random numbers.
        truck_share: share of trucks, drawn if None.
        high: largest share of trucks that is drawn.
    """
    trucks = between(generator, 0.01, high) if truck_share is None else truck_share
    rest = 1.0 - trucks
    vans, motorcycles = between(generator, 0.03, 0.12), between(generator, 0.01, 0.06)
    buses = between(generator, 0.0, 0.03)
    return {
        "car": rest * (1.0 - vans - motorcycles - buses),
        "van": rest * vans,
        "motorcycle": rest * motorcycles,
        "bus": rest * buses,
        "truck": trucks,
    }


def _varied(maker: Maker) -> Maker:
    """Return a maker of the same vehicles with a driver from wide ranges."""

    def make(generator: Generator, name: str, spread: float) -> VehicleType:
        kind = maker(generator, name, spread)
        return dataclasses.replace(
            kind,
            attributes={**kind.attributes, **_driving(generator, kind.attributes)},
            motion=_driven_motion(generator),
        )

    return make


def _driving(generator: Generator, given: Mapping[str, str]) -> dict[str, str]:
    """Return attributes of car following and lane changing."""
    model = str(generator.choice(_MODELS, p=_MODEL_SHARES))
    decel = between(generator, 2.0, 4.5)
    attributes = {
        "carFollowModel": model,
        "accel": f"{float(given['accel']) * between(generator, 0.7, 1.3):.2f}",
        "decel": f"{decel:.2f}",
        "emergencyDecel": f"{decel + 2.0:.2f}",
        "tau": f"{between(generator, 0.7, 2.2):.2f}",
        "minGap": f"{between(generator, 1.0, 3.5):.2f}",
        "lcSpeedGain": f"{between(generator, 0.2, 4.0):.2f}",
        "lcKeepRight": f"{between(generator, 0.1, 2.0):.2f}",
        "lcAssertive": f"{between(generator, 0.9, 2.0):.2f}",
        "lcCooperative": f"{between(generator, 0.4, 1.0):.2f}",
        "lcStrategic": f"{between(generator, 0.7, 3.0):.2f}",
        "maxSpeedLat": f"{between(generator, 0.6, 1.4):.2f}",
        "lcAccelLat": f"{between(generator, 0.4, 0.9):.2f}",
    }
    if model == "Krauss":
        attributes["sigma"] = f"{between(generator, 0.0, 0.6):.2f}"
    if model == "IDM":
        attributes["delta"] = f"{between(generator, 2.0, 5.0):.2f}"
    return attributes


def _driven_motion(generator: Generator) -> MotionConfig:
    """Draw the smoothing and wander of a motor vehicle's path."""
    return MotionConfig(
        smoothing_s=between(generator, 0.35, 0.6),
        wander_m=between(generator, 0.06, 0.3),
        surge_m=between(generator, 0.1, 0.5),
        wander_time_s=between(generator, 1.5, 3.5),
        offset_m=float(generator.normal(0.0, 0.15)),
    )


def _bus(generator: Generator, name: str, spread: float) -> VehicleType:
    truck = MAKERS["truck"](generator, name, spread)
    return dataclasses.replace(
        truck,
        label="bus",
        length=between(generator, 9.0, 18.0),
        width=between(generator, 2.45, 2.55),
        attributes={**truck.attributes, "vClass": "bus", "accel": "1.1"},
    )


def _motorcycle(generator: Generator, name: str, spread: float) -> VehicleType:
    car = MAKERS["car"](generator, name, spread)
    return dataclasses.replace(
        car,
        label="motorcycle",
        length=between(generator, 1.8, 2.3),
        width=between(generator, 0.7, 0.9),
        attributes={
            **car.attributes,
            "vClass": "motorcycle",
            "accel": f"{between(generator, 2.5, 4.0):.2f}",
            "latAlignment": str(generator.choice(["center", "left", "right", "arbitrary"])),
        },
    )


def _bicycle(generator: Generator, name: str, spread: float) -> VehicleType:
    kind = MAKERS["bicycle"](generator, name, spread)
    return dataclasses.replace(
        kind,
        attributes={
            **kind.attributes,
            **_driving(generator, kind.attributes),
            "maxSpeed": f"{between(generator, 2.8, 8.2):.2f}",
            "minGap": "0.8",
            "latAlignment": str(generator.choice(["right", "center"], p=[0.7, 0.3])),
        },
        motion=MotionConfig(
            smoothing_s=0.35,
            wander_m=between(generator, 0.08, 0.25),
            surge_m=between(generator, 0.1, 0.4),
            wander_time_s=between(generator, 0.7, 1.5),
            wander_speed_mps=4.0,
        ),
    )


def _pedestrian(generator: Generator, name: str, spread: float) -> VehicleType:
    return VehicleType(
        name,
        "pedestrian",
        length=between(generator, 0.3, 0.5),
        width=between(generator, 0.45, 0.65),
        attributes={
            "vClass": "pedestrian",
            "desiredMaxSpeed": f"{draw_walking_speed(generator):.2f}",
            "speedFactor": "1.0",
        },
        motion=walking_motion(generator),
    )


def draw_walking_speed(generator: Generator) -> float:
    """Draw a desired walking speed (m/s): normal around 1.34 (Weidmann 1993), 0.6 to 2."""
    return float(min(max(generator.normal(1.34, 0.3), 0.6), 2.0))


def walking_motion(generator: Generator) -> MotionConfig:
    """Draw the smoothing and wander of a pedestrian's path."""
    return MotionConfig(
        smoothing_s=between(generator, 0.35, 0.6),
        wander_m=between(generator, 0.05, 0.2),
        surge_m=between(generator, 0.05, 0.2),
        wander_time_s=between(generator, 0.8, 1.8),
        wander_speed_mps=1.0,
        trailing=False,
    )


VARIED_MAKERS: dict[str, Maker] = {
    "car": _varied(MAKERS["car"]),
    "van": _varied(MAKERS["van"]),
    "truck": _varied(MAKERS["truck"]),
    "bus": _varied(_bus),
    "motorcycle": _varied(_motorcycle),
    "bicycle": _bicycle,
    "pedestrian": _pedestrian,
}
"""Label -> function that draws a road user of that label."""
