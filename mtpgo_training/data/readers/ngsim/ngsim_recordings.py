# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Raw NGSIM trajectories as published by the US Department of Transportation.

One file holds one or several sites and periods; each becomes a recording. Lengths are feet.
``Local_Y`` runs along the road and ``Local_X`` from its left edge to the right, both for the
middle of the front bumper. There is no heading, so it is the direction of the last displacement
of ``HEADING_STEP_M``, without a look at the future.
"""

from __future__ import annotations

import functools
import itertools
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from mtpgo_core.class_map import ClassMap
from mtpgo_core.errors import RecordingError
from mtpgo_core.schema import LARGEST_SIZE_M, AgentClass, ClassArray, Float64Array
from mtpgo_training.data.readers.checks.foreign_files import without_foreign
from mtpgo_training.data.readers.csv_lines import line_in_file
from mtpgo_training.data.readers.csv_table import check_thousands, read_table
from mtpgo_training.data.readers.drone_files import (
    NoRecordingsError,
    check_layout,
    existing_directory,
    select_names,
    visible_files,
)
from mtpgo_training.data.readers.file_hash import sha256_of
from mtpgo_training.data.readers.ngsim.ngsim_forms import SUFFIXES, find_form, may_be_ngsim
from mtpgo_training.data.readers.reading_options import AS_USUAL, ReadingOptions
from mtpgo_training.data.readers.reading_unit import Unit
from mtpgo_training.data.readers.tables.track_rows import LAST_S
from mtpgo_training.data.recording import Int64Array, Recording

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

FASTEST_MPS = 60.0
"""A number that moves faster than this (m/s) is on another vehicle now; chosen above any vehicle
of the data."""

JUMP_M = 10.0
"""Error of a position that is no jump (m); chosen above that of the data."""

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
    Where the same name is there as ``.csv`` and as ``.txt``, the first is read.

    Args:
        directory: a directory with ``.csv`` or ``.txt`` files, also with ``.gz``, or one file.
        names: names of the files wanted, without the suffix.
        options: the class map.

    Raises:
        RecordingError: no files.
    """
    if directory.is_file():
        by_name = {_stem(directory): directory}
    else:
        existing_directory(directory)
        by_name = {}
        paths = visible_files(directory.iterdir(), directory)
        for suffix in SUFFIXES:
            for path in (path for path in paths if path.name.lower().endswith(suffix)):
                if not suffix.startswith(".txt") or may_be_ngsim(path):
                    by_name.setdefault(_stem(path), path)
        by_name = dict(sorted(by_name.items()))
        if not by_name:
            raise NoRecordingsError(
                f"{directory} has no recordings, expected NGSIM's .csv files or .txt files"
            )
    classes = options.classes if options.class_map else None
    read = functools.partial(_read_file, classes=classes)
    units = [
        Unit(name, "ngsim", (by_name[name],), functools.partial(read, name, by_name[name]))
        for name in select_names(list(by_name), names, directory)
    ]
    return units if names else without_foreign(units, may_be_ngsim)


def _stem(path: Path) -> str:
    return re.sub(r"\.(csv|txt)(\.gz)?$", "", path.name, flags=re.IGNORECASE)


def _read_file(name: str, path: Path, classes: ClassMap | None) -> Iterator[Recording]:
    """Yield the recordings of a file: one for each site and each period without a long gap."""
    table = _read_rows(path)
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
                classes,
                sha256 if one else f"{sha256}#{'-'.join(parts[1:])}",
            )


def _read_rows(path: Path) -> pd.DataFrame:
    """Return the rows of a file: lengths in m, times in ms, columns under their usual names.

    Raises:
        RecordingError: the file is not as it should be.
    """
    form = find_form(path)
    if form.csv.names is None:
        check_layout(path, "ngsim", ("ngsim",))
    check_thousands(path, form.csv)
    optional = ("total_frames", "direction", "v_vel", "location")
    table = read_table(
        path,
        integers=form.spelled(_INTEGERS),
        numbers=form.spelled(_NUMBERS),
        unknown_allowed=form.spelled(optional[:3]),
        texts=form.spelled(["location"]),
        optional=form.spelled(optional),
        form=form.csv,
    ).rename(columns={column: name for name, column in form.spelling.items()})
    if not len(table):
        raise RecordingError(f"{path} has no rows below its header")
    for column in optional[:3]:
        if column not in table:
            table[column] = np.nan
    if "location" not in table:
        table["location"] = ""
    lengths = ["local_x", "local_y", "v_length", "v_width", "v_vel"]
    table[lengths] = table[lengths] * form.unit_m
    length_m = float(table["v_length"].median())
    if form.csv.thousands is not None and length_m > LARGEST_SIZE_M:
        raise RecordingError(
            f"{path} has vehicles of {length_m:.0f} m length, expected {form.csv.thousands!r}"
            " between groups of three digits; is it the decimal mark?"
        )
    bad = ~table["global_time"].between(0, LAST_S * 1000).to_numpy(bool)
    if bad.any():
        row = int(np.argmax(bad))
        raise RecordingError(
            f"{path}, line {line_in_file(path, row + form.csv.first_line)}, column 'Global_Time': "
            f"{table['global_time'].iloc[row]}, expected milliseconds since 1970"
        )
    table["line"] = np.arange(len(table)) + form.csv.first_line
    # The large edition has some rows twice.
    wanted = [*_INTEGERS, *_NUMBERS, *optional]
    return table.drop_duplicates(subset=wanted)


