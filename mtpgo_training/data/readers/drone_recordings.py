# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Reading of inD, rounD, uniD, exiD and highD recordings into the internal frame.

inD, rounD, uniD and exiD already have the box centre, y up and counter-clockwise headings in
degrees. highD has the upper-left corner of the box, y down, and calls the length ``width``.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from mtpgo_core.class_map import OWN_NAMES, ClassMap
from mtpgo_core.errors import RecordingError
from mtpgo_core.maps.lane_file import read_lane_file
from mtpgo_core.maps.lane_file_options import LOCAL, LaneFileOptions
from mtpgo_core.schema import Float64Array
from mtpgo_training.data.readers.checks.reading_remarks import remark
from mtpgo_training.data.readers.csv_lines import line_in_file
from mtpgo_training.data.readers.csv_table import read_header, read_table
from mtpgo_training.data.readers.drone_files import (
    DroneFiles,
    check_layout,
    find_drone_files,
    missing_tracks,
)
from mtpgo_training.data.readers.file_hash import sha256_of
from mtpgo_training.data.readers.reading_options import ReadingOptions, classes_of
from mtpgo_training.data.readers.reading_unit import Unit
from mtpgo_training.data.readers.tables.track_rows import LONGEST_S
from mtpgo_training.data.recording import Recording, first_and_last

HEADING_SPEED_MPS = 2.0
"""Below this forward speed a highD vehicle's heading turns towards its driving direction (m/s);
chosen: the lateral noise of slower vehicles would turn them."""


_MOTION = ("xVelocity", "yVelocity", "xAcceleration", "yAcceleration")
"""Columns of the motion; recordings of positions alone have none of them."""

_WHOSE = ("recordingId",)
"""Column with the number of the recording, which some files have."""

_SPAN = ("initialFrame", "finalFrame")
"""Columns of tracksMeta with the first and last frame of a track."""


@dataclass(frozen=True)
class _Rows:
    """The rows of a tracks file in the internal frame, in the file's order; [rows, ...] each."""

    frame: np.ndarray
    track_id: np.ndarray
    position: Float64Array
    velocity: Float64Array
    acceleration: Float64Array
    yaw: Float64Array


def read_ind(files: DroneFiles, classes: ClassMap = OWN_NAMES, layout: str = "ind") -> Recording:
    """Read one recording of the inD family (inD, rounD, uniD, exiD).

    Args:
        files: its three files.
        classes: our classes by the names in tracksMeta.
        layout: ``ind``, ``round``, ``unid`` or ``exid``.

    Raises:
        RecordingError: a defect of the files.
    """
    check_layout(files.tracks, layout, ("exid",) if layout == "exid" else ("ind",))
    positions_only = not set(_MOTION) & set(read_header(files.tracks))
    table = read_table(
        files.tracks,
        integers=("trackId", "frame"),
        numbers=("xCenter", "yCenter"),
        unknown_allowed=("heading", *_MOTION, "length", "width"),
        unchecked=_WHOSE,
        optional=("length", "width", *_WHOSE, *(("heading", *_MOTION) if positions_only else ())),
    )
    table = _with_unknown(table, ("heading", *_MOTION))
    meta = _tracks_meta(files.tracks_meta, "trackId", ("width", "length"))
    rows = _Rows(
        frame=table["frame"].to_numpy(np.int64),
        track_id=table["trackId"].to_numpy(np.int64),
        position=table[["xCenter", "yCenter"]].to_numpy(np.float64),
        velocity=table[["xVelocity", "yVelocity"]].to_numpy(np.float64),
        acceleration=table[["xAcceleration", "yAcceleration"]].to_numpy(np.float64),
        yaw=wrap_angle(np.radians(table["heading"].to_numpy(np.float64))),
    )
    size = _sizes(table, meta)
    general, frame_rate = _recording_meta(files.recording_meta)
    _check_one_recording(files, (table, meta, general.to_frame().T))
    lanes: tuple[Float64Array, ...] = ()
    if files.lanes is not None:
        lanes = read_lane_file(files.lanes, LaneFileOptions(LOCAL)).lines
    return _assemble(files, layout, rows, meta, size, general, frame_rate, lanes, classes)


