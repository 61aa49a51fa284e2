# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The readers of recordings as CSV files, of calibration samples, and of what a node learned."""

from __future__ import annotations

import functools
import io
import warnings

import numpy as np
from fuzz_target import FuzzTarget, place

from mtpgo_core.live_calibration.calibration_file import restore, save
from mtpgo_core.live_calibration.live_calibration import LiveCalibration
from mtpgo_core.live_calibration.live_options import LiveOptions
from mtpgo_core.task.calibration import GROUPS, Calibration, GroupCalibration
from mtpgo_core.task.task_description import HistoryConfig, TaskDescription
from mtpgo_training.calibration.calibration_samples import CalibrationSamples
from mtpgo_training.data.readers import load_recordings

_WEIGHTS = "ab" * 32

_BETWEEN = b"\n====\n"
"""Separates the files of a recording in an input."""


def read_files(layout: str, names: tuple[str, ...], data: bytes) -> None:
    """Write the files of a recording and read it."""
    parts = data.split(_BETWEEN)
    for name, part in zip(names, parts + [b""] * len(names), strict=False):
        (place(layout) / name).write_bytes(part)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for recording in load_recordings(place(layout), layout):
            assert np.isfinite(recording.position).all(), "a position that is not finite"


DRONE = ("01_tracks.csv", "01_tracksMeta.csv", "01_recordingMeta.csv")
IND = (
    b"recordingId,trackId,frame,xCenter,yCenter,heading,width,length,"
    b"xVelocity,yVelocity,xAcceleration,yAcceleration\n"
    + b"".join(b"1,7,%d,%d.5,-3.25,90,1.8,4.5,10,0.5,0,0\n" % (k, k) for k in range(6)),
    b"recordingId,trackId,width,length,class\n1,7,1.8,4.5,car\n",
    b"recordingId,frameRate,locationId\n1,25,2\n",
)
HIGHD = (
    b"frame,id,x,y,width,height,xVelocity,yVelocity,xAcceleration,yAcceleration\n"
    + b"".join(b"%d,7,%d.5,13.2,4.5,1.8,25,0.1,0,0\n" % (k, k) for k in range(6)),
    b"id,width,height,class,drivingDirection\n7,4.5,1.8,Car,2\n",
    b"id,frameRate,locationId,upperLaneMarkings,lowerLaneMarkings\n1,25,1,3;7,12;16\n",
)
NGSIM = (
    b"Vehicle_ID,Global_Time,v_Class,Local_X,Local_Y,v_length,v_Width,v_Vel\n"
    + b"".join(b"7,%d,2,16.5,%d,14.5,6,40\n" % (1_118_846_979_700 + 100 * k, 4 * k)
               for k in range(6)),
)  # fmt: skip


def csv_target(layout: str, names: tuple[str, ...], seed: tuple[bytes, ...]) -> FuzzTarget:
    """Return the target of one layout."""
    return FuzzTarget(
        f"reader_{layout}",
        functools.partial(read_files, layout, names),
        lambda: [_BETWEEN.join(seed)],
        text=True,
    )


def samples_target() -> FuzzTarget:
    """Return the target of files of calibration samples."""

    def run(data: bytes) -> None:
        path = place("samples") / "calibration.npz"
        path.write_bytes(data)
        CalibrationSamples.load(path)

    def seeds() -> list[bytes]:
        path = place("samples") / "seed.npz"
        agents, steps, modes = 3, 4, 2
        arrays = {
            "site": np.zeros(agents, np.int32),
            "group": np.zeros(agents, np.uint8),
            "distance": np.ones((agents, steps), np.float32),
            "log_determinant": np.zeros((agents, steps), np.float32),
            "log_weight": np.full((agents, modes), -0.7, np.float32),
            "mode_error": np.ones((agents, modes), np.float32),
        }
        earlier = io.BytesIO()
        np.savez(earlier, format=1, step_s=0.2, sites=np.array(["north"]), **arrays)
        CalibrationSamples(
            step_s=0.2,
            sites=("north",),
            mode_distance=np.ones((agents, modes, 1), np.float32),
            mode_log_determinant=np.zeros((agents, modes, 1), np.float32),
            **arrays,
        ).save(path)
        return [path.read_bytes(), earlier.getvalue()]

    return FuzzTarget("calibration_samples", run, seeds)


def learned_target() -> FuzzTarget:
    """Return the target of the files in which the online calibration survives a restart."""

    def run(data: bytes) -> None:
        path = place("learned") / "calibration.json"
        path.write_bytes(data)
        live = LiveCalibration(LiveOptions(), HistoryConfig(), 2)
        restore(live, _WEIGHTS, path)
        fit = live.paths.equations.fit
        learned = (live.tracker.log_sigma, fit.coefficients, fit.belief)
        assert all(np.isfinite(values).all() for values in learned), "a value that is not finite"

    def seeds() -> list[bytes]:
        path = place("learned") / "seed.json"
        save(LiveCalibration(LiveOptions(), HistoryConfig(), 2), _WEIGHTS, path)
        return [path.read_bytes()]

    return FuzzTarget("learned_calibration", run, seeds, text=True)


def task_target() -> FuzzTarget:
    """Return the target of the task description, which contains the calibration."""

    def run(data: bytes) -> None:
        try:
            text = data.decode()
        except UnicodeDecodeError:
            return
        task = TaskDescription.from_json(text)
        assert TaskDescription.from_json(task.to_json()) == task

    def seeds() -> list[bytes]:
        factors = tuple(1.0 + 0.01 * k for k in range(25))
        inner = (0.7,) * 25
        groups = tuple(GroupCalibration(name, factors, 1.1, 50, 1, inner) for name in GROUPS)
        calibrated = TaskDescription(calibration=Calibration(groups))
        return [task.to_json().encode() for task in (TaskDescription(), calibrated)]

    return FuzzTarget("task_description", run, seeds, text=True)


def targets() -> list[FuzzTarget]:
    """Return the targets of this file."""
    return [
        csv_target("ind", DRONE, IND),
        csv_target("highd", DRONE, HIGHD),
        csv_target("ngsim", ("trajectories.csv",), NGSIM),
        samples_target(),
        learned_target(),
        task_target(),
    ]
