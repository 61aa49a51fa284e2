# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Records a busy place of a scenario that the user has: any configuration of Eclipse SUMO.

The place is drawn from the seed among the busiest ones. Classes and sizes are those of the vehicle
types in the scenario's files; paths are smoothed and wander as everywhere. Recordings are in inD
layout.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.options import option
from mtpgo_core.schema import Float64Array
from mtpgo_training.data.recording import Recording
from mtpgo_training.simulate import sumo
from mtpgo_training.simulate.drivers import Generator
from mtpgo_training.simulate.drone_camera import make_recording
from mtpgo_training.simulate.simulation_config import VariedConfig
from mtpgo_training.simulate.varied.road_builder import box_view
from mtpgo_training.simulate.varied.varied_drivers import VARIED_MAKERS

# SUMO's vehicle class -> label, length and width (m) where a type does not give them: SUMO's own.
_CLASSES = {
    "passenger": ("car", 5.0, 1.8),
    "private": ("car", 5.0, 1.8),
    "taxi": ("car", 5.0, 1.8),
    "delivery": ("van", 6.5, 2.16),
    "truck": ("truck", 7.1, 2.4),
    "trailer": ("truck", 16.5, 2.55),
    "bus": ("bus", 12.0, 2.5),
    "coach": ("bus", 14.0, 2.6),
    "motorcycle": ("motorcycle", 2.2, 0.9),
    "moped": ("motorcycle", 2.1, 0.8),
    "bicycle": ("bicycle", 1.6, 0.65),
    "pedestrian": ("pedestrian", 0.215, 0.478),
}
_DEFAULT_CLASSES = {
    "DEFAULT_PEDTYPE": "pedestrian",
    "DEFAULT_BIKETYPE": "bicycle",
    "DEFAULT_TAXITYPE": "taxi",
}


@dataclass(frozen=True)
class ScenarioConfig(VariedConfig):
    """What is simulated.

    Attributes:
        sumocfg: configuration of SUMO.
        places: number of busy places among which the seed draws.
        half_view_m: half the edge of the square image (m).
    """

    sumocfg: Path | None = None
    warm_up_s: float = 300.0
    places: int = option(10, low=1)
    half_view_m: float = option(80.0, above=0.0)


def simulate_scenario(config: ScenarioConfig, name: str = "00") -> Recording:
    """Return one recording of a busy place of the scenario.

    Raises:
        ConfigurationError: no configuration of SUMO is given, or it cannot be read.
        SimulationError: SUMO is missing or fails.
    """
    if config.sumocfg is None:
        raise ConfigurationError("--sumocfg is not given, expected a configuration of SUMO")
    root = _read_xml(config.sumocfg)
    begin = root.find(".//begin")
    begin_s = _seconds(begin.get("value", "0")) if begin is not None else 0.0
    seen = sumo.run_scenario(config.sumocfg, begin_s, config)
    classes = dict(_vehicle_classes(root, config.sumocfg.parent))
    types = [_road_user(kind, classes.get(kind, {})) for kind in sorted(set(seen.types))]
    generator = np.random.default_rng(config.seed)
    middle = _draw_place(generator, seen, config)
    view = box_view(middle, (config.half_view_m, config.half_view_m))
    return make_recording(seen, types, view, config, name=name, layout="ind")


def _read_xml(path: Path) -> ElementTree.Element:
    try:
        return ElementTree.parse(path).getroot()
    except (OSError, ElementTree.ParseError) as error:
        raise ConfigurationError(
            f"{path} cannot be read: {error}, expected a configuration of SUMO (XML)"
        ) from error


def _seconds(text: str) -> float:
    """Return a time of SUMO's in s: a number, or hours:minutes:seconds."""
    seconds = 0.0
    for part in text.split(":"):
        seconds = 60.0 * seconds + float(part)
    return seconds


def _vehicle_classes(
    root: ElementTree.Element, folder: Path
) -> Iterator[tuple[str, dict[str, str]]]:
    """Yield (name, attributes) of the vehicle types in the scenario's route and other files."""
    for option_name in ("route-files", "additional-files"):
        option = root.find(f".//{option_name}")
        names = option.get("value", "").replace(",", " ").split() if option is not None else []
        for path in (folder / name for name in names):
            if path.suffix != ".xml" or not path.is_file():
                continue
            for _, element in ElementTree.iterparse(path):
                if element.tag == "vType":
                    yield element.get("id", ""), dict(element.attrib)
                element.clear()


def _road_user(name: str, attributes: dict[str, str]) -> sumo.VehicleType:
    """Return a vehicle type of the scenario with a path that wanders."""
    vehicle_class = attributes.get("vClass", _DEFAULT_CLASSES.get(name, "passenger"))
    label, length, width = _CLASSES.get(vehicle_class, ("unknown", 5.0, 1.8))
    # Reproducible from the name alone.
    generator = np.random.default_rng(zlib.crc32(name.encode()))
    maker = VARIED_MAKERS.get(label, VARIED_MAKERS["car"])
    return sumo.VehicleType(
        name,
        label,
        length=float(attributes.get("length", length)),
        width=float(attributes.get("width", width)),
        attributes={},
        motion=maker(generator, name, 0.1).motion,
    )


def _draw_place(
    generator: Generator, seen: sumo.FloatingCarData, config: ScenarioConfig
) -> Float64Array:
    """Draw the [2] middle of an image (m) among the cells that most road users move through."""
    moving = seen.front[seen.speed > 1.0] if (seen.speed > 1.0).any() else seen.front
    cells, count = np.unique(
        np.floor(moving / config.half_view_m).astype(int), axis=0, return_counts=True
    )
    busiest = cells[np.argsort(-count, kind="stable")][: config.places]
    chosen = busiest[int(generator.integers(len(busiest)))]
    inside = (np.floor(moving / config.half_view_m).astype(int) == chosen).all(axis=1)
    middle: Float64Array = moving[inside].mean(axis=0)
    return middle
