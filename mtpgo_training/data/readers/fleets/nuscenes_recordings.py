# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""nuScenes: annotated boxes at two samples a second, from its JSON tables.

Positions are metres on the city's map with y up. Sizes are width, length, height and orientations
quaternions w, x, y, z. The vehicle that records is the track ``ego``. Cones, barriers and other
objects that never move are left out. Velocities are not given.
"""

from __future__ import annotations

import dataclasses
import functools
import json
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from msg_adapters.conversions import yaw_from_quaternions
from mtpgo_core.class_map import ClassMap
from mtpgo_core.errors import RecordingError, found_names
from mtpgo_core.options import is_unicode
from mtpgo_training.data.readers.checks.reading_remarks import remark
from mtpgo_training.data.readers.drone_files import NoRecordingsError, existing_directory
from mtpgo_training.data.readers.file_hash import sha256_of
from mtpgo_training.data.readers.reading_options import ReadingOptions
from mtpgo_training.data.readers.reading_unit import Unit
from mtpgo_training.data.readers.tables.track_rows import (
    TableSource,
    recording_of_rows,
    with_ego,
)
from mtpgo_training.data.recording import Recording

EGO_SIZE_M = (4.084, 1.73)
"""Length and width of the recording vehicle, a Renault Zoe (m; its data sheet)."""

_TABLES = ("scene", "log", "sample", "instance", "category", "sample_annotation", "ego_pose")
_NO_ROAD_USERS = ("movable_object", "static_object")
_VECTORS = ("translation", "rotation", "size")
_BETWEEN = re.compile(r"[\s,]*")
_LONGEST_RECORD = 1 << 24
"""Characters of the longest record that is read; chosen far above those of the data set."""

_MOST_SCENES = 5
"""Scenes that a sentence lists; chosen."""

_AT_ONCE = 1 << 20
"""Characters of a table read at a time; chosen, as the tables are larger than the memory."""


def nuscenes_units(
    directory: Path, names: Sequence[str] | None, options: ReadingOptions
) -> list[Unit]:
    """Return the versions of nuScenes in a directory; each holds its scenes.

    Args:
        directory: the data set's root with ``v1.0-mini`` or others, or one of these folders.
        names: versions or scenes wanted, ``v1.0-mini``, ``scene-0061`` or both joined by ``-``.
        options: the class map.

    Raises:
        RecordingError: no tables there, one is missing, or there is no such scene.
    """
    existing_directory(directory)
    versions = [
        folder
        for folder in (directory, *sorted(directory.glob("v1.0-*")))
        if (folder / "sample_annotation.json").is_file()
    ]
    if not versions:
        raise NoRecordingsError(
            f"{directory} has no recordings, expected nuScenes' folder v1.0-... with "
            "sample_annotation.json"
        )
    classes = options.classes_or("nuscenes")
    units, left, remarks = [], set(names or ()), []
    scenes_in = {folder: _scenes(folder) for folder in versions}
    there = [scene for scenes in scenes_in.values() for scene in scenes]
    # Those of v1.0-mini are in v1.0-trainval as well: the version with most scenes counts last.
    ordered = sorted(scenes_in, key=lambda folder: len(scenes_in[folder]))
    home = {scene: folder for folder in ordered for scene in scenes_in[folder]}
    for folder, scenes in scenes_in.items():
        version = folder.resolve().name
        wanted = []
        for scene in scenes:
            if {version, f"{version}-{scene}"} & left or (
                home[scene] == folder and (not names or scene in names)
            ):
                wanted.append(scene)
        others = [scene for scene in scenes if home[scene] != folder]
        if others and not names:
            other = found_names(sorted({home[scene].resolve().name for scene in others}))
            remarks.append(
                f"{folder}: {len(others)} of its {len(scenes)} scenes are in {other} too, and are"
                " read from there"
            )
        if wanted:
            units.append(
                Unit(
                    version,
                    "nuscenes",
                    tuple(folder / f"{table}.json" for table in _TABLES),
                    functools.partial(_read, folder, version, wanted, classes),
                    {"scenes": wanted},
                )
            )
    left -= {name for f, all_ in scenes_in.items() for name in _names_of(f, all_)}
    if left:
        raise RecordingError(
            f"{directory} has no scene {sorted(left)[0]!r}, it has "
            f"{found_names(there, _MOST_SCENES)}"
        )
    if units:
        units[0] = dataclasses.replace(units[0], remarks=remarks)
    return units


def _scenes(folder: Path) -> list[str]:
    """Return the names of a version's scenes; all of its tables must be there."""
    for table in _TABLES:
        if not (folder / f"{table}.json").is_file():
            raise RecordingError(f"{folder / table}.json is missing, it belongs to nuScenes")
    return [str(row.get("name")) for row in _objects(folder / "scene.json")]


