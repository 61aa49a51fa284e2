# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A recording from a table with one row for each time and road user, in the internal frame."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd

from mtpgo_core.class_map import ClassMap
from mtpgo_core.errors import RecordingError
from mtpgo_core.frames import wrap
from mtpgo_core.identity import keys_from_texts
from mtpgo_core.schema import ClassArray, Float64Array, KeyArray
from mtpgo_training.data.readers.checks.reading_remarks import remark
from mtpgo_training.data.readers.csv_lines import line_in_file
from mtpgo_training.data.readers.reading_options import classes_of
from mtpgo_training.data.readers.tables.frame_grid import (
    TOLERANCE_S,
    frames_of_times,
    without_common_step,
)
from mtpgo_training.data.readers.tables.times_of_day import (
    DAY_S,
    after_midnight,
    midnight_in,
)
from mtpgo_training.data.recording import DEFAULT_START_NS, Int64Array, Recording

EPOCH_S = 1e8
"""Times from here on are seconds since 1970 (s), earlier ones count from some begin; chosen:
1973."""

LONGEST_S = 1e8
"""A longer recording (s) is a defect of its times; chosen: three years."""

LAST_S = float(2**31)
"""Times from here on do not fit the stamps of messages (s since 1970)."""

_WHOLE = re.compile(r"([0-9]{1,18})(?:\.0+)?")


@dataclass(frozen=True)
class TableSource:
    """What is known of a recording besides its rows.

    Attributes:
        name: name of the recording.
        layout: name of the layout.
        files: the files, to which the column ``file`` of the rows refers.
        sha256: hash over their contents.
        classes: our classes by the names in the rows.
        location: the site.
        frame_rate: frames per second (Hz) of rows with a column ``frame``.
        unit: what a row is in the files, for errors.
        unobserved: times (s) or frame numbers at which the files have rows that are no
            observations; they belong to the same frames.
    """

    name: str
    layout: str
    files: Sequence[Path]
    sha256: str
    classes: ClassMap
    location: str = ""
    frame_rate: float | None = None
    unit: str = "line"
    unobserved: Float64Array = field(default_factory=lambda: np.empty(0))

    def place_of(self, table: pd.DataFrame, row: int) -> str:
        """Return the file and the place in it that a row comes from.

        Args:
            table: the rows, see :func:`recording_of_rows`.
            row: index of the row.
        """
        path = self.files[int(table["file"].iloc[row]) if "file" in table else 0]
        number = int(table["line"].iloc[row])
        number = line_in_file(path, number) if self.unit == "line" else number
        return f"{path}, {self.unit} {number}"


def recording_of_rows(table: pd.DataFrame, source: TableSource) -> Recording:
    """Return the recording of a table.

    Args:
        table: in any order, with the columns ``track`` (number or text), ``time_s`` (s) or
            ``frame``, ``x``, ``y`` (m) and ``line`` (place in the file), and, where they are
            known, ``vx``, ``vy``, ``ax``, ``ay``, ``yaw`` (rad), ``length``, ``width`` (m; at or
            below zero is unknown), ``class`` (name or number) and ``file`` (number).
        source: what else is known.

    Raises:
        RecordingError: no rows, or a track has two rows for one time.
    """
    if not len(table):
        raise RecordingError(f"{source.files[0]} has no rows, expected at least one")
    frame, frame_rate, start_ns = _times(table, source)
    names, track = _tracks(table, source)
    order = np.lexsort((track, frame))
    again = (np.diff(frame[order]) == 0) & (np.diff(track[order]) == 0)
    if again.any():
        before, row = order[int(np.argmax(again)) :][:2].tolist()
        name = "time_s" if "time_s" in table else "frame"
        value, other = table[name].iloc[row], table[name].iloc[before]
        time = f"time {value:.10g} s" if name == "time_s" else f"frame {int(value)}"
        what = f"{source.place_of(table, row)}: track {names[track[row]]} has"
        if value != other:
            raise RecordingError(
                f"{what} rows {abs(value - other):.3g} s apart, expected at least {TOLERANCE_S:g} "
                "s; is the unit of the times another one?"
            )
        raise RecordingError(f"{what} a second row for {time}")
    numbers, key = _identities(names)
    yaw = table["yaw"].to_numpy(np.float64) if "yaw" in table else np.full(len(table), np.nan)
    _check_unit(yaw, source)
    return Recording(
        name=as_file_name(source.name),
        layout=source.layout,
        location=source.location,
        frame_rate=frame_rate,
        frame=frame[order],
        track=track[order],
        position=_pair(table, ("x", "y"))[order],
        velocity=_pair(table, ("vx", "vy"))[order],
        acceleration=_pair(table, ("ax", "ay"))[order],
        yaw=wrap(yaw[order]),
        track_id=numbers,
        agent_class=_classes(table, track, source),
        size=_sizes(_pair(table, ("length", "width")), track, len(names)),
        sha256=source.sha256,
        start_time_ns=start_ns,
        track_key=key,
    )


