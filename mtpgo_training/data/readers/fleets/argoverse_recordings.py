# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Argoverse 2: scenarios of the forecasting set, and logs of the sensor set.

A scenario is a Parquet file at 10 Hz with positions, velocities and headings in the city's frame,
without sizes. A log has boxes in the frame of the recording vehicle, which ``annotations.feather``
and ``city_SE3_egovehicle.feather`` bring into the city's frame; it has no velocities. Both have y
up. The recording vehicle is the track ``AV``. Objects that never move are left out.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from msg_adapters.conversions import yaw_from_quaternions
from mtpgo_core.class_map import ClassMap
from mtpgo_core.errors import RecordingError
from mtpgo_core.frames import rotate
from mtpgo_core.schema import Float64Array
from mtpgo_training.data.readers.csv_table import check_columns, require_columns
from mtpgo_training.data.readers.drone_files import (
    NoRecordingsError,
    existing_directory,
    files_below,
    select_names,
)
from mtpgo_training.data.readers.file_hash import sha256_of
from mtpgo_training.data.readers.reading_options import ReadingOptions
from mtpgo_training.data.readers.reading_unit import Unit
from mtpgo_training.data.readers.tables.parquet_file import (
    parquet_columns,
    read_feather,
    read_parquet,
)
from mtpgo_training.data.readers.tables.track_rows import (
    TableSource,
    recording_of_rows,
    with_ego,
)
from mtpgo_training.data.recording import Recording

FRAME_RATE = 10.0
"""Timesteps per second of a scenario (Hz)."""

_NUMBERS = ("position_x", "position_y", "heading", "velocity_x", "velocity_y")
_TEXTS = ("track_id", "object_type")
_NO_ROAD_USERS = (
    "static",
    "background",
    "construction",
    "bollard",
    "construction_barrel",
    "construction_cone",
    "mobile_pedestrian_crossing_sign",
    "sign",
    "stop_sign",
    "message_board_trailer",
    "traffic_light_trailer",
)
_SCENARIO = re.compile(r"scenario_(?P<name>.+)\.parquet", re.IGNORECASE)
_ANNOTATIONS, _POSES = "annotations.feather", "city_SE3_egovehicle.feather"


def argoverse_units(
    directory: Path, names: Sequence[str] | None, options: ReadingOptions
) -> list[Unit]:
    """Return the scenarios and logs of Argoverse 2 below a directory.

    Args:
        directory: a directory with ``scenario_ID.parquet`` or folders of logs, or one scenario.
        names: identifiers of those wanted.
        options: the class map.

    Raises:
        RecordingError: there are none.
    """
    classes = options.classes_or("argoverse2")
    if directory.is_file():
        paths = [directory]
    else:
        existing_directory(directory)
        paths = [
            path
            for path in files_below(directory)
            if path.name.lower() == _ANNOTATIONS or _SCENARIO.fullmatch(path.name)
        ]
    units: dict[str, Unit] = {}
    for path in paths:
        files: tuple[Path, ...] = (path,)
        if path.name.lower() == _ANNOTATIONS:
            name, files = path.resolve().parent.name, (path, _poses_beside(path))
            read = functools.partial(_read_log, name, files[0], files[1], classes)
        else:
            match = _SCENARIO.fullmatch(path.name)
            name = match["name"] if match else path.stem
            read = functools.partial(_read_scenario, name, path, classes)
        if name in units:
            raise RecordingError(
                f"{directory} has two recordings {name!r}, {units[name].files[0]} and {path}, "
                "expected one"
            )
        units[name] = Unit(name, "argoverse2", files, read)
    if not units:
        raise NoRecordingsError(
            f"{directory} has no recordings, expected Argoverse 2's scenario_*.parquet or logs "
            f"with {_ANNOTATIONS}"
        )
    return [units[name] for name in select_names(list(units), names, directory)]


def _read_scenario(name: str, path: Path, classes: ClassMap) -> Iterator[Recording]:
    columns = [*_TEXTS, "timestep", *_NUMBERS]
    header = parquet_columns(path)
    require_columns(path, header, columns, columns)
    table = read_parquet(path, [*columns, *(c for c in ("city", "scenario_id") if c in header)])
    if "scenario_id" in table and table["scenario_id"].nunique() > 1:
        first, second = table["scenario_id"].drop_duplicates().iloc[:2]
        raise RecordingError(
            f"{path} has several scenarios, {first!r:.60} and {second!r:.60}, expected one in each"
            " file"
        )
    check_columns(
        table,
        path,
        integers=("timestep",),
        numbers=_NUMBERS[:2],
        unknown_allowed=_NUMBERS[2:],
        first_line=1,
        unit="row",
    )
    location = str(table["city"].iloc[0]) if "city" in table and len(table) else ""
    table = table.rename(
        columns={
            "track_id": "track",
            "object_type": "class",
            "timestep": "frame",
            "position_x": "x",
            "position_y": "y",
            "heading": "yaw",
            "velocity_x": "vx",
            "velocity_y": "vy",
        }
    )
    yield _recording(table, name, (path,), classes, location)