def _names_of(folder: Path, scenes: Sequence[str]) -> set[str]:
    """Return the names by which a version and its scenes can be asked for."""
    version = folder.resolve().name
    return {version, *scenes, *(f"{version}-{scene}" for scene in scenes)}


def _read(
    folder: Path, version: str, wanted: Sequence[str], classes: ClassMap
) -> Iterator[Recording]:
    """Yield the scenes of a version."""
    place = {row["token"]: row["location"] for row in _rows(folder, "log", ("token", "location"))}
    scenes = {
        row["token"]: row
        for row in _rows(folder, "scene", ("token", "name", "log_token"))
        if row["name"] in wanted
    }
    samples = {
        row["token"]: row
        for row in _rows(folder, "sample", ("token", "scene_token", "timestamp"))
        if row["scene_token"] in scenes
    }
    ego = _ego(folder, samples)
    table = pd.DataFrame(_annotations(folder, samples) + ego)
    if len(ego) < len(samples):
        remark(
            f"{folder / 'ego_pose.json'}: {len(samples) - len(ego)} of {len(samples)} samples have"
            " no pose of the recording vehicle at their time"
        )
    if len(table):
        quaternion = table[["qx", "qy", "qz", "qw"]].to_numpy(np.float64)
        table["yaw"] = yaw_from_quaternions(quaternion)
    files = tuple(folder / f"{name}.json" for name in _TABLES)
    sha256 = sha256_of(files)
    by_scene = dict(list(table.groupby("scene"))) if len(table) else {}
    for token, scene in sorted(scenes.items(), key=lambda item: str(item[1]["name"])):
        if token not in by_scene:
            remark(f"{folder}: {scene['name']} has no road user and no pose, it is left out")
            continue
        source = TableSource(
            name=f"{version}-{scene['name']}",
            layout="nuscenes",
            files=(folder / "sample_annotation.json", folder / "ego_pose.json"),
            sha256=f"{sha256}#{scene['name']}",
            classes=classes,
            location=str(place.get(scene["log_token"], "")),
            unit="record",
        )
        yield with_ego(recording_of_rows(by_scene[token], source), "ego")


def _annotations(folder: Path, samples: Mapping[str, Any]) -> list[dict[str, Any]]:
    category = {row["token"]: row["name"] for row in _rows(folder, "category", ("token", "name"))}
    kind = {
        row["token"]: _found(category, row["category_token"], folder, "instance", "category", i)
        for i, row in enumerate(_rows(folder, "instance", ("token", "category_token")), start=1)
    }
    fields = ("sample_token", "instance_token", "translation", "size", "rotation")
    rows = []
    for number, row in enumerate(_rows(folder, "sample_annotation", fields), start=1):
        if row["sample_token"] not in samples:
            continue
        token = row["instance_token"]
        name = _found(kind, token, folder, "sample_annotation", "instance", number)
        if name.startswith(_NO_ROAD_USERS):
            continue
        where = f"{folder / 'sample_annotation.json'}, record {number}"
        x, y, _ = _floats(row, "translation", 3, where)
        width, length, _ = _floats(row, "size", 3, where)
        sample = samples[row["sample_token"]]
        rows.append(
            {
                "scene": sample["scene_token"],
                "track": token,
                "time_s": sample["timestamp"] / 1e6,
                "x": x,
                "y": y,
                **_quaternion(row, where),
                "length": length,
                "width": width,
                "class": name,
                "line": number,
                "file": 0,
            }
        )
    return rows