def _check_unit(yaw: Float64Array, source: TableSource) -> None:
    """Say that headings (rad) seem to be in degrees: half of them are more than a full turn."""
    known = np.abs(yaw[np.isfinite(yaw)])
    if len(known) and np.median(known) > 2.0 * np.pi:
        remark(
            f"{source.files[0]}: half of the headings are beyond {np.median(known):.5g} rad, more"
            " than a full turn; is their unit degrees?"
        )


def as_file_name(name: str) -> str:
    """Return the name of a recording, part of which is data, as one that a file may have.

    Recordings are written to files of their names: ``a/../../b`` must not be another folder.
    """
    return "".join(c if c.isprintable() and c not in "/\\" else "_" for c in name)


def with_ego(recording: Recording, name: str) -> Recording:
    """Return the recording with the track of this name as its ego, unchanged without one."""
    (track,) = recording.find_tracks(keys_from_texts([name]))
    if track < 0:
        return recording
    return dataclasses.replace(recording, ego_id=int(recording.track_id[track]))


def velocity_from_speed(speed: Float64Array, yaw: Float64Array) -> Float64Array:
    """Return [rows, 2] the velocity (m/s) of a speed along a heading (rad)."""
    return np.stack([speed * np.cos(yaw), speed * np.sin(yaw)], axis=1)


def _times(table: pd.DataFrame, source: TableSource) -> tuple[Int64Array, float, int]:
    """Return [rows] frame numbers, their rate (Hz), and the stamp of frame 0 (ns)."""
    if "time_s" in table:
        time_s = table["time_s"].to_numpy(np.float64)
        midnight_s = midnight_in(time_s, pd.factorize(table["track"])[0].astype(np.int64))
        if midnight_s is not None:
            remark(
                f"{source.files[0]}: the times begin again at 0 after {DAY_S:.0f} s, as times of"
                " day do at midnight: the rows after it are read as of the next day"
            )
        time_s = after_midnight(time_s, midnight_s)
        begin_s = float(time_s.min())
        _check_span(table, source, time_s - begin_s)
        if begin_s >= LAST_S:
            raise RecordingError(
                f"{source.files[0]}: the times begin at {begin_s:.6g} s, expected less than "
                f"{LAST_S:.6g} s; is their unit another one?"
            )
        unobserved_s = after_midnight(source.unobserved, midnight_s)
        frame, rate = frames_of_times(_with(time_s, unobserved_s))
        frame = frame[: len(time_s)]
        return frame, rate, round(begin_s * 1e9) if begin_s >= EPOCH_S else DEFAULT_START_NS
    assert source.frame_rate is not None, "rows with frames need a frame rate"
    frame = table["frame"].to_numpy(np.int64)
    _check_span(table, source, (frame.astype(np.float64) - float(frame[0])) / source.frame_rate)
    more = source.unobserved
    more = more[(more % 1 == 0) & (np.abs(more) < 2**53)].astype(np.int64)
    among, rate = without_common_step(_with(frame, more), source.frame_rate)
    frame = among[: len(frame)]
    # Stamps must stay within the time that a message can carry.
    begin = int(frame.min())
    return frame - (begin if begin < 0 or begin / rate > LONGEST_S else 0), rate, DEFAULT_START_NS