def read_highd(files: DroneFiles, classes: ClassMap = OWN_NAMES) -> Recording:
    """Read one highD recording.

    The lane markings become polylines along the direction of travel, over the observed section.

    Raises:
        RecordingError: a defect of the files.
    """
    check_layout(files.tracks, "highd", ("highd",))
    table = read_table(
        files.tracks,
        integers=("frame", "id"),
        numbers=("x", "y", "width", "height"),
        unknown_allowed=_MOTION,
    )
    meta = _tracks_meta(files.tracks_meta, "id", ("width", "height"), "drivingDirection")
    _check_directions(files.tracks_meta, meta)
    track_id = table["id"].to_numpy(np.int64)
    _check_known(files, track_id, meta["id"].to_numpy(np.int64))
    direction = meta.set_index("id")["drivingDirection"].reindex(track_id).to_numpy(np.int64)
    corner = table[["x", "y"]].to_numpy(np.float64)
    extent = table[["width", "height"]].to_numpy(np.float64)
    up = np.array([1.0, -1.0])
    velocity = table[["xVelocity", "yVelocity"]].to_numpy(np.float64) * up
    rows = _Rows(
        frame=table["frame"].to_numpy(np.int64),
        track_id=track_id,
        position=(corner + extent / 2) * up,
        velocity=velocity,
        acceleration=table[["xAcceleration", "yAcceleration"]].to_numpy(np.float64) * up,
        yaw=_driving_heading(velocity, direction),
    )
    size = meta[["width", "height"]].to_numpy(np.float64)
    general, frame_rate = _recording_meta(
        files.recording_meta, "upperLaneMarkings", "lowerLaneMarkings"
    )
    x = corner[:, 0]
    span = (float(x.min()), float((x + extent[:, 0]).max())) if len(table) else (0.0, 0.0)
    lanes = _lanes(files.recording_meta, general, span)
    return _assemble(files, "highd", rows, meta, size, general, frame_rate, lanes, classes)


DRONE_READERS: dict[str, Callable[[DroneFiles, ClassMap], Recording]] = {
    "highd": read_highd,
    **{
        name: functools.partial(read_ind, layout=name) for name in ("ind", "round", "unid", "exid")
    },
}


def drone_units(
    layout: str, directory: Path, names: Sequence[str] | None, options: ReadingOptions
) -> list[Unit]:
    """Return the files of each recording in a directory.

    Args:
        layout: a name in ``DRONE_READERS``.
        directory: with the files.
        names: of the recordings wanted, None for all.
        options: what else is said about the files.

    Raises:
        RecordingError: the directory has no such files, or a name is missing.
    """

    def unit(files: DroneFiles) -> Unit:
        read = DRONE_READERS[layout]
        return Unit(files.name, layout, files.all, lambda: iter([read(files, options.classes)]))

    units = [unit(files) for files in find_drone_files(directory, names)]
    if names:
        return units
    return [dataclasses.replace(units[0], remarks=missing_tracks(units[0].files[0])), *units[1:]]


def _place(path: Path, row: int) -> str:
    """Return the file and the line of a row."""
    return f"{path}, line {line_in_file(path, row + 2)}"


def _with_unknown(table: pd.DataFrame, names: Sequence[str]) -> pd.DataFrame:
    """Return the table with columns of unknown values for the names that it lacks."""
    return table.assign(**{name: np.nan for name in names if name not in table})


def _sizes(table: pd.DataFrame, meta: pd.DataFrame) -> Float64Array:
    """Return [rows of meta, 2] lengths and widths (m), those of the tracks file where it has them.

    Where the two files differ, as for many vehicles of exiD, its owners say that tracks is right.
    """
    size = meta[["length", "width"]].to_numpy(np.float64)
    if "length" in table and "width" in table:
        # Files are sorted by track: few rows remain in which a search costs time.
        track = table["trackId"].to_numpy(np.int64)
        first = np.flatnonzero(np.append(True, track[1:] != track[:-1]))[: len(track)]
        own = table.iloc[first][["trackId", "length", "width"]]
        own = own.drop_duplicates("trackId").set_index("trackId")
        measured = own.reindex(meta["id"]).to_numpy(np.float64)
        size = np.where((measured > 0).all(axis=1)[:, None], measured, size)
    return size


