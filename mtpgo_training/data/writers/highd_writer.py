# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Recordings of a straight road in the layout of highD.

The layout's traps: ``x, y`` is the upper-left corner of the box, y points down, ``width`` is the
length, and lanes are numbered from 2 across both carriageways, skipping the median.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mtpgo_core.errors import RecordingError
from mtpgo_core.schema import AgentClass, Float64Array
from mtpgo_training.data.recording import Recording
from mtpgo_training.data.writers.csv_writer import write_tables
from mtpgo_training.data.writers.highd_neighbours import NEIGHBOURS, neighbours


@dataclass(frozen=True)
class _Road:
    """The markings of both carriageways.

    Attributes:
        upper, lower: y of the lines in the picture (m), from the top.
        seen: x of the begin and end of the observed road (m).
    """

    upper: Float64Array
    lower: Float64Array
    seen: tuple[float, float]

    def lane_id(self, y: Float64Array, upper: NDArray[np.bool_]) -> NDArray[np.int64]:
        """Return [rows] highD's lane number at y in the picture, limited to the carriageway."""
        above = np.searchsorted(self.upper, y, side="right").clip(1, len(self.upper) - 1)
        below = np.searchsorted(self.lower, y, side="right").clip(1, len(self.lower) - 1)
        return np.where(upper, above + 1, below + 1 + len(self.upper)).astype(np.int64)


def write_highd(recording: Recording, directory: Path, *, compress: bool = True) -> list[Path]:
    """Write a recording of a straight road along x in highD layout and return the paths.

    ``dhw`` is the gap between the bumpers, ``thw`` that gap over the own speed and ``ttc`` over
    the closing speed (negative when opening); 0 without a preceding vehicle, for a ``thw`` at
    rest and for a ``ttc`` at equal speeds.

    Raises:
        RecordingError: the recording has no lane markings along x, a track or frame number below
            1, a size that is unknown, or the directory cannot be written to.
    """
    road = _road(recording)
    if recording.track_id.min() < 1 or recording.frame.min() < 1:
        raise RecordingError(
            f"recording {recording.name} has a track or frame number below 1, "
            "expected numbers from 1 as in highD"
        )
    if not np.isfinite(recording.size).all():
        raise RecordingError(
            f"recording {recording.name} has road users without a size, which highD requires"
        )
    upper = _drives_left(recording)
    tracks = _tracks(recording, road, upper)
    order = np.lexsort((tracks["frame"], tracks["id"]))
    tracks = tracks.iloc[order]
    meta = _tracks_meta(recording, tracks, upper)
    return write_tables(
        directory,
        recording.name,
        tracks=tracks,
        tracks_meta=meta,
        recording_meta=_recording_meta(recording, road, meta),
        compress=compress,
    )


def _road(recording: Recording) -> _Road:
    sides: dict[bool, list[float]] = {True: [], False: []}
    ends: list[float] = []
    for line in recording.lanes:
        if np.ptp(line[:, 1]) > 1e-6:
            raise RecordingError(
                f"recording {recording.name} has a curved or tilted lane marking, expected "
                "straight ones along x as in highD"
            )
        sides[bool(line[-1, 0] < line[0, 0])].append(-float(line[0, 1]))
        ends += line[:, 0].tolist()
    if min(len(side) for side in sides.values()) < 2:
        raise RecordingError(
            f"recording {recording.name} has {len(sides[True])} lane markings to the left and "
            f"{len(sides[False])} to the right, expected at least 2 each as in highD"
        )
    return _Road(
        np.sort(np.array(sides[True])), np.sort(np.array(sides[False])), (min(ends), max(ends))
    )


def _drives_left(recording: Recording) -> NDArray[np.bool_]:
    """Return [tracks] whether the heading points along -x."""
    forward = np.bincount(recording.track, np.cos(recording.yaw), len(recording.track_id))
    left: NDArray[np.bool_] = forward < 0
    return left


