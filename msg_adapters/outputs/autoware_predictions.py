# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""autoware_perception_msgs/PredictedObjects as output.

Its conventions: paths sorted by falling confidence, confidences summing to one, ``path[0]`` the
present pose and a constant time step. It has no covariance; the canonical cloud has it.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from msg_adapters.conversions import known, make_duration, make_header, make_vector, rotate
from msg_adapters.inputs.autoware import (
    PACKAGE,
    SHAPE_BOX,
    autoware_label,
    make_classification,
    make_shape,
    make_uuid,
)
from msg_adapters.types import Types
from msg_adapters.wire.cdr import CdrWriter, write_header
from mtpgo_core.identity import key_to_uuid_bytes
from mtpgo_core.prediction.output_assembly import heaviest_modes
from mtpgo_core.schema import Float64Array, Prediction


def prediction_to_predicted_objects(
    prediction: Prediction, types: Types, *, max_modes: int | None = None
) -> Any:
    """Return the prediction as PredictedObjects.

    Args:
        prediction: what to publish; stamp and frame go into the header.
        types: source of message classes.
        max_modes: the heaviest modes to keep, renormalised; None keeps all.

    Raises:
        MessageError: autoware_perception_msgs is not available.
    """
    content = _content(prediction, max_modes)
    time_step = make_duration(types, content.step_s)
    objects = []
    for i in range(len(prediction)):
        paths = [
            types.make(
                PACKAGE + "PredictedPath",
                path=[_pose(types, *row) for row in content.poses[i, mode].tolist()],
                time_step=time_step,
                confidence=confidence,
            )
            for mode, confidence in enumerate(content.confidence[i].tolist())
        ]
        kinematics = types.make(
            PACKAGE + "PredictedObjectKinematics",
            initial_pose_with_covariance=types.make(
                "geometry_msgs/msg/PoseWithCovariance",
                pose=_pose(types, *content.now[i].tolist()),
            ),
            initial_twist_with_covariance=types.make(
                "geometry_msgs/msg/TwistWithCovariance",
                twist=types.make(
                    "geometry_msgs/msg/Twist", linear=make_vector(types, *content.velocity[i])
                ),
            ),
            predicted_paths=paths,
        )
        objects.append(
            types.make(
                PACKAGE + "PredictedObject",
                object_id=make_uuid(prediction.key[i], types),
                existence_probability=1.0,
                classification=[make_classification(int(prediction.agent_class[i]), types)],
                kinematics=kinematics,
                shape=make_shape(prediction.size[i], types),
            )
        )
    return types.make(
        PACKAGE + "PredictedObjects",
        header=make_header(types, prediction.stamp_ns, prediction.frame_id),
        objects=objects,
    )


def prediction_to_predicted_objects_bytes(
    prediction: Prediction, *, max_modes: int | None = None
) -> bytes:
    """Return the bytes of :func:`prediction_to_predicted_objects`, many times faster."""
    content = _content(prediction, max_modes)
    steps = content.poses.shape[2]
    time_step = divmod(round(content.step_s * 1e9), 1_000_000_000)
    nothing = np.zeros(36 + 6 + 36)
    writer = CdrWriter()
    write_header(writer, prediction.stamp_ns, prediction.frame_id)
    writer.pack(4, "I", len(prediction))
    for i in range(len(prediction)):
        writer.block(1, key_to_uuid_bytes(prediction.key[i]))
        label = autoware_label(int(prediction.agent_class[i]))
        writer.pack(4, "fIB3xf", 1.0, 1, label, 1.0)
        writer.doubles(content.now[i])
        writer.doubles(nothing[:36])
        writer.doubles(content.velocity[i])
        writer.doubles(nothing[: 4 + 36])  # the rest of the twist, its covariance
        writer.doubles(nothing[: 6 + 36])  # acceleration
        writer.pack(4, "I", content.poses.shape[1])
        for mode, confidence in enumerate(content.confidence[i].tolist()):
            writer.pack(4, "I", steps)
            writer.doubles(content.poses[i, mode])
            writer.pack(4, "iIf", *time_step, confidence)
        writer.pack(1, "B", SHAPE_BOX)
        writer.pack(4, "I", 0)  # footprint
        length, width = prediction.size[i]
        writer.pack(8, "3d", known(length), known(width), 0.0)
    return bytes(writer)


