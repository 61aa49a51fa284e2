# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Raw NGSIM trajectories as published by the US Department of Transportation.

One CSV file holds one or several sites and periods; each becomes a recording. Lengths are feet.
``Local_Y`` runs along the road and ``Local_X`` from its left edge to the right, both for the
middle of the front bumper. There is no heading, so it is the direction of the last displacement
of ``HEADING_STEP_M``, without a look at the future.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from mtpgo_core.errors import RecordingError
from mtpgo_core.schema import AgentClass, Float64Array
from mtpgo_training.data.readers.csv_table import read_header, read_table, sha256_of
from mtpgo_training.data.readers.drone_files import check_layout, existing_directory, select_names
from mtpgo_training.data.readers.reading_options import AS_USUAL, ReadingOptions
from mtpgo_training.data.readers.reading_unit import Unit
from mtpgo_training.data.recording import Int64Array, Recording

FOOT_M = 0.3048
"""An international foot (m)."""

FRAME_RATE = 10.0
"""Frame rate of the data set (Hz)."""

HEADING_STEP_M = 2.0
"""Displacement from which a heading is computed (m); chosen: several times the noise of the
positions."""

PERIOD_GAP_S = 60.0
"""A site without any vehicle for longer begins another recording (s); chosen."""

REUSE_GAP_S = 5.0
"""A vehicle number that returns after a longer absence is another vehicle (s); chosen, as numbers
are used again in later periods."""

_CLASSES = {1: AgentClass.MOTORCYCLE, 2: AgentClass.CAR, 3: AgentClass.TRUCK}
# Direction column of the arterials -> heading in the internal frame, whose x runs north there.
_DIRECTIONS = {1: -np.pi / 2, 2: 0.0, 3: np.pi / 2, 4: np.pi}
_INTEGERS = ("vehicle_id", "global_time", "v_class")
_NUMBERS = ("local_x", "local_y", "v_length", "v_width")


def ngsim_units(
    directory: Path, names: Sequence[str] | None = None, options: ReadingOptions = AS_USUAL
) -> list[Unit]:
    """Return the files in a directory of NGSIM files, or one such file.

    Recordings are named after the file, and after site and period where a file has several.

    Args:
        directory: a directory with ``.csv`` or ``.csv.gz`` files, or one file.
        names: names of the files wanted, without the suffix.
        options: the class map.

    Raises:
        RecordingError: no files.
    """
    if directory.is_file():
        paths = [directory]
    else:
        existing_directory(directory)
        paths = sorted(p for p in directory.iterdir() if p.name.endswith((".csv", ".csv.gz")))
        if not paths:
            raise RecordingError(f"{directory} has no recordings, expected NGSIM's .csv files")
    by_name = {path.name.split(".csv")[0]: path for path in paths}
    return [
        Unit(name, "ngsim", (by_name[name],), functools.partial(_read_file, name, by_name[name]))
        for name in select_names(list(by_name), names, directory)
    ]


def _read_file(name: str, path: Path) -> Iterator[Recording]:
    check_layout(path, "ngsim", ("ngsim",))
    # The capitals differ between the editions of the data.
    spelling = {column.lower(): column for column in read_header(path)}

    def spelled(wanted: Sequence[str]) -> list[str]:
        return [spelling.get(column, column) for column in wanted]

    table = read_table(
        path,
        integers=spelled(_INTEGERS),
        numbers=spelled(_NUMBERS),
        unknown_allowed=spelled(["direction", "v_vel"]),
        texts=spelled(["location"]),
        optional=spelled(["direction", "location", "v_vel"]),
    ).rename(columns=str.lower)
    if not len(table):
        raise RecordingError(f"{path} has no rows below its header")
    for column in ("direction", "v_vel"):
        if column not in table:
            table[column] = np.nan
    if "location" not in table:
        table["location"] = ""
    table["line"] = np.arange(len(table)) + 2
    # The large edition has some rows twice.
    wanted = [*_INTEGERS, *_NUMBERS, "direction", "v_vel", "location"]
    table = table.drop_duplicates(subset=wanted)
    sites = sorted(table["location"].fillna("").unique())
    sha256 = sha256_of([path])
    for site in sites:
        own = table[table["location"].fillna("") == site].sort_values(
            ["global_time", "vehicle_id"], kind="stable"
        )
        starts = own["global_time"].diff().to_numpy() > PERIOD_GAP_S * 1000
        period = np.cumsum(starts)
        for number in range(int(period[-1]) + 1):
            parts = [name]
            if len(sites) > 1:
                parts.append(str(site).strip() or "unknown")
            if period[-1] > 0:
                parts.append(str(number + 1))
            one = len(parts) == 1
            yield _recording(
                "-".join(parts),
                str(site),
                own[period == number],
                path,
                sha256 if one else f"{sha256}#{'-'.join(parts[1:])}",
            )


