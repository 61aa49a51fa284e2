# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""autoware_perception_msgs/PredictedObjects as output.

Its conventions: paths sorted by falling confidence, confidences summing to one, ``path[0]`` the
present pose and a constant time step. There is no room for covariance; the canonical cloud has it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from msg_adapters.autoware import PACKAGE, make_classification, make_shape, make_uuid
from msg_adapters.common import known, make_duration, make_header, make_vector, rotate
from msg_adapters.predictions import strongest_modes
from msg_adapters.types import Types
from mtpgo_core.schema import Float64Array, Prediction


def prediction_to_predicted_objects(
    prediction: Prediction, types: Types, *, max_modes: int | None = None
) -> Any:
    """The prediction as PredictedObjects.

    Args:
        prediction: what to publish; stamp and frame go into the header.
        types: where message classes come from.
        max_modes: the strongest modes to keep, renormalised; None keeps all.

    Raises:
        MessageError: autoware_perception_msgs is not available.
    """
    weight, modes = strongest_modes(prediction, max_modes)
    step_s, poses = _paths(prediction, modes)
    time_step = make_duration(types, step_s)
    velocity = rotate(prediction.initial[:, 2:], -_yaw_or_zero(prediction.initial_yaw))
    objects = []
    for i in range(len(prediction)):
        paths = [
            types.make(
                PACKAGE + "PredictedPath",
                path=[_pose(types, *row) for row in poses[i, mode].tolist()],
                time_step=time_step,
                confidence=float(weight[i, mode]),
            )
            for mode in np.argsort(-weight[i], kind="stable")
        ]
        kinematics = types.make(
            PACKAGE + "PredictedObjectKinematics",
            initial_pose_with_covariance=types.make(
                "geometry_msgs/msg/PoseWithCovariance", pose=_pose(types, *poses[i, 0, 0].tolist())
            ),
            initial_twist_with_covariance=types.make(
                "geometry_msgs/msg/TwistWithCovariance",
                twist=types.make(
                    "geometry_msgs/msg/Twist",
                    linear=make_vector(types, known(velocity[i, 0]), known(velocity[i, 1])),
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


def _paths(prediction: Prediction, modes: int) -> tuple[float, Float64Array]:
    """The constant time step (s) and [n, modes, 1 + H', 5] rows x, y, z, sin and cos of yaw / 2.

    The first row is the present pose. Where the horizon does not start one step after the stamp
    (delay compensation), the path is interpolated onto multiples of the step.
    """
    times, n = prediction.time_s, len(prediction)
    shape = (n, modes, 1 + len(times))
    rows = np.empty((*shape, 5))
    rows[..., 0, :2] = prediction.initial[:, None, :2]
    rows[..., 1:, :2] = prediction.mean[:, :modes, :, :2]
    rows[..., 2] = np.where(np.isfinite(prediction.z), prediction.z, 0.0)[:, None, None]
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


def _yaw_or_zero(yaw: Float64Array) -> Float64Array:
    return np.where(np.isfinite(yaw), yaw, 0.0)


def _pose(types: Types, x: float, y: float, z: float, sin: float, cos: float) -> Any:
    return types.make(
        "geometry_msgs/msg/Pose",
        position=types.make("geometry_msgs/msg/Point", x=x, y=y, z=z),
        orientation=types.make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=sin, w=cos),
    )
