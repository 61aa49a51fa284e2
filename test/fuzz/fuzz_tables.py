# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Class maps, descriptions of columns, plain tables and the data sets' own files."""

from __future__ import annotations

import functools
import io
import json
import struct
import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from fuzz_target import FuzzTarget, place

from mtpgo_core.class_map import read_class_map
from mtpgo_training.data.readers import load_recordings
from mtpgo_training.data.readers.fleets.waymo_recordings import (
    masked_crc32c,
    scenario_message,
)
from mtpgo_training.data.readers.reading_options import ReadingOptions
from mtpgo_training.data.readers.tables.table_columns import read_columns
from mtpgo_training.data.summary.recording_summary import summarise

_BETWEEN = b"\n====\n"
"""Separates the files of a recording in an input."""

COLUMNS = b"columns: {track: id, time: t, x: x, y: y, class: c}\ny_axis: down\n"
TABLE = b"t,id,x,y,c\n" + b"".join(b"%d.%d,7,%d,2.5,car\n" % (k, k, k) for k in range(8))
INTERACTION = (
    b"track_id,frame_id,timestamp_ms,agent_type,x,y,vx,vy,psi_rad,length,width\n"
    + b"".join(b"3,%d,%d,car,%d,2,10,0,0.1,4.5,1.8\n" % (k, 100 * k, k) for k in range(8)),
    b"track_id,frame_id,timestamp_ms,agent_type,x,y,vx,vy\nP1,1,100,pedestrian,1,2,0,1\n",
)
DUT = (
    b"id,frame,label,x_est,y_est,vx_est,vy_est\n0,1,ped,1,2,1,1\n0,2,ped,2,2,1,1\n",
    b"id,frame,label,x_est,y_est,psi_est,vel_est\n0,1,veh,5,6,0.5,4\n",
)
ETH = b"780\t1\t8.5\t3.5\n790\t1\t8.9\t3.5\n790\t2\t1\t2\n"
OPENACC = (
    b"Date,1,2,2019\nVehicle_order,a,b\n\nTime,Speed1,E1,N1,VE1,VN1,E2,N2\n"
    b"1.0,5,1,2,5,0,,\n1.1,5,1.5,2,5,0,9,2\n"
)
NGSIM_TEXT = b"".join(
    b"7 %d 99 %d 16.5 %d 0 0 14.5 6 2 40 0 2 0 0 0 0\n" % (k, 1_118_846_979_700 + 100 * k, 4 * k)
    for k in range(6)
)


def read(layout: str, names: Sequence[str], data: bytes, columns: bytes | None = None) -> None:
    """Write the files of a recording, read and describe it."""
    folder = place(layout + Path(names[0]).suffix[1:]) / "data"
    parts = data.split(_BETWEEN)
    for name, part in zip(names, parts + [b""] * len(names), strict=False):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(part)
    options = ReadingOptions()
    if columns is not None:
        options = ReadingOptions(columns=place(layout) / "columns.yaml")
        (place(layout) / "columns.yaml").write_bytes(columns)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for recording in load_recordings(folder, layout, options=options):
            assert np.isfinite(recording.position).all(), "a position that is not finite"
            assert (np.diff(recording.frame) >= 0).all(), "frames that do not ascend"
            json.dumps(summarise(recording).to_json(), allow_nan=False)


def yaml_target(name: str, function: object, seeds: Sequence[bytes]) -> FuzzTarget:
    """Return the target of a YAML file."""

    def run(data: bytes) -> None:
        path = place(name) / "file.yaml"
        path.write_bytes(data)
        function(path)  # type: ignore[operator]

    return FuzzTarget(name, run, lambda: list(seeds), text=True)


def layout_target(
    layout: str, names: Sequence[str], *seed: bytes, text: bool = True
) -> FuzzTarget:
    """Return the target of the files of a layout."""
    return FuzzTarget(
        f"layout_{layout}",
        functools.partial(read, layout, names),
        lambda: [_BETWEEN.join(seed)],
        text=text,
    )


def _scenario() -> bytes:
    message = scenario_message()(scenario_id="a", sdc_track_index=0)
    message.timestamps_seconds.extend([0.0, 0.1])
    track = message.tracks.add(id=7, object_type=1)
    for k in range(2):
        track.states.add(center_x=k, center_y=5.0, length=4.5, width=2.0, valid=True)
    return message.SerializeToString()


def _waymo_file(content: bytes) -> bytes:
    length = struct.pack("<Q", len(content))
    sums = [struct.pack("<I", masked_crc32c(part)) for part in (length, content)]
    return length + sums[0] + content + sums[1]


def _parquet() -> bytes:
    table = pd.read_csv(io.BytesIO(TABLE))
    stream = io.BytesIO()
    table.to_parquet(stream)
    return stream.getvalue()


def _nuscenes() -> list[bytes]:
    tables: list[list[dict[str, object]]] = [
        [{"token": "s", "name": "scene-1", "log_token": "l"}],
        [{"token": "l", "location": "here"}],
        [{"token": f"a{k}", "scene_token": "s", "timestamp": 500_000 * k} for k in range(3)],
        [{"token": "i", "category_token": "c"}],
        [{"token": "c", "name": "vehicle.car"}],
        [
            {"sample_token": f"a{k}", "instance_token": "i", "translation": [k, 2, 0],
             "size": [2, 4, 1], "rotation": [1, 0, 0, 0]}
            for k in range(3)
        ],
        [{"timestamp": 500_000, "translation": [0, 0, 0], "rotation": [1, 0, 0, 0]}],
    ]  # fmt: skip
    return [json.dumps(table).encode() for table in tables]


NUSCENES_FILES = [
    f"v1.0-mini/{name}.json"
    for name in ("scene", "log", "sample", "instance", "category", "sample_annotation", "ego_pose")
]


def targets() -> list[FuzzTarget]:
    """Return the targets of this file."""
    return [
        yaml_target("class_map", read_class_map, [b"preset: coco\ntram: bus\n17: car\n"]),
        yaml_target("table_columns", read_columns, [COLUMNS]),
        FuzzTarget(
            "layout_table",
            lambda data: read("table", ["a.csv"], data, COLUMNS),
            lambda: [TABLE],
            text=True,
        ),
        FuzzTarget(
            "layout_table_parquet",
            lambda data: read("table", ["a.parquet"], data, COLUMNS),
            lambda: [_parquet()],
        ),
        layout_target(
            "interaction", ["vehicle_tracks_000.csv", "pedestrian_tracks_000.csv"], *INTERACTION
        ),
        layout_target("dut", ["a_traj_ped_filtered.csv", "a_traj_veh_filtered.csv"], *DUT),
        layout_target("eth_ucy", ["a.txt"], ETH),
        layout_target("openacc", ["a.csv"], OPENACC),
        layout_target("ngsim", ["a.txt"], NGSIM_TEXT),
        # A damaged scenario is not decoded, so here the check sums are made for the input.
        FuzzTarget(
            "layout_waymo",
            lambda data: read("waymo", ["a.tfrecord"], _waymo_file(data)),
            lambda: [_scenario()],
        ),
        FuzzTarget(
            "layout_waymo_file",
            lambda data: read("waymo", ["a.tfrecord"], data),
            lambda: [_waymo_file(_scenario())],
        ),
        layout_target("nuscenes", NUSCENES_FILES, *_nuscenes()),
    ]