def _recording(
    name: str, location: str, table: pd.DataFrame, path: Path, sha256: str
) -> Recording:
    time_ms = table["global_time"].to_numpy(np.int64)
    frame = np.round((time_ms - time_ms[0]) * FRAME_RATE / 1000).astype(np.int64)
    vehicle = table["vehicle_id"].to_numpy(np.int64)
    track_id, track = _tracks(frame, vehicle)
    order = np.lexsort((track, frame))
    again = (np.diff(frame[order]) == 0) & (np.diff(track[order]) == 0)
    if again.any():
        row = order[int(np.argmax(again)) + 1]
        raise RecordingError(
            f"{path}, line {table['line'].iloc[row]}: vehicle {vehicle[row]} has a second row "
            f"for the time {time_ms[row]}"
        )
    table = table.iloc[order]
    frame, track = frame[order], track[order]
    # Feet to the right of the left edge, and along the road, to metres with y to the left.
    front = table[["local_y", "local_x"]].to_numpy(np.float64) * (FOOT_M, -FOOT_M)
    first = np.unique(track, return_index=True)[1]
    size = table[["v_length", "v_width"]].to_numpy(np.float64)[first] * FOOT_M
    yaw = _headings(front, track, table["direction"].to_numpy(np.float64))
    ahead = np.stack([np.cos(yaw), np.sin(yaw)], axis=1)
    speed = table["v_vel"].to_numpy(np.float64)[:, None] * FOOT_M
    classes = table["v_class"].to_numpy(np.int64)[first]
    return Recording(
        name=name,
        layout="ngsim",
        location=location,
        frame_rate=FRAME_RATE,
        frame=frame,
        track=track,
        position=front - np.nan_to_num(size[track, :1]) / 2 * ahead,
        velocity=speed * ahead,
        acceleration=np.full((len(frame), 2), np.nan),
        yaw=yaw,
        track_id=track_id,
        agent_class=np.array(
            [_CLASSES.get(int(value), AgentClass.UNKNOWN) for value in classes], dtype=np.uint8
        ),
        size=np.where(size > 0, size, np.nan),
        sha256=sha256,
        start_time_ns=int(time_ms[0]) * 10**6,
    )


def _tracks(frame: Int64Array, vehicle: Int64Array) -> tuple[Int64Array, Int64Array]:
    """Return track numbers [tracks] and indices [rows]; a number used again gets a new one."""
    order = np.lexsort((frame, vehicle))
    new = np.diff(vehicle[order], prepend=-1) != 0
    returned = ~new & (np.diff(frame[order], prepend=0) > REUSE_GAP_S * FRAME_RATE)
    number = vehicle.copy()
    if returned.any():
        fresh = np.cumsum(returned)
        # From its return on, until the next vehicle, a row belongs to the new number.
        group = np.where(new, 0, np.where(returned, fresh, -1))
        position = np.maximum.accumulate(np.where(group >= 0, np.arange(len(group)), 0))
        group = group[position]
        renamed = np.where(group > 0, vehicle.max() + group, vehicle[order])
        number[order] = renamed
    track_id, track = np.unique(number, return_inverse=True)
    return track_id, track.astype(np.int64)


def _headings(front: Float64Array, track: Int64Array, direction: Float64Array) -> Float64Array:
    """Return [rows] the direction of the last ``HEADING_STEP_M`` (rad), first that of the road."""
    yaw = np.array([_DIRECTIONS.get(int(d), 0.0) for d in np.nan_to_num(direction)])
    order = np.argsort(track, kind="stable")
    bounds = np.append(np.unique(track[order], return_index=True)[1], len(order)).tolist()
    for start, end in itertools.pairwise(bounds):
        rows = order[start:end]
        points = front[rows].tolist()
        anchor, heading = 0, float(yaw[rows[0]])
        for i, (x, y) in enumerate(points):
            # Move the anchor forward as long as the step from it stays long enough.
            while anchor < i and _far(points[anchor + 1], (x, y)):
                anchor += 1
            if _far(points[anchor], (x, y)):
                heading = float(np.arctan2(y - points[anchor][1], x - points[anchor][0]))
            yaw[rows[i]] = heading
    return yaw


def _far(a: Sequence[float], b: Sequence[float]) -> bool:
    return (b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2 >= HEADING_STEP_M**2