def _poses_beside(path: Path) -> Path:
    """Return the file with the poses of the recording vehicle beside that of the boxes."""
    exact = path.with_name(_POSES)
    alike = (one for one in path.parent.iterdir() if one.name.lower() == _POSES.lower())
    return exact if exact.is_file() else next(alike, exact)


def _read_log(name: str, path: Path, poses_path: Path, classes: ClassMap) -> Iterator[Recording]:
    if not poses_path.is_file():
        raise RecordingError(f"{poses_path} is missing, it belongs to {path.name}")
    boxes = _feather(path, ("length_m", "width_m"), ("track_uuid", "category"))
    poses = _feather(poses_path, (), ())
    pose = poses.drop_duplicates("timestamp_ns").set_index("timestamp_ns")
    missing = ~boxes["timestamp_ns"].isin(pose.index).to_numpy(bool)
    if missing.any():
        row = int(np.argmax(missing))
        raise RecordingError(
            f"{path}, row {row + 1}: {poses_path.name} has no pose of the time "
            f"{boxes['timestamp_ns'].iloc[row]} ns"
        )
    without = np.isnan(_yaw(poses))
    if without.any():
        raise RecordingError(
            f"{poses_path}, row {int(np.argmax(without)) + 1}: the quaternion has no yaw, expected"
            " the orientation of the recording vehicle"
        )
    own = pose.loc[boxes["timestamp_ns"]]
    turn = _yaw(own)
    place = rotate(boxes[["tx_m", "ty_m"]].to_numpy(np.float64), turn)
    place = place + own[["tx_m", "ty_m"]].to_numpy(np.float64)
    table = pd.DataFrame(
        {
            "track": boxes["track_uuid"].astype("string"),
            "class": boxes["category"].astype("string"),
            "time_s": boxes["timestamp_ns"] / 1e9,
            "x": place[:, 0],
            "y": place[:, 1],
            "yaw": _yaw(boxes) + turn,
            "length": boxes["length_m"],
            "width": boxes["width_m"],
        }
    )
    at = pose.loc[boxes["timestamp_ns"].unique()]
    ego = pd.DataFrame(
        {
            "track": "AV",
            "class": "vehicle",
            "time_s": at.index.to_numpy() / 1e9,
            "x": at["tx_m"].to_numpy(),
            "y": at["ty_m"].to_numpy(),
            "yaw": _yaw(at),
            "length": np.nan,
            "width": np.nan,
        }
    )
    table = pd.concat([table, ego], ignore_index=True)
    yield _recording(table, name, (path, poses_path), classes, "")


def _recording(
    table: pd.DataFrame, name: str, files: Sequence[Path], classes: ClassMap, location: str
) -> Recording:
    table["line"] = np.arange(len(table)) + 1
    kind = table["class"].astype("string").str.lower()
    source = TableSource(
        name=name,
        layout="argoverse2",
        files=files,
        sha256=sha256_of(files),
        classes=classes,
        location=location,
        frame_rate=FRAME_RATE,
        unit="row",
    )
    users = table[~kind.isin(_NO_ROAD_USERS)]
    if len(table) and not len(users):
        raise RecordingError(
            f"{files[0]} has no road user: all of its {len(table)} rows are objects that never"
            " move"
        )
    return with_ego(recording_of_rows(users, source), "AV")


def _feather(path: Path, numbers: Sequence[str], texts: Sequence[str]) -> pd.DataFrame:
    place = ("tx_m", "ty_m", "qw", "qx", "qy", "qz", *numbers)
    columns = ["timestamp_ns", *place, *texts]
    table = read_feather(path)
    require_columns(path, [str(name) for name in table.columns], columns, columns)
    table = table[columns].copy()
    check_columns(table, path, integers=("timestamp_ns",), numbers=place, first_line=1, unit="row")
    return table


def _yaw(table: pd.DataFrame) -> Float64Array:
    """Return [rows] the yaw of quaternions (rad), NaN where they have none."""
    return yaw_from_quaternions(table[["qx", "qy", "qz", "qw"]].to_numpy(np.float64))