def _recording(
    name: str,
    location: str,
    table: pd.DataFrame,
    path: Path,
    class_map: ClassMap | None,
    sha256: str,
) -> Recording:
    time_ms = table["global_time"].to_numpy(np.int64)
    frame = np.round((time_ms - time_ms[0]) * FRAME_RATE / 1000).astype(np.int64)
    vehicle = table["vehicle_id"].to_numpy(np.int64)
    # To the right of the left edge, and along the road, to y to the left.
    front = table[["local_y", "local_x"]].to_numpy(np.float64) * (1.0, -1.0)
    total = table["total_frames"].fillna(0.0).to_numpy(np.float64)
    group = _vehicles(frame, vehicle, total)
    order = np.lexsort((group, frame))
    again = (np.diff(frame[order]) == 0) & (np.diff(group[order]) == 0)
    if again.any():
        before, row = order[int(np.argmax(again)) :][:2].tolist()
        line = line_in_file(path, int(table["line"].iloc[row]))
        what = f"{path}, line {line}: vehicle {vehicle[row]} has"
        if time_ms[row] != time_ms[before]:
            raise RecordingError(
                f"{what} rows {abs(time_ms[row] - time_ms[before])} ms apart, expected"
                f" {1000 / FRAME_RATE:g} ms as in NGSIM"
            )
        raise RecordingError(f"{what} a second row for the time {time_ms[row]}")
    track_id, track = _tracks(frame, vehicle, group, front)
    order = np.lexsort((track, frame))
    table = table.iloc[order]
    frame, track, front = frame[order], track[order], front[order]
    first = np.unique(track, return_index=True)[1]
    size = table[["v_length", "v_width"]].to_numpy(np.float64)[first]
    yaw = _headings(front, track, table["direction"].to_numpy(np.float64))
    ahead = np.stack([np.cos(yaw), np.sin(yaw)], axis=1)
    speed = table["v_vel"].to_numpy(np.float64)[:, None]
    numbers = table["v_class"].to_numpy(np.int64)[first].tolist()
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
        agent_class=_agent_classes(numbers, class_map),
        size=np.where(size > 0, size, np.nan),
        sha256=sha256,
        start_time_ns=int(time_ms[0]) * 10**6,
    )


def _agent_classes(numbers: Sequence[int], class_map: ClassMap | None) -> ClassArray:
    if class_map is not None:
        return class_map.find_all(numbers)
    found = [_CLASSES.get(number, AgentClass.UNKNOWN) for number in numbers]
    return np.array(found, dtype=np.uint8)


def _vehicles(frame: Int64Array, vehicle: Int64Array, total: Float64Array) -> Int64Array:
    """Return [rows] a number for each vehicle at a time.

    The periods of a site number their vehicles anew. So a vehicle number that is given twice at a
    time belongs to two vehicles, which differ in the number of their frames (``total``).
    """
    pairs, rows = np.unique(np.stack([vehicle, frame], axis=1), axis=0, return_counts=True)
    shared = np.isin(vehicle, pairs[rows > 1, 0])
    names = np.stack([vehicle, np.where(shared, total, 0.0)], axis=1)
    return np.unique(names, axis=0, return_inverse=True)[1].astype(np.int64)


def _tracks(
    frame: Int64Array, vehicle: Int64Array, group: Int64Array, front: Float64Array
) -> tuple[Int64Array, Int64Array]:
    """Return track numbers [tracks] and indices [rows]; a number used again gets a new one.

    A vehicle number that comes back after a pause or a jump is on another vehicle.
    """
    order = np.lexsort((frame, group))
    gap_s = np.diff(frame[order], prepend=0) / FRAME_RATE
    moved = np.linalg.norm(np.diff(front[order], axis=0, prepend=front[order][:1]), axis=1)
    begins = np.diff(group[order], prepend=-1) != 0
    begins |= (gap_s > REUSE_GAP_S) | (moved > FASTEST_MPS * gap_s + JUMP_M)
    # The first piece of a number keeps it.
    owner = vehicle[order][begins]
    again = np.ones(len(owner), dtype=np.bool_)
    again[np.unique(owner, return_index=True)[1]] = False
    numbers = np.where(again, vehicle.max() + np.cumsum(again), owner)
    number = np.empty_like(vehicle)
    number[order] = numbers[np.cumsum(begins) - 1]
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
