# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A serialised PredictedObjects of Autoware as arrays, without a message class.

A message of sixty objects with eight paths has tens of thousands of poses, which take rclpy a
tenth of a second to make. In the bytes a path is one block of numbers.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from msg_adapters.conversions import stamp_of
from msg_adapters.wire.cdr_reader import CdrReader
from msg_adapters.wire.input_limits import check_frame, check_room
from mtpgo_core.errors import MessageError
from mtpgo_core.schema import Float64Array

_OBJECT_BYTES = 1000
"""Smallest size of an object; chosen below its three covariances of 36 numbers and its pose, twist
and acceleration, 1016 bytes."""

_PATH_BYTES, _LABEL_BYTES, _POINT_BYTES = 16, 5, 12
"""Smallest sizes of a path without poses, a classification, and a point of a footprint."""

_MOST_OBJECTS, _MOST_LABELS, _MOST_POINTS = 32768, 64, 4096
"""Most objects of a message and paths of an object, classifications and points of a footprint;
chosen far above any publisher: each costs a Python object, whatever its bytes."""

_NAME = "PredictedObjects message"


class PathContent(NamedTuple):
    """A predicted path.

    Attributes:
        poses: [k, 7] position x, y, z (m) and orientation x, y, z, w.
        step_ns: time from one pose to the next (ns).
        confidence: as published.
    """

    poses: Float64Array
    step_ns: int
    confidence: float


class LabelContent(NamedTuple):
    """An ``ObjectClassification``."""

    label: int
    probability: float


class PointContent(NamedTuple):
    """A point, or a vector of dimensions (m)."""

    x: float
    y: float


class FootprintContent(NamedTuple):
    """A ``geometry_msgs/Polygon``."""

    points: list[PointContent]


class ShapeContent(NamedTuple):
    """A ``Shape``."""

    type: int
    footprint: FootprintContent
    dimensions: PointContent


class ObjectContent(NamedTuple):
    """A predicted object.

    Attributes:
        uuid: [16] bytes of its identity.
        classification: its labels.
        pose: [7] at the stamp, as in :class:`PathContent`.
        pose_covariance: [6, 6], all zero where the publisher gives none.
        twist: [6] linear and angular velocity in the object's frame (m/s, rad/s).
        twist_covariance: [6, 6].
        paths: the predicted paths.
        shape: its shape.
    """

    uuid: bytes
    classification: list[LabelContent]
    pose: Float64Array
    pose_covariance: Float64Array
    twist: Float64Array
    twist_covariance: Float64Array
    paths: list[PathContent]
    shape: ShapeContent


class PredictedObjectsContent(NamedTuple):
    """The content of an ``autoware_perception_msgs/PredictedObjects``."""

    stamp_ns: int
    frame_id: str
    objects: list[ObjectContent]


def predicted_objects_from_cdr(data: Any) -> PredictedObjectsContent:
    """Return the content of a serialised ``autoware_perception_msgs/PredictedObjects``.

    Args:
        data: its CDR bytes with the encoding header, of either byte order, as a subscription with
            ``raw=True`` or a bag gives them.

    Raises:
        MessageError: the bytes are not plain CDR, end too early, or claim more than they can hold.
    """
    reader = CdrReader(data, _NAME)
    stamp_ns = stamp_of(*reader.unpack(4, "iI"))
    frame_id = reader.text()
    check_frame(frame_id)
    objects = [_object(reader) for _ in range(_count(reader, "objects", _OBJECT_BYTES))]
    return PredictedObjectsContent(stamp_ns, frame_id, objects)


def _count(reader: CdrReader, what: str, least_bytes: int, most: int = _MOST_OBJECTS) -> int:
    (number,) = reader.unpack(4, "I")
    check_room(_NAME, what, number, least_bytes, reader.rest)
    if number > most:
        raise MessageError(f"{_NAME} has {number} {what}, expected at most {most}")
    return int(number)


def _object(reader: CdrReader) -> ObjectContent:
    (uuid,) = reader.unpack(1, "16s")
    reader.unpack(4, "f")  # probability that it exists
    labels = []
    for _ in range(_count(reader, "classifications", _LABEL_BYTES, _MOST_LABELS)):
        (label,) = reader.unpack(1, "B")
        labels.append(LabelContent(label, *reader.unpack(4, "f")))
    pose, pose_covariance = reader.doubles(7), reader.doubles(6, 6)
    twist, twist_covariance = reader.doubles(6), reader.doubles(6, 6)
    reader.doubles(6 + 36)  # acceleration
    paths = [_path(reader) for _ in range(_count(reader, "paths", _PATH_BYTES))]
    return ObjectContent(
        uuid, labels, pose, pose_covariance, twist, twist_covariance, paths, _shape(reader)
    )


def _path(reader: CdrReader) -> PathContent:
    (poses,) = reader.unpack(4, "I")
    rows = reader.doubles(poses, 7)
    seconds, nanoseconds = reader.unpack(4, "iI")
    return PathContent(rows, seconds * 1_000_000_000 + nanoseconds, *reader.unpack(4, "f"))


def _shape(reader: CdrReader) -> ShapeContent:
    (kind,) = reader.unpack(1, "B")
    points = []
    for _ in range(_count(reader, "points of a footprint", _POINT_BYTES, _MOST_POINTS)):
        x, y, _z = reader.unpack(4, "3f")
        points.append(PointContent(x, y))
    x, y, _height = reader.doubles(3).tolist()
    return ShapeContent(kind, FootprintContent(points), PointContent(x, y))
