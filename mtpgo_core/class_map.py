# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Names and numbers of classes in other people's data -> our classes.

A class map is a preset or a small YAML file: a name or number of the data on the left, one of
ours on the right, and optionally a preset to build on::

    preset: nuscenes
    tram: bus
    forklift: truck
    17: pedestrian

Names are compared without regard to capitals, and blanks and hyphens count as underscores. A name
with dots that is not in the map is looked up by its beginning: ``vehicle.bus.rigid`` is what
``vehicle.bus`` is.
"""

from __future__ import annotations

import os
import re
import unicodedata
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.options import listed
from mtpgo_core.schema import AgentClass, ClassArray
from mtpgo_core.whole_file import user_path
from mtpgo_core.yaml_file import read_yaml

_LONGEST_NAME = 200
"""Longer names are no names of classes (characters); chosen."""

_COCO_NUMBERS = 92
"""Numbers of COCO's classes are smaller; those that take no part in traffic are unknown."""

_ANIMALS = ("bird", "cat", "dog", "horse", "sheep", "cow", "elephant", "bear", "zebra", "giraffe")


def _coco(number: Mapping[str, int], first_animal: int) -> dict[str, str]:
    """Return the classes of COCO that take part in traffic, by name and by number."""
    names = {
        "person": "pedestrian",
        "bicycle": "bicycle",
        "car": "car",
        "motorcycle": "motorcycle",
        "motorbike": "motorcycle",
        "bus": "bus",
        "truck": "truck",
    }
    numbers = {str(value): names[name] for name, value in number.items()}
    animals = {str(first_animal + i): "animal" for i in range(len(_ANIMALS))}
    others = {str(i): "unknown" for i in range(_COCO_NUMBERS)}
    return {**others, **names, **numbers, **animals, **dict.fromkeys(_ANIMALS, "animal")}


PRESETS: dict[str, dict[str, str]] = {
    "nuscenes": {
        "animal": "animal",
        "human.pedestrian": "pedestrian",
        "human.pedestrian.personal_mobility": "unknown",
        "vehicle.bicycle": "bicycle",
        "vehicle.bus": "bus",
        "vehicle.car": "car",
        "vehicle.construction": "truck",
        "vehicle.emergency.ambulance": "van",
        "vehicle.emergency.police": "car",
        "vehicle.motorcycle": "motorcycle",
        "vehicle.trailer": "trailer",
        "vehicle.truck": "truck",
        "vehicle.ego": "car",
        "construction_vehicle": "truck",
        "barrier": "unknown",
        "traffic_cone": "unknown",
        "movable_object": "unknown",
        "static_object": "unknown",
    },
    "coco": _coco(
        {"person": 0, "bicycle": 1, "car": 2, "motorcycle": 3, "bus": 5, "truck": 7}, 14
    ),
    "coco91": _coco(
        {"person": 1, "bicycle": 2, "car": 3, "motorcycle": 4, "bus": 6, "truck": 8}, 16
    ),
    "autoware": {
        **{str(number): AgentClass(number).name.lower() for number in range(9)},
        "hazard": "unknown",
        "over_drivable": "unknown",
        "under_drivable": "unknown",
    },
    "argoverse2": {
        "vehicle": "car",
        "pedestrian": "pedestrian",
        "motorcyclist": "motorcycle",
        "cyclist": "bicycle",
        "bus": "bus",
        "riderless_bicycle": "bicycle",
        "regular_vehicle": "car",
        "large_vehicle": "truck",
        "box_truck": "truck",
        "truck_cab": "truck",
        "vehicular_trailer": "trailer",
        "school_bus": "bus",
        "articulated_bus": "bus",
        "bicyclist": "bicycle",
        "official_signaler": "pedestrian",
        "stroller": "pedestrian",
        "wheelchair": "pedestrian",
        "dog": "animal",
        "wheeled_rider": "unknown",
        "wheeled_device": "unknown",
        "railed_vehicle": "unknown",
        "static": "unknown",
        "background": "unknown",
        "construction": "unknown",
        "unknown": "unknown",
    },
    "waymo": {
        "type_unset": "unknown",
        "type_vehicle": "car",
        "type_pedestrian": "pedestrian",
        "type_cyclist": "bicycle",
        "type_other": "unknown",
        "vehicle": "car",
        "0": "unknown",
        "1": "car",
        "2": "pedestrian",
        "3": "bicycle",
        "4": "unknown",
    },
}
"""Presets by name. ``coco`` has the 80 classes counted from 0, as detectors number them, and
``coco91`` the numbers of COCO's annotation files."""