def _with(instants: np.ndarray, unobserved: np.ndarray) -> np.ndarray:
    """Return the instants of rows, and those between them at which nothing was observed."""
    between = (unobserved > instants.min()) & (unobserved < instants.max())
    return np.concatenate([instants, unobserved[between]])


def _check_span(table: pd.DataFrame, source: TableSource, elapsed_s: Float64Array) -> None:
    far = int(np.argmax(np.abs(elapsed_s)))
    if abs(elapsed_s[far]) > LONGEST_S:
        raise RecordingError(
            f"{source.place_of(table, far)}: {abs(elapsed_s[far]):.3g} s from other rows, "
            f"expected a recording of at most {LONGEST_S:.0e} s"
        )


def _tracks(table: pd.DataFrame, source: TableSource) -> tuple[list[str], Int64Array]:
    """Return the names of the tracks, and [rows] the track of each row."""
    column = table["track"]
    if column.dtype.kind == "i":
        numbers, track = np.unique(column.to_numpy(np.int64), return_inverse=True)
        return [str(number) for number in numbers.tolist()], track.astype(np.int64)
    codes, kept = pd.factorize(column.astype("string").fillna("").str.strip(), sort=True)
    track, names = codes.astype(np.int64), [str(name) for name in kept]
    if "" in names:
        place = source.place_of(table, int(np.argmax(track == names.index(""))))
        raise RecordingError(f"{place}: the road user has no name, expected a number or text")
    if _are_numbers(names):
        # 10 comes after 9, and 3.0 is 3.
        values = [int(name[1]) for name in map(_WHOLE.fullmatch, names) if name]
        numbers, again = np.unique(values, return_inverse=True)
        return [str(number) for number in numbers.tolist()], again[track].astype(np.int64)
    return names, track


def _are_numbers(names: Sequence[str]) -> bool:
    """Return whether names are whole numbers; where one has 1 and 01, these are two names."""
    found = [_WHOLE.fullmatch(name) for name in names]
    digits = {match[1] for match in found if match}
    return all(found) and len({int(text) for text in digits}) == len(digits)


def _identities(names: Sequence[str]) -> tuple[Int64Array, KeyArray | None]:
    """Return [tracks] numbers, and [tracks, 4] keys where the names are no numbers."""
    if _are_numbers(names):
        return np.array([int(name) for name in names], dtype=np.int64), None
    return np.arange(len(names), dtype=np.int64), keys_from_texts(names)


def _pair(table: pd.DataFrame, names: Sequence[str]) -> Float64Array:
    """Return [rows, 2] two columns, NaN where the table lacks one or a value of one is unknown."""
    if not set(names) <= set(table.columns):
        return np.full((len(table), 2), np.nan)
    values = table[list(names)].to_numpy(np.float64)
    return np.where(np.isfinite(values).all(axis=1)[:, None], values, np.nan)


def _classes(table: pd.DataFrame, track: Int64Array, source: TableSource) -> ClassArray:
    """Return [tracks] the last known class of each track."""
    out = np.zeros(int(track.max()) + 1, dtype=np.uint8)
    if "class" not in table:
        return out
    names = table["class"].astype("string").fillna("")
    found = np.zeros(len(table), dtype=np.uint8)
    file = table["file"].to_numpy(np.int64) if "file" in table else np.zeros_like(track)
    for number in np.unique(file).tolist():
        rows = file == number
        found[rows] = classes_of(names[rows].tolist(), source.classes, source.files[number])
    known = found > 0
    out[track[known]] = found[known]
    return out


def _sizes(size: Float64Array, track: Int64Array, count: int) -> Float64Array:
    """Return [tracks, 2] the median size of each track (m), NaN where it is unknown."""
    out = np.full((count, 2), np.nan)
    known = (size > 0).all(axis=1)
    if known.any():
        rows = pd.DataFrame(size[known]).groupby(track[known]).median()
        out[rows.index.to_numpy()] = rows.to_numpy(np.float64)
    return out
