# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""derived_object_msgs/ObjectArray, as CARLA and AutonomouStuff drivers publish it.

CARLA expresses twist and acceleration along the header frame's axes.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from msg_adapters.adapter import Decoded, InputAdapter
from msg_adapters.conversions import (
    known,
    make_header,
    make_pose,
    make_vector,
    pose_row,
    positive,
    small_integer_keys,
    stamp_to_ns,
    table,
    to_header_frame,
    yaw_from_quaternions,
)
from msg_adapters.types import Types
from msg_adapters.wire.input_limits import Content
from mtpgo_core.identity import keys_from_integers
from mtpgo_core.schema import AgentClass, TrackedStates, tracked_states

PACKAGE = "derived_object_msgs/msg/"
_BOX, _SPHERE, _CYLINDER, _CONE = 1, 2, 3, 4
_TRACKED = 1
_UNKNOWN_LABEL, _OTHER_VEHICLE = 0, 9
_CLASSES = {
    4: AgentClass.PEDESTRIAN,
    5: AgentClass.BICYCLE,
    6: AgentClass.CAR,
    7: AgentClass.TRUCK,
    8: AgentClass.MOTORCYCLE,
}
_LABELS = {int(ours): label for label, ours in _CLASSES.items()} | {
    int(AgentClass.VAN): 6,
    int(AgentClass.BUS): _OTHER_VEHICLE,
    int(AgentClass.TRAILER): _OTHER_VEHICLE,
}


def decode_objects(
    message: Any, *, twist_frame: str = "header", fallback_stamp_ns: int | None = None
) -> Decoded:
    """Return the tracked states of an ObjectArray.

    Args:
        message: ``derived_object_msgs/ObjectArray``; its header holds for every object.
        twist_frame: ``header`` as in CARLA, or ``object``.
        fallback_stamp_ns: not needed, the message carries its time.
    """
    objects = message.objects
    pose = table([pose_row(item.pose) for item in objects], 7)
    motion = table(
        [
            (item.twist.linear.x, item.twist.linear.y, item.accel.linear.x, item.accel.linear.y)
            for item in objects
        ],
        4,
    )
    yaw = yaw_from_quaternions(pose[:, 3:])
    states = tracked_states(
        stamp_to_ns(message.header.stamp),
        str(message.header.frame_id),
        keys_from_integers([int(item.id) for item in objects]),
        pose[:, :2],
        agent_class=np.array(
            [_CLASSES.get(int(item.classification), 0) for item in objects], dtype=np.uint8
        ),
        z=pose[:, 2],
        velocity=to_header_frame(motion[:, :2], yaw, twist_frame),
        acceleration=to_header_frame(motion[:, 2:], yaw, twist_frame),
        yaw=yaw,
        size=positive(table([_size(item.shape) for item in objects], 2)),
    )
    return Decoded(states)


def states_to_objects(states: TrackedStates, types: Types) -> Any:
    """Return an ObjectArray; classes it does not have become "other vehicle" or unknown.

    Raises:
        MessageError: a key does not fit into the message's uint32 id.
    """
    header = make_header(types, states.stamp_ns, states.frame_id)
    ids = small_integer_keys(states.key, 32, "derived_object_msgs/Object")
    objects = []
    for i, number in enumerate(ids):
        label = _LABELS.get(int(states.agent_class[i]), _UNKNOWN_LABEL)
        length, width = states.size[i]
        objects.append(
            types.make(
                PACKAGE + "Object",
                header=header,
                id=number,
                detection_level=_TRACKED,
                object_classified=label != _UNKNOWN_LABEL,
                pose=make_pose(types, states.position[i], states.z[i], states.yaw[i]),
                twist=types.make(
                    "geometry_msgs/msg/Twist", linear=make_vector(types, *states.velocity[i])
                ),
                accel=types.make(
                    "geometry_msgs/msg/Accel", linear=make_vector(types, *states.acceleration[i])
                ),
                shape=types.make(
                    "shape_msgs/msg/SolidPrimitive",
                    type=_BOX,
                    dimensions=types.doubles([known(length), known(width), 0.0]),
                ),
                classification=label,
                classification_certainty=255 if label != _UNKNOWN_LABEL else 0,
            )
        )
    return types.make(PACKAGE + "ObjectArray", header=header, objects=objects)


def _size(shape: Any) -> tuple[float, float]:
    """Return length and width (m) of a primitive, NaN where its dimensions are not filled."""
    kind, dimensions = int(shape.type), [float(value) for value in shape.dimensions]
    if kind == _BOX and len(dimensions) >= 2:
        return dimensions[0], dimensions[1]
    if kind == _SPHERE and dimensions:
        return 2.0 * dimensions[0], 2.0 * dimensions[0]
    if kind in (_CYLINDER, _CONE) and len(dimensions) >= 2:
        return 2.0 * dimensions[1], 2.0 * dimensions[1]
    return np.nan, np.nan


DERIVED = InputAdapter(
    name="derived",
    message_type=PACKAGE + "ObjectArray",
    twist_frame="header",
    content=Content("objects", 150),
    decoder=decode_objects,
    builder=states_to_objects,
)