def wrap_angle(angle: Float64Array) -> Float64Array:
    """Return the angles in (-pi, pi] (rad)."""
    return np.pi - np.mod(np.pi - angle, 2 * np.pi)


def _driving_heading(velocity: Float64Array, direction: np.ndarray) -> Float64Array:
    """Return headings [rows] (rad) of velocities [rows, 2]; a standing vehicle's is its road's."""
    sign = np.where(direction == 1, -1.0, 1.0)
    forward = np.maximum(np.nan_to_num(velocity[:, 0] * sign), HEADING_SPEED_MPS)
    left = np.nan_to_num(velocity[:, 1] * sign)
    return wrap_angle(np.arctan2(left, forward) + np.where(sign < 0, np.pi, 0.0))


def _tracks_meta(path: Path, id_name: str, sizes: Sequence[str], *integers: str) -> pd.DataFrame:
    """Read the tracksMeta table; its id column is named ``id`` and has each id once."""
    table = read_table(
        path,
        integers=(id_name, *integers),
        unknown_allowed=sizes,
        texts=("class",),
        unchecked=(*_WHOSE, *_SPAN),
        optional=(*_WHOSE, *_SPAN),
    ).rename(columns={id_name: "id"})
    doubled = table["id"].duplicated().to_numpy(bool)
    if doubled.any():
        row = int(np.argmax(doubled))
        raise RecordingError(f"{_place(path, row)}: track {table['id'].iloc[row]} comes twice")
    return table


def _check_one_recording(files: DroneFiles, tables: Sequence[pd.DataFrame]) -> None:
    """Check that the three files say that they are of the same recording, where they say it.

    Raises:
        RecordingError: they say another thing.
    """
    paths = (files.tracks, files.tracks_meta, files.recording_meta)
    said = [
        (path, number)
        for path, table in zip(paths, tables, strict=True)
        for name in _WHOSE
        if name in table
        for number in pd.to_numeric(table[name], errors="coerce").dropna().unique()
    ]
    for path, number in said[1:]:
        first, other = said[0]
        if number != other:
            raise RecordingError(
                f"{first} is of recording {other:g}, and {path.name} of recording {number:g}, "
                "expected files of the same one"
                if path != first
                else f"{first} has rows of the recordings {other:g} and {number:g}, expected one"
            )


def _remark_on_lost(
    files: DroneFiles,
    meta: pd.DataFrame,
    present: np.ndarray,
    frame: np.ndarray,
    track: np.ndarray,
) -> None:
    """Say which tracks the tracks file has not as far as tracksMeta lists them.

    Args:
        files: the files.
        meta: tracksMeta.
        present: [tracks] numbers of the tracks in the tracks file.
        frame: [rows] ascending frame numbers.
        track: [rows] index of the track.
    """
    if not set(_SPAN) <= set(meta.columns):
        return
    begin, end = (pd.to_numeric(meta[name], errors="coerce").to_numpy() for name in _SPAN)
    first, last = (frame[rows] for rows in first_and_last(track, len(present)))
    place = pd.Index(present).get_indexer(meta["id"])
    lost = (place < 0) | (first[place] > begin) | (last[place] < end)
    if lost.any():
        which = meta["id"].to_numpy()[lost]
        remark(
            f"{files.tracks} has not all rows of {len(which)} of the {len(meta)} tracks in "
            f"{files.tracks_meta.name}, the first is track {which[0]}: it may be cut, or the two "
            "are of different recordings"
        )


def _check_directions(path: Path, meta: pd.DataFrame) -> None:
    wrong = ~meta["drivingDirection"].isin([1, 2]).to_numpy(bool)
    if wrong.any():
        row = int(np.argmax(wrong))
        raise RecordingError(
            f"{_place(path, row)}, column 'drivingDirection': "
            f"{meta['drivingDirection'].iloc[row]}, expected 1 (to the left) or 2 (to the right)"
        )


