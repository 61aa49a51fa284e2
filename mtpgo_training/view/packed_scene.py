# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A scene as few bytes: whole numbers, differences of them, and zlib.

The page reads it by ``page/packed_data.js``. Layout: the length of the head (4 bytes, little
endian), the head as JSON, then the columns that the head lists, one after the other, each number
with its sign in the last bit and seven bits a byte, the lowest first.
"""

from __future__ import annotations

import json
import logging
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.class_size import known_sizes
from mtpgo_core.quality.metrics import radius_squared, sigma_factor
from mtpgo_core.schema import AgentClass, CalibrationStage, Float64Array, Source
from mtpgo_training.data.recording import Int64Array
from mtpgo_training.reports.drawn_bodies import shown_modes
from mtpgo_training.view.view_scene import (
    ELLIPSE_LEVEL,
    SeenPrediction,
    ViewScene,
    drawn_speeds,
    drawn_yaws,
    ellipse_indices,
    identity_texts,
    rows_by_track,
    shown_frames,
)

POSITION_M = 0.02
"""Step of a stored position (m); chosen: a twentieth of a pixel at the scale of a road."""

YAW_RAD, SPEED_MPS, SIZE_M, ERROR_M = 0.02, 0.1, 0.05, 0.01
"""Steps of the other numbers; chosen: finer than what is drawn or printed."""

WEIGHTS = 1000
"""Steps of a mode's weight."""

ELLIPSE_BASE_M, ELLIPSE_STEPS = 0.02, 12
"""Half axes of ellipses are stored as logarithms: steps of a factor e^(1/12), 8 %, above 2 cm."""

ELLIPSE_ANGLES = 64
"""Steps of an ellipse's direction in half a turn."""

PATH_S = 0.4
"""Distance of the stored points of a path in time (s); chosen: between them a road user moves
straight to within centimetres."""

_STAGES = {
    CalibrationStage.NONE: "none",
    CalibrationStage.SHIPPED: "calibration of the model file",
    CalibrationStage.ONLINE: "calibrated online",
    CalibrationStage.ONLINE_PATH: "calibrated online, path corrected",
}
"""What the page says was applied to the model's prediction."""

_log = logging.getLogger("mtpgo")

Columns = dict[str, NDArray[np.int64]]


def pack_scene(scene: ViewScene) -> bytes:
    """Return a scene as bytes, see the module."""
    origin = np.round(np.nanmedian(scene.recording.position, axis=0))
    head: dict[str, Any] = {
        "name": scene.name,
        "model": scene.model,
        "frame": scene.frame_id,
        "start_s": round(scene.start_ns * 1e-9, 3),
        "offset_s": round(scene.offset_s, 3),
        "origin": origin.tolist(),
        "steps": {
            "position": POSITION_M,
            "yaw": YAW_RAD,
            "speed": SPEED_MPS,
            "size": SIZE_M,
            "error": ERROR_M,
            "weights": WEIGHTS,
            "ellipse_base": ELLIPSE_BASE_M,
            "ellipse_steps": ELLIPSE_STEPS,
            "ellipse_angles": ELLIPSE_ANGLES,
        },
        "classes": [member.name.lower() for member in AgentClass],
        "sources": [member.name.lower().replace("_", " ") for member in Source],
        "stages": [_STAGES[stage] for stage in CalibrationStage],
        "level": ELLIPSE_LEVEL,
    }
    columns = _lanes(scene, origin) | _tracks(scene, origin, head) | _modes(scene, origin, head)
    head["columns"] = [[name, len(values)] for name, values in columns.items()]
    text = json.dumps(head, separators=(",", ":")).encode()
    body = b"".join(pack_integers(values) for values in columns.values())
    return zlib.compress(len(text).to_bytes(4, "little") + text + body, 9)


def pack_integers(values: Int64Array) -> bytes:
    """Return whole numbers as bytes: few for small ones, sign in the last bit."""
    values = np.asarray(values, dtype=np.int64)
    rest = ((values << 1) ^ (values >> 63)).astype(np.uint64)
    groups = np.ones(len(rest), dtype=np.int64)
    for bits in range(7, 64, 7):
        groups += rest >= np.uint64(1) << np.uint64(bits)
    out = np.zeros(int(groups.sum()), dtype=np.uint8)
    place = np.cumsum(groups) - groups
    for number in range(int(groups.max(initial=0))):
        rows = groups > number
        last = groups[rows] == number + 1
        out[place[rows] + number] = (rest[rows] & np.uint64(127)) + np.where(last, 0, 128).astype(
            np.uint64
        )
        rest = rest >> np.uint64(7)
    return out.tobytes()


