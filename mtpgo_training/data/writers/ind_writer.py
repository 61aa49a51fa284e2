# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Recordings in the layout of inD and rounD: box centres, y up, headings in degrees."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from mtpgo_core.schema import AgentClass
from mtpgo_training.data.recording import Recording
from mtpgo_training.data.writers.csv_writer import write_tables
from mtpgo_training.data.writers.lane_writer import write_lanes

_CLASSES = {
    AgentClass.TRUCK: "truck_bus",
    AgentClass.BUS: "truck_bus",
    AgentClass.TRAILER: "truck_bus",
    AgentClass.VAN: "car",
}
_ROAD_USERS_WITHOUT_MOTOR = (AgentClass.BICYCLE, AgentClass.PEDESTRIAN)


def write_ind(recording: Recording, directory: Path, *, compress: bool = True) -> list[Path]:
    """Write a recording in inD layout and return the paths of its three tables.

    Accelerations and the longitudinal and lateral parts are those of the recording's vectors.
    Vans become cars and buses ``truck_bus``, as inD has no other classes. The layout has no lane
    markings; a recording that has some gets a file ``NN_lanes.geojson`` beside the three.

    Raises:
        RecordingError: the directory cannot be written to.
    """
    number = int(recording.name) if recording.name.isdigit() else 0
    order = np.lexsort((recording.frame, recording.track))
    track, frame = recording.track[order], recording.frame[order]
    track_id = recording.track_id
    first = frame[np.unique(track, return_index=True)[1]]
    count = np.bincount(track, minlength=len(track_id))
    last = frame[np.cumsum(count) - 1]
    size = np.nan_to_num(recording.size)
    yaw = recording.yaw[order]
    velocity, acceleration = recording.velocity[order], recording.acceleration[order]
    cos, sin = np.cos(yaw), np.sin(yaw)

    def turned(vector: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        x, y = vector.T
        return x * cos + y * sin, y * cos - x * sin

    columns: dict[str, np.ndarray | int] = {
        "recordingId": number,
        "trackId": track_id[track],
        "frame": frame,
        "trackLifetime": frame - first[track],
        "xCenter": recording.position[order, 0].round(4),
        "yCenter": recording.position[order, 1].round(4),
        "heading": np.mod(np.degrees(yaw), 360.0).round(4),
        "width": size[track, 1].round(3),
        "length": size[track, 0].round(3),
        "xVelocity": velocity[:, 0].round(4),
        "yVelocity": velocity[:, 1].round(4),
        "xAcceleration": acceleration[:, 0].round(4),
        "yAcceleration": acceleration[:, 1].round(4),
    }
    for kind, vector in (("Velocity", velocity), ("Acceleration", acceleration)):
        for axis, values in zip(("lon", "lat"), turned(vector), strict=True):
            columns[axis + kind] = values.round(4)
    classes = [AgentClass(value) for value in recording.agent_class]
    slow = sum(value in _ROAD_USERS_WITHOUT_MOTOR for value in classes)
    tracks_meta = pd.DataFrame(
        {
            "recordingId": number,
            "trackId": track_id,
            "initialFrame": first,
            "finalFrame": last,
            "numFrames": last - first + 1,
            "width": size[:, 1].round(3),
            "length": size[:, 0].round(3),
            "class": [_CLASSES.get(value, value.name.lower()) for value in classes],
        }
    )
    recording_meta = pd.DataFrame(
        {
            "recordingId": [number],
            "locationId": [recording.location],
            "frameRate": [f"{recording.frame_rate:g}"],
            "speedLimit": [-1],
            "weekday": [""],
            "startTime": [-1],
            "duration": [round(recording.duration_s, 3)],
            "numTracks": [len(track_id)],
            "numVehicles": [len(track_id) - slow],
            "numVRUs": [slow],
            "latLocation": [0.0],
            "lonLocation": [0.0],
            "xUtmOrigin": [0.0],
            "yUtmOrigin": [0.0],
            "orthoPxToMeter": [0.1],
        }
    )
    written = write_tables(
        directory,
        recording.name,
        tracks=pd.DataFrame(columns),
        tracks_meta=tracks_meta,
        recording_meta=recording_meta,
        compress=compress,
    )
    write_lanes(recording.lanes, directory / f"{recording.name}_lanes.geojson")
    return written
