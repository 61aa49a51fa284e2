# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""autoware_perception_msgs/TrackedObjects.

Twist and acceleration are in the OBJECT frame, so they are rotated by the yaw; where the
orientation is not fully available (its sign or all of it is unknown) the yaw, and with it the
direction of the velocity, is unknown, and the core estimates both from the positions.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from msg_adapters.adapter import Decoded, InputAdapter
from msg_adapters.conversions import (
    finite,
    flat36,
    known,
    make_header,
    make_pose,
    make_vector,
    most_probable,
    planar_block,
    pose_row,
    positive,
    rotate,
    stamp_to_ns,
    state_covariance,
    table,
    to_header_frame,
    yaw_from_quaternions,
)
from msg_adapters.types import Types
from msg_adapters.wire.input_limits import Content
from mtpgo_core.identity import key_to_uuid_bytes, keys_from_uuid_bytes
from mtpgo_core.schema import AgentClass, Float64Array, TrackedStates, tracked_states

PACKAGE = "autoware_perception_msgs/msg/"
ORIENTATION_UNAVAILABLE, ORIENTATION_AVAILABLE = 0, 2
SHAPE_BOX, SHAPE_CYLINDER, SHAPE_POLYGON = 0, 1, 2
_LAST_SHARED_LABEL = AgentClass.ANIMAL


def decode_tracked_objects(
    message: Any, *, twist_frame: str = "object", fallback_stamp_ns: int | None = None
) -> Decoded:
    """Return the tracked states of a TrackedObjects message.

    Args:
        message: ``autoware_perception_msgs/TrackedObjects``.
        twist_frame: ``object`` as in Autoware, or ``header``.
        fallback_stamp_ns: not needed, the message carries its time.
    """
    objects = message.objects
    kinematics = [item.kinematics for item in objects]
    poses = [k.pose_with_covariance for k in kinematics]
    twists = [k.twist_with_covariance for k in kinematics]
    pose = table([pose_row(item.pose) for item in poses], 7)
    motion = table(
        [
            (*_planar(t.twist.linear), *_planar(k.acceleration_with_covariance.accel.linear))
            for k, t in zip(kinematics, twists, strict=True)
        ],
        4,
    )
    oriented = np.array(
        [int(k.orientation_availability) == ORIENTATION_AVAILABLE for k in kinematics], dtype=bool
    )
    yaw = np.where(oriented, yaw_from_quaternions(pose[:, 3:]), np.nan)
    velocity = to_header_frame(motion[:, :2], yaw, twist_frame)
    acceleration = to_header_frame(motion[:, 2:], yaw, twist_frame)
    stationary = np.array([bool(k.is_stationary) for k in kinematics], dtype=bool)
    velocity[stationary] = 0.0
    acceleration[stationary] = 0.0
    uuids = b"".join(bytes(item.object_id.uuid) for item in objects)
    return Decoded(
        tracked_states(
            stamp_to_ns(message.header.stamp),
            str(message.header.frame_id),
            keys_from_uuid_bytes(np.frombuffer(uuids, dtype=np.uint8)),
            pose[:, :2],
            agent_class=np.array(
                [object_class(item.classification) for item in objects], np.uint8
            ),
            z=pose[:, 2],
            velocity=velocity,
            acceleration=acceleration,
            yaw=yaw,
            size=positive(table([object_size(item.shape) for item in objects], 2)),
            covariance=state_covariance(
                table([planar_block(item.covariance) for item in poses], 4).reshape(-1, 2, 2),
                table([planar_block(item.covariance) for item in twists], 4).reshape(-1, 2, 2),
                yaw,
                twist_frame,
            ),
        )
    )