@dataclass(frozen=True)
class ClassMap:
    """A map from names and numbers of classes to ours.

    Attributes:
        names: our class by the name or number of the data, as text.
    """

    names: Mapping[str, AgentClass]

    @cached_property
    def _by_name(self) -> dict[str, AgentClass]:
        return {_normal(name): value for name, value in self.names.items()}

    @cached_property
    def _has_numbers(self) -> bool:
        return any(name.isdigit() for name in self._by_name)

    def find(self, *names: str) -> AgentClass:
        """Return the class of the first name that has one, ``UNKNOWN`` if none has.

        A name that is not in the map means what it means without one; a number does so only if
        the map has no numbers.
        """
        for name in names:
            normal = _normal(name)
            found = self._listed(normal)
            if found is None:
                found = self._usual(normal)
            if found != AgentClass.UNKNOWN:
                return found
        return AgentClass.UNKNOWN

    def find_all(self, names: Sequence[Any]) -> ClassArray:
        """Return [n] uint8 classes of [n] names or numbers."""
        texts = [str(name) for name in names]
        known = {text: int(self.find(text)) for text in set(texts)}
        return np.array([known[text] for text in texts], dtype=np.uint8)

    def not_known(self, names: Iterable[Any]) -> list[str]:
        """Return the names that are neither in the map nor names of our classes."""
        texts = sorted({str(name) for name in names})
        return [
            text
            for text in texts
            if _normal(text) not in ("", "unknown", "0")
            and self._listed(_normal(text)) is None
            and self._usual(_normal(text)) == AgentClass.UNKNOWN
        ]

    def facts(self) -> dict[str, int]:
        """Return the map as JSON can write it."""
        return {name: int(value) for name, value in sorted(self._by_name.items())}

    def _listed(self, name: str) -> AgentClass | None:
        if len(name) > _LONGEST_NAME:
            return None  # Its beginnings alone would take time that grows with its square.
        while name:
            if name in self._by_name:
                return self._by_name[name]
            name = name.rpartition(".")[0]
        return None

    def _usual(self, name: str) -> AgentClass:
        if not (name.isascii() and name.isdigit()):
            return AgentClass.from_name(name)
        # At most two digits are compared: a number of any length must cost nothing.
        fits = not self._has_numbers and len(name) <= 2 and int(name) <= max(AgentClass)
        return AgentClass(int(name)) if fits else AgentClass.UNKNOWN


OWN_NAMES = ClassMap({})
"""Our own names and numbers."""


def class_map(name: str | Path) -> ClassMap:
    """Return a class map by the name of a preset or the path of a YAML file, our own for "".

    Raises:
        ConfigurationError: there is no such preset or file, or the file is not a class map.
    """
    text = str(name)
    if not text:
        return OWN_NAMES
    if text in PRESETS:
        return _of(PRESETS[text])
    path = user_path(text)
    if not os.path.isfile(path):
        raise ConfigurationError(
            f"class map {text!r} is neither a preset nor a file, expected one of "
            f"{listed(PRESETS)} or a YAML file"
        )
    return read_class_map(path)


def read_class_map(path: Path) -> ClassMap:
    """Return the class map in a YAML file.

    Raises:
        ConfigurationError: the file cannot be read, is not a mapping of names to classes, or
            names a class or preset that does not exist; the sentence names file and line.
    """
    names: dict[str, str] = {}
    preset: dict[str, str] = {}
    for line, key, value in _pairs(path):
        where = f"{path}, line {line}"
        if key == "preset":
            if value not in PRESETS:
                raise ConfigurationError(
                    f"{where}: the preset {value!r} is unknown, expected one of {listed(PRESETS)}"
                )
            if preset:
                raise ConfigurationError(f"{where}: a second preset {value!r}, expected one")
            preset = PRESETS[value]
            continue
        if value.lower() not in _CLASSES:
            raise ConfigurationError(
                f"{where}: the class {value!r} of {key!r} is unknown, expected one of "
                f"{listed(_CLASSES)}"
            )
        normal = _normal(key)
        if names.get(normal, value.lower()) != value.lower():
            raise ConfigurationError(
                f"{where}: {key!r} is given a second class, {value!r} after {names[normal]!r}"
            )
        names[normal] = value.lower()
    return _of({**preset, **names})


_CLASSES = {member.name.lower(): member for member in AgentClass}


def _of(names: Mapping[str, str]) -> ClassMap:
    return ClassMap({name: _CLASSES[value] for name, value in names.items()})


def _normal(name: str) -> str:
    """Return a name as it is compared; 1.0 is the number 1 where others were unknown.

    An umlaut is one character or two, which look the same; macOS writes two.
    """
    text = unicodedata.normalize("NFC", str(name).strip().lower())
    text = re.sub(r"[\s-]+", "_", text)
    return re.sub(r"^([0-9]+)\.0+$", r"\1", text)


def _pairs(path: Path) -> list[tuple[int, str, str]]:
    """Return line, key and value of a YAML mapping, both as they are written.

    The YAML nodes are read instead of the values, so that ``no`` stays a text, not a boolean, and
    ``007`` keeps its zeros.
    """
    node = read_yaml(path, "a class map in YAML", as_node=True)
    if getattr(node, "id", None) != "mapping":
        raise ConfigurationError(
            f"{path} is no mapping, expected lines such as 'vehicle.car: car'"
        )
    pairs = []
    for key, value in node.value:
        line = key.start_mark.line + 1
        for part in (key, value):
            if part.id != "scalar":
                raise ConfigurationError(
                    f"{path}, line {line}: a list or a mapping, expected a name or number and a "
                    "class, as in 'vehicle.car: car'"
                )
        pairs.append((line, str(key.value), str(value.value).strip()))
    return pairs