class _Content(NamedTuple):
    """The content of the message, for both ways of writing it.

    Attributes:
        step_s: constant time step (s).
        poses: [n, modes, steps, 7] position x, y, z and orientation x, y, z, w, the present first.
        now: [n, 7] the present pose.
        velocity: [n, 2] in the object frame (m/s).
        confidence: [n, modes], falling.
    """

    step_s: float
    poses: Float64Array
    now: Float64Array
    velocity: Float64Array
    confidence: Float64Array


def _content(prediction: Prediction, max_modes: int | None) -> _Content:
    weight, modes = heaviest_modes(prediction, max_modes)
    order = np.argsort(-weight, axis=1, kind="stable")
    step_s, rows = _paths(prediction, modes)
    poses = np.zeros((*rows.shape[:3], 7))
    poses[..., :3], poses[..., 5:] = rows[..., :3], rows[..., 3:]
    now = np.zeros((len(prediction), 7))
    yaw = _yaw_or_zero(prediction.initial_yaw)
    now[:, :2], now[:, 2] = prediction.initial[:, :2], _height(prediction)
    now[:, 5], now[:, 6] = np.sin(yaw / 2.0), np.cos(yaw / 2.0)
    velocity = rotate(prediction.initial[:, 2:], -yaw)
    return _Content(
        step_s=step_s,
        poses=np.take_along_axis(poses, order[:, :, None, None], axis=1),
        now=now,
        velocity=np.nan_to_num(velocity, nan=0.0),
        confidence=np.take_along_axis(weight, order, axis=1),
    )


def _paths(prediction: Prediction, modes: int) -> tuple[float, Float64Array]:
    """Return the time step (s) and [n, modes, 1 + H', 5] x, y, z, sin and cos of yaw / 2.

    The first row is the present pose. Where the horizon does not start one step after the stamp
    (delay compensation), the path is interpolated onto multiples of the step.
    """
    times, n = prediction.time_s, len(prediction)
    shape = (n, modes, 1 + len(times))
    rows = np.empty((*shape, 5))
    rows[..., 0, :2] = prediction.initial[:, None, :2]
    rows[..., 1:, :2] = prediction.mean[:, :modes, :, :2]
    rows[..., 2] = _height(prediction)[:, None, None]
    yaw = np.empty(shape)
    yaw[..., 0] = _yaw_or_zero(prediction.initial_yaw)[:, None]
    yaw[..., 1:] = _yaw_or_zero(prediction.yaw[:, :modes])
    step_s = float(times[1] - times[0]) if len(times) > 1 else float(times[0])
    if not np.allclose(times, step_s * np.arange(1, len(times) + 1), atol=1e-6):
        grid = step_s * np.arange(int(times[-1] / step_s + 1e-6) + 1)
        known_at = np.concatenate([[0.0], times])
        after = np.clip(np.searchsorted(known_at, grid), 1, len(known_at) - 1)
        part = (grid - known_at[after - 1]) / (known_at[after] - known_at[after - 1])
        rows = rows[:, :, after - 1] + part[:, None] * (rows[:, :, after] - rows[:, :, after - 1])
        difference = yaw[:, :, after] - yaw[:, :, after - 1]
        shortest = np.arctan2(np.sin(difference), np.cos(difference))
        yaw = yaw[:, :, after - 1] + part * shortest
    rows[..., 3], rows[..., 4] = np.sin(yaw / 2.0), np.cos(yaw / 2.0)
    return step_s, rows


def _height(prediction: Prediction) -> Float64Array:
    return np.where(np.isfinite(prediction.z), prediction.z, 0.0)


def _yaw_or_zero(yaw: Float64Array) -> Float64Array:
    return np.where(np.isfinite(yaw), yaw, 0.0)


def _pose(types: Types, *row: float) -> Any:
    x, y, z, qx, qy, qz, qw = row
    return types.make(
        "geometry_msgs/msg/Pose",
        position=types.make("geometry_msgs/msg/Point", x=x, y=y, z=z),
        orientation=types.make("geometry_msgs/msg/Quaternion", x=qx, y=qy, z=qz, w=qw),
    )