def states_to_tracked_objects(states: TrackedStates, types: Types) -> Any:
    """Return a TrackedObjects message; UUIDs are the keys, velocities are in the object frame.

    Without a known yaw the orientation is marked unavailable, and the velocity is lost.
    """
    back = -states.yaw
    velocity, acceleration = rotate(states.velocity, back), rotate(states.acceleration, back)
    cos, sin = np.cos(states.yaw), np.sin(states.yaw)
    turn = np.stack([np.stack([cos, sin], -1), np.stack([-sin, cos], -1)], -2)
    spread = turn @ states.covariance[:, 2:, 2:] @ np.swapaxes(turn, -1, -2)
    objects = []
    for i in range(len(states)):
        oriented = bool(np.isfinite(states.yaw[i]))
        kinematics = types.make(
            PACKAGE + "TrackedObjectKinematics",
            pose_with_covariance=types.make(
                "geometry_msgs/msg/PoseWithCovariance",
                pose=make_pose(
                    types, states.position[i], states.z[i], states.yaw[i] if oriented else 0.0
                ),
                covariance=flat36(states.covariance[i, :2, :2]),
            ),
            twist_with_covariance=types.make(
                "geometry_msgs/msg/TwistWithCovariance",
                twist=types.make(
                    "geometry_msgs/msg/Twist", linear=make_vector(types, *velocity[i])
                ),
                covariance=flat36(spread[i]),
            ),
            acceleration_with_covariance=types.make(
                "geometry_msgs/msg/AccelWithCovariance",
                accel=types.make(
                    "geometry_msgs/msg/Accel", linear=make_vector(types, *acceleration[i])
                ),
            ),
            orientation_availability=(
                ORIENTATION_AVAILABLE if oriented else ORIENTATION_UNAVAILABLE
            ),
        )
        objects.append(
            types.make(
                PACKAGE + "TrackedObject",
                object_id=make_uuid(states.key[i], types),
                existence_probability=1.0,
                classification=[make_classification(int(states.agent_class[i]), types)],
                kinematics=kinematics,
                shape=make_shape(states.size[i], types),
            )
        )
    return types.make(
        PACKAGE + "TrackedObjects",
        header=make_header(types, states.stamp_ns, states.frame_id),
        objects=objects,
    )


def make_uuid(key: np.ndarray, types: Types) -> Any:
    """Return ``unique_identifier_msgs/UUID`` of a [4] key."""
    octets = np.frombuffer(key_to_uuid_bytes(key), dtype=np.uint8).copy()
    return types.make("unique_identifier_msgs/msg/UUID", uuid=octets)


def autoware_label(agent_class: int) -> int:
    """Return Autoware's label of a class; vans, which Autoware does not have, are cars."""
    return int(AgentClass.CAR if agent_class == AgentClass.VAN else agent_class)


def make_classification(agent_class: int, types: Types) -> Any:
    """Return an ``ObjectClassification`` with probability one."""
    label = autoware_label(agent_class)
    return types.make(PACKAGE + "ObjectClassification", label=label, probability=1.0)


def make_shape(size: Float64Array, types: Types) -> Any:
    """Return a box ``Shape`` of length and width (m), zero if unknown; the height is zero."""
    return types.make(
        PACKAGE + "Shape",
        type=SHAPE_BOX,
        dimensions=make_vector(types, known(size[0]), known(size[1])),
    )


def _planar(vector: Any) -> tuple[float, float]:
    return vector.x, vector.y


def object_class(classification: Any) -> int:
    """Return our class of a list of ``ObjectClassification``, that of the most probable label."""
    best = most_probable(classification, lambda item: item.probability)
    if best is None:
        return int(AgentClass.UNKNOWN)
    label = int(best.label)
    # Larger labels are hazards, not road users; 9 is another class here.
    return label if label <= _LAST_SHARED_LABEL else int(AgentClass.UNKNOWN)


def object_size(shape: Any) -> tuple[float, float]:
    """Return length and width of a ``Shape`` (m), of a polygon those of the box around it."""
    length, width = shape.dimensions.x, shape.dimensions.y
    if int(shape.type) == SHAPE_CYLINDER:
        return length, length
    if int(shape.type) == SHAPE_POLYGON and len(shape.footprint.points) > 0:
        corners = finite([(point.x, point.y) for point in shape.footprint.points])
        length, width = np.ptp(corners, axis=0).tolist()  # NaN with a corner that is nowhere
    return length, width


AUTOWARE = InputAdapter(
    name="autoware",
    message_type=PACKAGE + "TrackedObjects",
    twist_frame="object",
    content=Content("objects", 1000),
    decoder=decode_tracked_objects,
    builder=states_to_tracked_objects,
)