def _whole(values: Float64Array, step: float) -> Int64Array:
    return np.rint(np.nan_to_num(values) / step).astype(np.int64)


def _differences(values: Int64Array, starts: Int64Array, *, order: int = 1) -> Int64Array:
    """Return differences to the value before, of each part that begins at ``starts``.

    Of order 2, the third number of a part and those after it are differences of differences.
    """
    starts = starts[starts < len(values)]
    first = np.diff(values, prepend=0)
    first[starts] = values[starts]
    if order == 1:
        return first
    second = np.diff(first, prepend=0)
    for place in (starts, starts + 1):
        place = place[place < len(values)]
        second[place] = first[place]
    return second


def _lanes(scene: ViewScene, origin: Float64Array) -> Columns:
    lines = [line[np.isfinite(line).all(axis=1)] for line in scene.recording.lanes]
    lengths = np.array([len(line) for line in lines], dtype=np.int64)
    points = np.concatenate([np.empty((0, 2)), *lines]) - origin
    starts = np.cumsum(lengths) - lengths
    xy = _whole(points, POSITION_M)
    return {
        "lane_points": lengths,
        "lane_x": _differences(xy[:, 0], starts),
        "lane_y": _differences(xy[:, 1], starts),
    }


def _tracks(scene: ViewScene, origin: Float64Array, head: dict[str, Any]) -> Columns:
    recording = scene.recording
    frames = shown_frames(scene)
    order, starts = rows_by_track(recording)
    kept = np.isin(recording.frame[order], frames)
    rows = order[kept]
    counts = np.add.reduceat(np.append(kept, False).astype(np.int64), starts[:-1])
    counts[starts[:-1] == starts[1:]] = 0
    begins = np.cumsum(counts) - counts
    xy = _whole(recording.position[rows] - origin, POSITION_M)
    yaw = drawn_yaws(recording)[rows]
    for begin, count in zip(begins.tolist(), counts.tolist(), strict=True):
        yaw[begin : begin + count] = np.unwrap(yaw[begin : begin + count])
    sizes = _whole(known_sizes(recording.size, recording.agent_class), SIZE_M)
    elapsed_ms = np.array(
        [round(1e3 * scene.since_start_s(recording.stamp_ns(f))) for f in frames.tolist()],
        dtype=np.int64,
    )
    head["ids"] = identity_texts(recording.key)
    head["ego"] = (
        recording.track_id.tolist().index(recording.ego_id)
        if recording.ego_id is not None and recording.ego_id in recording.track_id
        else None
    )
    return {
        "frame_ms": np.diff(elapsed_ms, prepend=0),
        "track_class": recording.agent_class.astype(np.int64),
        "track_length": sizes[:, 0],
        "track_width": sizes[:, 1],
        "track_rows": counts,
        "row_frame": _differences(np.searchsorted(frames, recording.frame[rows]), begins),
        "row_x": _differences(xy[:, 0], begins, order=2),
        "row_y": _differences(xy[:, 1], begins, order=2),
        "row_yaw": _differences(_whole(yaw, YAW_RAD), begins),
        "row_speed": _differences(_whole(drawn_speeds(recording)[rows], SPEED_MPS), begins),
    }


def _modes(scene: ViewScene, origin: Float64Array, head: dict[str, Any]) -> Columns:
    """Return the columns of the predictions that have the same steps as the first."""
    given = [p for p in scene.predictions if len(p.prediction.time_s)]
    time_s = given[0].prediction.time_s if given else np.empty(0)
    usable = [p for p in given if _same_steps(p.prediction.time_s, time_s)]
    if len(usable) < len(given):
        _log.warning(
            "mtpgo: %d of the %d predictions of %s have other steps than the first and are not on"
            " the page",
            len(given) - len(usable),
            len(given),
            scene.name,
        )
    ellipse, path = ellipse_indices(time_s), path_indices(time_s)
    head["path_s"] = np.round(time_s[path], 3).tolist()
    head["ellipse_points"] = np.searchsorted(path, ellipse).tolist()
    head["horizon_s"] = round(scene.horizon_s, 3)
    stamps = [round(1e3 * scene.since_start_s(p.prediction.stamp_ns)) for p in usable]
    delays = [round(1e3 * float(p.prediction.time_s[0] - time_s[0])) for p in usable]
    parts = [_prediction_columns(seen, origin, path, ellipse) for seen in usable]
    names = list(parts[0]) if parts else []
    return {
        "prediction_ms": np.diff(np.array(stamps, dtype=np.int64), prepend=0),
        "prediction_delay_ms": np.diff(np.array(delays, dtype=np.int64), prepend=0),
        **{name: np.concatenate([part[name] for part in parts]) for name in names},
    }