def _ego(folder: Path, samples: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the rows of the recording vehicle at the times of the samples."""
    scene_at = {row["timestamp"]: row["scene_token"] for row in samples.values()}
    found: dict[Any, dict[str, Any]] = {}
    fields = ("timestamp", "translation", "rotation")
    for number, row in enumerate(_rows(folder, "ego_pose", fields), start=1):
        time = row["timestamp"]
        if time not in scene_at or time in found:
            continue
        where = f"{folder / 'ego_pose.json'}, record {number}"
        x, y, _ = _floats(row, "translation", 3, where)
        found[time] = {
            "scene": scene_at[time],
            "track": "ego",
            "time_s": time / 1e6,
            "x": x,
            "y": y,
            **_quaternion(row, where),
            "length": EGO_SIZE_M[0],
            "width": EGO_SIZE_M[1],
            "class": "vehicle.ego",
            "line": number,
            "file": 1,
        }
    return list(found.values())


def _rows(folder: Path, table: str, fields: Sequence[str]) -> Iterator[dict[str, Any]]:
    """Yield the records of a table, each with the fields, of which all but vectors are checked."""
    path = folder / f"{table}.json"
    for number, row in enumerate(_objects(path), start=1):
        for name in fields:
            where = f"{path}, record {number}"
            if name not in row:
                raise RecordingError(f"{where} has no field {name!r}")
            if name == "timestamp":
                row[name] = int(_numbers([row[name]], name, 1, where)[0])
            elif name not in _VECTORS and not (
                isinstance(row[name], str) and is_unicode(row[name])
            ):
                raise RecordingError(f"{where}: {name} is {row[name]!r:.60}, expected text")
        yield row


def _objects(path: Path) -> Iterator[dict[str, Any]]:
    """Yield the objects of a JSON list one after the other, without the whole file in memory."""
    decoder = json.JSONDecoder()
    try:
        with path.open(encoding="utf-8-sig") as stream:
            text = stream.read(_AT_ONCE).lstrip()
            if not text.startswith("["):
                raise RecordingError(f"{path} is no JSON list, expected a table of nuScenes")
            place = 1
            while True:
                begin = _BETWEEN.match(text, place)
                place = begin.end() if begin else place
                if text[place : place + 1] == "]":
                    return
                try:
                    row, place = decoder.raw_decode(text, place)
                except json.JSONDecodeError as error:
                    more = stream.read(max(_AT_ONCE, len(text) - place))
                    if not more or len(text) - place > _LONGEST_RECORD:
                        # Some sentences of the library end in "at", before a place in a part.
                        what = error.msg.removesuffix(" at").removesuffix(" starting")
                        raise RecordingError(
                            f"{path} cannot be read as JSON: {what}"
                            + ("" if more else ", the file may be truncated")
                        ) from error
                    text, place = text[place:] + more, 0
                    continue
                if not isinstance(row, dict):
                    raise RecordingError(f"{path} has {row!r:.40}, expected records with fields")
                yield row
    except (OSError, ValueError, RecursionError) as error:
        reason = error.strerror if isinstance(error, OSError) else type(error).__name__
        if isinstance(error, UnicodeDecodeError):
            reason = "it is not text in UTF-8"
        raise RecordingError(f"{path} cannot be read as JSON: {reason}") from error


def _floats(row: Mapping[str, Any], name: str, count: int, where: str) -> list[float]:
    return _numbers(row[name], name, count, where)


def _numbers(values: Any, name: str, count: int, where: str) -> list[float]:
    """Return a list of finite numbers.

    Raises:
        RecordingError: it is another thing.
    """
    try:
        if isinstance(values, list) and len(values) == count:
            numbers = [float(v) for v in values if isinstance(v, int | float)]
            if len(numbers) == count and all(map(math.isfinite, numbers)):
                return numbers
    except OverflowError:
        pass
    raise RecordingError(f"{where}: {name} is {values!r:.60}, expected finite numbers ({count})")


def _quaternion(row: Mapping[str, Any], where: str) -> dict[str, float]:
    return dict(zip(("qw", "qx", "qy", "qz"), _floats(row, "rotation", 4, where), strict=True))


def _found(
    names: Mapping[str, str], token: str, folder: Path, table: str, other: str, number: int
) -> str:
    """Return the name of a token of another table.

    Raises:
        RecordingError: that table has no such token.
    """
    if token not in names:
        raise RecordingError(
            f"{folder / table}.json, record {number}: {other}_token is {token!r:.60}, which"
            f" {other}.json has not"
        )
    return names[token]
