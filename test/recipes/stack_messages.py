# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Messages filled as the nodes of the stacks fill them, field by field, without our own builders.

The scene is the same in each: a car that turns left, a car that stands, a pedestrian.
"""

from __future__ import annotations

import math
import uuid
from typing import Any, NamedTuple

import numpy as np

from msg_adapters.types import TypestoreTypes

START_NS = 1_700_000_000_000_000_000
GEOMETRY = "geometry_msgs/msg/"
SENSOR_POSE = (10.0, 5.0, math.pi / 2)
"""Where the sensor of the vision tracker stands in the fixed frame: x, y (m), yaw (rad)."""


class Body(NamedTuple):
    """One road user at a time: metres, metres per second, radians, fixed frame."""

    number: int
    kind: str
    x: float
    y: float
    yaw: float
    speed: float
    yaw_rate: float
    length: float
    width: float


def scene(time_s: float) -> list[Body]:
    """Return everybody at a time after :data:`START_NS`."""
    rate, speed = 0.2, 8.0
    yaw, radius = rate * time_s, speed / rate
    x, y = radius * math.sin(yaw), radius * (1.0 - math.cos(yaw))
    return [
        Body(1, "car", x, y, yaw, speed, rate, 4.5, 1.8),
        Body(2, "car", 25.0, -6.0, math.pi / 2, 0.0, 0.0, 4.2, 1.7),
        Body(3, "pedestrian", 5.0 + 1.2 * time_s, 10.0, 0.0, 1.2, 0.0, 0.6, 0.6),
    ]


def uuid_of(number: int) -> bytes:
    """Return the UUID that the trackers here give a body."""
    return uuid.uuid5(uuid.NAMESPACE_OID, str(number)).bytes


class StackMessages:
    """Makes the messages of a time, and their bytes.

    Args:
        typestore: the types, with the definitions of the stacks.
    """

    def __init__(self, typestore: Any) -> None:
        self.typestore = typestore
        self._make = TypestoreTypes(typestore).make

    def octets(self, stack: str, time_s: float) -> bytes:
        """Return the CDR bytes of a stack's message on :func:`scene`."""
        name = TYPES[stack]
        return bytes(self.typestore.serialize_cdr(getattr(self, stack)(time_s), name))

    def autoware(self, time_s: float) -> Any:
        """TrackedObjects of multi_object_tracker: twist in the object's frame, map frame."""
        package = "autoware_perception_msgs/msg/"
        objects = []
        for body in scene(time_s):
            car = body.kind == "car"
            kinematics = self._make(
                package + "TrackedObjectKinematics",
                pose_with_covariance=self._make(
                    GEOMETRY + "PoseWithCovariance",
                    pose=self._pose(body.x, body.y, body.yaw if car else 0.0, z=0.7),
                    covariance=np.diag([0.09, 0.04, 0.1, 0.01, 0.01, 0.02]).reshape(36),
                ),
                twist_with_covariance=self._make(
                    GEOMETRY + "TwistWithCovariance",
                    twist=self._twist((body.speed, 0.0), body.yaw_rate),
                    covariance=np.diag([0.25, 0.16, 0.1, 0.01, 0.01, 0.02]).reshape(36),
                ),
                orientation_availability=2 if car else 0,
                is_stationary=body.speed == 0.0,
            )
            labels = [(1, 0.8), (2, 0.2)] if car else [(7, 1.0)]
            objects.append(
                self._make(
                    package + "TrackedObject",
                    object_id=self._uuid(body.number),
                    existence_probability=0.9,
                    classification=[
                        self._make(
                            package + "ObjectClassification", label=label, probability=probability
                        )
                        for label, probability in labels
                    ],
                    kinematics=kinematics,
                    shape=self._make(
                        package + "Shape",
                        type=0 if car else 1,
                        dimensions=self._vector(body.length, body.width, 1.6),
                    ),
                )
            )
        return self._make(
            package + "TrackedObjects", header=self._header(time_s, "map"), objects=objects
        )

    def carla(self, time_s: float) -> Any:
        """ObjectArray of the ros-bridge: twist along the axes of map, no detection level."""
        package = "derived_object_msgs/msg/"
        objects = []
        for body in scene(time_s):
            cos, sin = math.cos(body.yaw), math.sin(body.yaw)
            turn = body.speed * body.yaw_rate
            car = body.kind == "car"
            objects.append(
                self._make(
                    package + "Object",
                    header=self._header(time_s, "map"),
                    id=100 + body.number,
                    object_classified=True,
                    pose=self._pose(body.x, body.y, body.yaw),
                    twist=self._twist((body.speed * cos, body.speed * sin), body.yaw_rate),
                    accel=self._make(
                        GEOMETRY + "Accel", linear=self._vector(-turn * sin, turn * cos)
                    ),
                    shape=self._make(
                        "shape_msgs/msg/SolidPrimitive",
                        type=1,
                        dimensions=np.array([body.length, body.width, 1.6]),
                    ),
                    classification=6 if car else 4,
                    classification_certainty=255,
                    classification_age=7,
                )
            )
        return self._make(
            package + "ObjectArray", header=self._header(time_s, "map"), objects=objects
        )

    def vision(self, time_s: float) -> Any:
        """Detection3DArray of a tracker behind a lidar: its frame, ids, COCO's class numbers."""
        package = "vision_msgs/msg/"
        x0, y0, yaw0 = SENSOR_POSE
        cos, sin = math.cos(yaw0), math.sin(yaw0)
        detections = []
        for body in scene(time_s):
            dx, dy = body.x - x0, body.y - y0
            pose = self._pose(cos * dx + sin * dy, cos * dy - sin * dx, body.yaw - yaw0, z=-0.4)
            result = self._make(
                package + "ObjectHypothesisWithPose",
                hypothesis=self._make(
                    package + "ObjectHypothesis",
                    class_id={"car": "2", "pedestrian": "0"}[body.kind],
                    score=0.87,
                ),
                pose=self._make(GEOMETRY + "PoseWithCovariance", pose=pose),
            )
            detections.append(
                self._make(
                    package + "Detection3D",
                    header=self._header(time_s, "lidar"),
                    results=[result],
                    bbox=self._make(
                        package + "BoundingBox3D",
                        center=pose,
                        size=self._vector(body.length, body.width, 1.6),
                    ),
                    id=str(body.number),
                )
            )
        return self._make(
            package + "Detection3DArray",
            header=self._header(time_s, "lidar"),
            detections=detections,
        )

    def _header(self, time_s: float, frame_id: str) -> Any:
        seconds, nanoseconds = divmod(START_NS + round(time_s * 1e9), 1_000_000_000)
        stamp = self._make("builtin_interfaces/msg/Time", sec=seconds, nanosec=nanoseconds)
        return self._make("std_msgs/msg/Header", stamp=stamp, frame_id=frame_id)

    def _pose(self, x: float, y: float, yaw: float, z: float = 0.0) -> Any:
        return self._make(
            GEOMETRY + "Pose",
            position=self._make(GEOMETRY + "Point", x=x, y=y, z=z),
            orientation=self._make(
                GEOMETRY + "Quaternion", x=0.0, y=0.0, z=math.sin(yaw / 2), w=math.cos(yaw / 2)
            ),
        )

    def _twist(self, linear: tuple[float, float], yaw_rate: float) -> Any:
        return self._make(
            GEOMETRY + "Twist",
            linear=self._vector(*linear),
            angular=self._vector(0.0, 0.0, yaw_rate),
        )

    def _vector(self, x: float, y: float, z: float = 0.0) -> Any:
        return self._make(GEOMETRY + "Vector3", x=x, y=y, z=z)

    def _uuid(self, number: int) -> Any:
        octets = np.frombuffer(uuid_of(number), dtype=np.uint8)
        return self._make("unique_identifier_msgs/msg/UUID", uuid=octets)


TYPES = {
    "autoware": "autoware_perception_msgs/msg/TrackedObjects",
    "carla": "derived_object_msgs/msg/ObjectArray",
    "vision": "vision_msgs/msg/Detection3DArray",
}
"""Message type of each stack's objects."""