def _check_known(files: DroneFiles, track_id: np.ndarray, known: np.ndarray) -> None:
    unknown = ~np.isin(track_id, known)
    if unknown.any():
        row = int(np.argmax(unknown))
        raise RecordingError(
            f"{_place(files.tracks, row)}: track {track_id[row]} is not listed in "
            f"{files.tracks_meta.name}"
        )


def _recording_meta(path: Path, *texts: str) -> tuple[pd.Series, float]:
    """Return the one row of a recordingMeta file, and its frame rate (Hz)."""
    table = read_table(
        path,
        numbers=("frameRate",),
        texts=("locationId", *texts),
        unchecked=_WHOSE,
        optional=_WHOSE,
    )
    if len(table) != 1:
        raise RecordingError(f"{path} has {len(table)} rows, expected exactly one recording")
    frame_rate = float(table["frameRate"].iloc[0])
    if not frame_rate > 0:
        raise RecordingError(
            f"{_place(path, 0)}, column 'frameRate': {frame_rate:g}, expected frames per second"
        )
    return table.iloc[0], frame_rate


def _lanes(path: Path, general: pd.Series, span: tuple[float, float]) -> tuple[Float64Array, ...]:
    lanes = []
    for column, (start, end) in (("upperLaneMarkings", span[::-1]), ("lowerLaneMarkings", span)):
        # A road with one carriageway has no markings of the other.
        cells = "" if pd.isna(general[column]) else str(general[column])
        for cell in filter(str.strip, cells.split(";")):
            try:
                y = -float(cell)
            except ValueError:
                y = np.nan
            if not np.isfinite(y):
                raise RecordingError(
                    f"{_place(path, 0)}, column {column!r}: {cell!r}, "
                    "expected y positions joined by ';'"
                )
            lanes.append(np.array([[start, y], [end, y]]))
    return tuple(lanes)


def _assemble(
    files: DroneFiles,
    layout: str,
    rows: _Rows,
    meta: pd.DataFrame,
    size: Float64Array,
    general: pd.Series,
    frame_rate: float,
    lanes: tuple[Float64Array, ...],
    class_map: ClassMap,
) -> Recording:
    """Return the recording, rows sorted by frame and track, after the last checks."""
    if not len(rows.frame):
        raise RecordingError(f"{files.tracks} has no rows below its header")
    if (int(rows.frame.max()) - int(rows.frame.min())) / frame_rate > LONGEST_S:
        far = int(np.argmax(np.abs(rows.frame.astype(np.float64) - float(rows.frame[0]))))
        raise RecordingError(
            f"{_place(files.tracks, far)}: frame {rows.frame[far]} is far from the others, "
            f"expected a recording of at most {LONGEST_S:.0e} s"
        )
    ids = meta["id"].to_numpy(np.int64)
    _check_known(files, rows.track_id, ids)
    present, track = np.unique(rows.track_id, return_inverse=True)
    meta_row = pd.Index(ids).get_indexer(present)
    order = np.lexsort((track, rows.frame))
    frame, track = rows.frame[order], track[order].astype(np.int64)
    again = (np.diff(frame) == 0) & (np.diff(track) == 0)
    if again.any():
        row = int(order[int(np.argmax(again)) + 1])
        raise RecordingError(
            f"{_place(files.tracks, row)}: track {rows.track_id[row]} has a second row for "
            f"frame {rows.frame[row]}"
        )
    _remark_on_lost(files, meta, present, frame, track)
    classes = meta["class"].fillna("").iloc[meta_row]
    size = size[meta_row]
    return Recording(
        name=files.name,
        layout=layout,
        location="" if pd.isna(general["locationId"]) else str(general["locationId"]),
        frame_rate=frame_rate,
        frame=frame,
        track=track,
        position=rows.position[order],
        velocity=rows.velocity[order],
        acceleration=rows.acceleration[order],
        yaw=rows.yaw[order],
        track_id=present,
        agent_class=classes_of(classes.tolist(), class_map, files.tracks_meta),
        # A box without extent was not measured (pedestrians, bicycles).
        size=np.where(size > 0, size, np.nan),
        lanes=lanes,
        sha256=sha256_of(files.all),
    )