def _tracks(recording: Recording, road: _Road, upper: NDArray[np.bool_]) -> pd.DataFrame:
    """Return the tracks table in the recording's order of rows."""
    track = recording.track
    size, on_upper = recording.size[track], upper[track]
    # From the internal frame to the picture: y down.
    centre = recording.position * (1.0, -1.0)
    velocity = recording.velocity * (1.0, -1.0)
    acceleration = recording.acceleration * (1.0, -1.0)
    sign = np.where(on_upper, -1.0, 1.0)
    speed = velocity[:, 0] * sign
    lane = road.lane_id(centre[:, 1], on_upper)
    # Counted from the right in the direction of travel, to find left and right neighbours.
    own_lane = np.where(on_upper, lane, -lane)
    around = np.full((len(recording), len(NEIGHBOURS)), -1, dtype=np.int64)
    bounds = np.append(np.unique(recording.frame, return_index=True)[1], len(recording))
    for start, end in itertools.pairwise(bounds.tolist()):
        for carriageway in (True, False):
            rows = start + np.flatnonzero(on_upper[start:end] == carriageway)
            found = neighbours(centre[rows, 0] * sign[rows], size[rows, 0], own_lane[rows])
            around[rows] = np.where(found >= 0, rows[found], -1) if len(rows) else found
    numbers = np.append(recording.track_id[track], 0)  # the last entry means no neighbour
    leader = around[:, 0]
    led = leader >= 0
    gap = np.abs(centre[leader, 0] - centre[:, 0]) - (size[leader, 0] + size[:, 0]) / 2
    gap = np.where(led, gap, 0.0)
    closing = speed - speed[leader]
    to_right = road.seen[1] - (centre[:, 0] + size[:, 0] / 2)
    to_left = centre[:, 0] - size[:, 0] / 2 - road.seen[0]
    columns: dict[str, np.ndarray] = {
        "frame": recording.frame,
        "id": recording.track_id[track],
        "x": (centre[:, 0] - size[:, 0] / 2).round(3),
        "y": (centre[:, 1] - size[:, 1] / 2).round(3),
        "width": size[:, 0].round(3),
        "height": size[:, 1].round(3),
        "xVelocity": velocity[:, 0].round(3),
        "yVelocity": velocity[:, 1].round(3),
        "xAcceleration": acceleration[:, 0].round(3),
        "yAcceleration": acceleration[:, 1].round(3),
        "frontSightDistance": np.where(on_upper, to_left, to_right).round(2),
        "backSightDistance": np.where(on_upper, to_right, to_left).round(2),
        "dhw": gap.round(2),
        "thw": _over(gap, speed, led).round(2),
        "ttc": _over(gap, closing, led).round(2),
        "precedingXVelocity": np.where(led, velocity[leader, 0], 0.0).round(2),
    }
    for column, name in enumerate(NEIGHBOURS):
        columns[f"{name}Id"] = numbers[around[:, column]]
    columns["laneId"] = lane
    return pd.DataFrame(columns)


def _over(gap: Float64Array, speed: Float64Array, led: NDArray[np.bool_]) -> Float64Array:
    """Return the gap over a speed (s), 0 without a preceding vehicle or near zero speed."""
    usable = led & (np.abs(speed) > 0.01)
    return np.where(usable, gap / np.where(usable, speed, 1.0), 0.0)


def _tracks_meta(
    recording: Recording, tracks: pd.DataFrame, upper: NDArray[np.bool_]
) -> pd.DataFrame:
    groups = tracks.groupby("id", sort=True)
    speed = tracks["xVelocity"].abs().groupby(tracks["id"])
    led = tracks[tracks["precedingId"] > 0]

    def least(column: str, rows: pd.DataFrame) -> np.ndarray:
        found = rows.groupby("id")[column].min().reindex(recording.track_id)
        return found.fillna(-1.0).to_numpy()

    first, last = groups["frame"].min().to_numpy(), groups["frame"].max().to_numpy()
    x = groups["x"]
    changed = tracks["laneId"].diff().ne(0) & tracks["id"].diff().eq(0)
    return pd.DataFrame(
        {
            "id": recording.track_id,
            "width": recording.size[:, 0].round(3),
            "height": recording.size[:, 1].round(3),
            "initialFrame": first,
            "finalFrame": last,
            "numFrames": last - first + 1,
            "class": [
                "Car" if value in (AgentClass.CAR, AgentClass.VAN) else "Truck"
                for value in recording.agent_class
            ],
            "drivingDirection": np.where(upper, 1, 2),
            "traveledDistance": (x.last() - x.first()).abs().round(2).to_numpy(),
            "minXVelocity": speed.min().round(2).to_numpy(),
            "maxXVelocity": speed.max().round(2).to_numpy(),
            "meanXVelocity": speed.mean().round(2).to_numpy(),
            "minDHW": least("dhw", led),
            "minTHW": least("thw", led[led["thw"] > 0]),
            "minTTC": least("ttc", led[led["ttc"] > 0]),
            "numLaneChanges": changed.groupby(tracks["id"]).sum().astype(int).to_numpy(),
        }
    )


def _recording_meta(recording: Recording, road: _Road, meta: pd.DataFrame) -> pd.DataFrame:
    def lines(values: Float64Array) -> str:
        return ";".join(f"{value:.2f}" for value in values)

    cars = int((meta["class"] == "Car").sum())
    return pd.DataFrame(
        {
            "id": [int(recording.name) if recording.name.isdigit() else 0],
            "frameRate": [f"{recording.frame_rate:g}"],
            "locationId": [recording.location],
            "speedLimit": [-1],
            "month": [""],
            "weekDay": [""],
            "startTime": [""],
            "duration": [round(recording.duration_s, 2)],
            "totalDrivenDistance": [round(float(meta["traveledDistance"].sum()), 2)],
            "totalDrivenTime": [round(float(meta["numFrames"].sum()) / recording.frame_rate, 2)],
            "numVehicles": [len(meta)],
            "numCars": [cars],
            "numTrucks": [len(meta) - cars],
            "upperLaneMarkings": [lines(road.upper)],
            "lowerLaneMarkings": [lines(road.lower)],
        }
    )