def _same_steps(one: Float64Array, other: Float64Array) -> bool:
    """Return whether steps are the same but for a delay that the node compensated."""
    return len(one) == len(other) and bool(
        np.allclose(one - one[:1], other - other[:1], atol=1e-4)
    )


def path_indices(time_s: Float64Array) -> Int64Array:
    """Return the steps of which points are stored: every ``PATH_S``, and those with ellipses."""
    if not len(time_s):
        return np.empty(0, dtype=np.int64)
    dt_s = float(time_s[-1] - time_s[0]) / max(1, len(time_s) - 1)
    stride = max(1, round(PATH_S / dt_s)) if dt_s > 0.0 else 1
    regular = np.arange(len(time_s) - 1, -1, -stride)
    return np.unique(np.concatenate([regular, ellipse_indices(time_s)]))


def _prediction_columns(
    seen: SeenPrediction, origin: Float64Array, path: Int64Array, ellipse: Int64Array
) -> Columns:
    p = seen.prediction
    rows = np.flatnonzero(seen.track >= 0)
    rows = rows[np.argsort(seen.track[rows], kind="stable")]
    shown = shown_modes(p.weight[rows]) & np.isfinite(p.mean[rows][..., :2]).all(axis=(2, 3))
    counts = shown.sum(axis=1)
    xy = _whole(p.mean[rows][:, :, path, :2] - origin, POSITION_M)  # [n, M, P, 2]
    # The first mode shown is stored as it is, the others as differences from it.
    agents, first = np.arange(len(rows)), shown.argmax(axis=1)
    heaviest = xy[agents, first]
    xy = xy - heaviest[:, None]
    xy[agents, first] = heaviest
    paths = xy[shown].reshape(-1, 2)  # [k * P, 2]
    begins = np.arange(0, len(paths), len(path))
    major, minor, angle = _ellipses(
        p.covariance[rows][:, :, ellipse][shown],
        np.broadcast_to(p.sigma_factor_50[rows][:, None, ellipse], (*shown.shape, len(ellipse)))[
            shown
        ],
    )
    return {
        "agents": np.array([len(rows)], dtype=np.int64),
        "agent_track": np.diff(seen.track[rows], prepend=0),
        "agent_source": p.source[rows].astype(np.int64),
        "agent_calibration": p.calibration[rows].astype(np.int64),
        "agent_modes": counts.astype(np.int64),
        "agent_ade": _optional(seen.ade_m[rows], ERROR_M),
        "agent_final": _optional(seen.final_m[rows], ERROR_M),
        "agent_inside": _optional(seen.inside[rows], 1.0),
        "mode_weight": _whole(p.weight[rows][shown], 1.0 / WEIGHTS),
        "mode_x": _differences(paths[:, 0], begins, order=2),
        "mode_y": _differences(paths[:, 1], begins, order=2),
        "ellipse_major": np.diff(major, axis=1, prepend=0).reshape(-1),
        "ellipse_minor": np.diff(minor, axis=1, prepend=0).reshape(-1),
        "ellipse_angle": np.diff(angle, axis=1, prepend=0).reshape(-1),
    }


def _optional(values: Float64Array, step: float) -> Int64Array:
    """Return whole numbers from 1 on, 0 where a value is not known."""
    return np.where(np.isfinite(values), _whole(values, step) + 1, 0)


def _ellipses(
    covariance: Float64Array, sigma_factor_50: Float64Array
) -> tuple[Int64Array, Int64Array, Int64Array]:
    """[k, E] logarithms of half axes and directions of the ellipses."""
    radius = np.sqrt(radius_squared(ELLIPSE_LEVEL)) * sigma_factor(ELLIPSE_LEVEL, sigma_factor_50)
    xx, xy, yy = covariance[..., 0, 0], covariance[..., 0, 1], covariance[..., 1, 1]
    middle, apart = (xx + yy) / 2.0, np.hypot((xx - yy) / 2.0, xy)
    axes = [np.sqrt(np.maximum(middle + sign * apart, 0.0)) * radius for sign in (1.0, -1.0)]
    major, minor = (
        np.rint(ELLIPSE_STEPS * np.log(np.maximum(a, ELLIPSE_BASE_M) / ELLIPSE_BASE_M))
        for a in np.nan_to_num(axes)
    )
    angle = np.nan_to_num(0.5 * np.arctan2(2.0 * xy, xx - yy))
    steps = np.rint(angle / np.pi * ELLIPSE_ANGLES)
    return major.astype(np.int64), minor.astype(np.int64), steps.astype(np.int64)
