# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""PredictedObjects from bytes, compared with the same message decoded by rosbags."""

import struct

import numpy as np
import pytest

from msg_adapters.conversions import make_header, pose_row
from msg_adapters.inputs.autoware import PACKAGE, SHAPE_POLYGON
from msg_adapters.wire.predicted_objects_bytes import predicted_objects_from_cdr
from mtpgo_core.errors import MessageError

TYPE = PACKAGE + "PredictedObjects"


def pose(types, rng):
    x, y, z, w = rng.normal(size=4)
    return types.make(
        "geometry_msgs/msg/Pose",
        position=types.make("geometry_msgs/msg/Point", x=x, y=y, z=z),
        orientation=types.make("geometry_msgs/msg/Quaternion", x=y, y=z, z=w, w=x),
    )


def vector(types, rng):
    x, y, z = rng.normal(size=3)
    return types.make("geometry_msgs/msg/Vector3", x=x, y=y, z=z)


def item(types, rng, labels, paths, corners):
    """An object of random numbers with so many labels, poses of each path, and corners."""

    def moving(name, field, content):
        inner = types.make(
            f"geometry_msgs/msg/{content}", linear=vector(types, rng), angular=vector(types, rng)
        )
        kind = f"geometry_msgs/msg/{name}WithCovariance"
        return types.make(kind, **{field: inner}, covariance=rng.normal(size=36))

    return types.make(
        PACKAGE + "PredictedObject",
        object_id=types.make(
            "unique_identifier_msgs/msg/UUID", uuid=rng.integers(0, 256, 16).astype(np.uint8)
        ),
        existence_probability=0.5,
        classification=[
            types.make(PACKAGE + "ObjectClassification", label=label, probability=0.25 * label)
            for label in range(labels)
        ],
        kinematics=types.make(
            PACKAGE + "PredictedObjectKinematics",
            initial_pose_with_covariance=types.make(
                "geometry_msgs/msg/PoseWithCovariance",
                pose=pose(types, rng),
                covariance=rng.normal(size=36),
            ),
            initial_twist_with_covariance=moving("Twist", "twist", "Twist"),
            initial_acceleration_with_covariance=moving("Accel", "accel", "Accel"),
            predicted_paths=[
                types.make(
                    PACKAGE + "PredictedPath",
                    path=[pose(types, rng) for _ in range(poses)],
                    time_step=types.make("builtin_interfaces/msg/Duration", sec=1, nanosec=poses),
                    confidence=0.125 * number,
                )
                for number, poses in enumerate(paths)
            ],
        ),
        shape=types.make(
            PACKAGE + "Shape",
            type=SHAPE_POLYGON,
            footprint=types.make(
                "geometry_msgs/msg/Polygon",
                points=[
                    types.make("geometry_msgs/msg/Point32", x=float(i), y=0.5 * i, z=0.0)
                    for i in range(corners)
                ],
            ),
            dimensions=vector(types, rng),
        ),
    )


def message_of(types, frame_id="map"):
    """Objects with every number of elements that changes the alignment of what follows."""
    rng = np.random.default_rng(5)
    objects = [
        item(types, rng, labels, paths, corners)
        for labels, paths, corners in (
            (1, (4, 2), 0),
            (0, (), 3),
            (2, (0,), 1),
            (3, (1, 0, 5), 0),
        )
    ]
    header = make_header(types, 1_700_000_000_123_456_789, frame_id)
    return types.make(TYPE, header=header, objects=objects)


@pytest.mark.parametrize("frame_id", ["", "map", "odom2"])
@pytest.mark.parametrize("little_endian", [True, False])
def test_all_that_is_read_is_what_rosbags_reads(typestore, offline, frame_id, little_endian):
    message = message_of(offline, frame_id)
    data = bytes(typestore.serialize_cdr(message, TYPE, little_endian=little_endian))
    found = predicted_objects_from_cdr(data)
    wanted = typestore.deserialize_cdr(data, TYPE)
    assert (found.stamp_ns, found.frame_id) == (1_700_000_000_123_456_789, frame_id)
    assert len(found.objects) == len(wanted.objects) == 4
    for one, other in zip(found.objects, wanted.objects, strict=True):
        k = other.kinematics
        assert one.uuid == bytes(other.object_id.uuid)
        labels = [(c.label, c.probability) for c in other.classification]
        assert one.classification == labels
        given, twist = k.initial_pose_with_covariance, k.initial_twist_with_covariance
        np.testing.assert_array_equal(one.pose, pose_row(given.pose))
        np.testing.assert_array_equal(one.pose_covariance.ravel(), given.covariance)
        np.testing.assert_array_equal(one.twist_covariance.ravel(), twist.covariance)
        linear, angular = twist.twist.linear, twist.twist.angular
        np.testing.assert_array_equal(
            one.twist, [linear.x, linear.y, linear.z, angular.x, angular.y, angular.z]
        )
        assert len(one.paths) == len(k.predicted_paths)
        for path, expected in zip(one.paths, k.predicted_paths, strict=True):
            rows = [pose_row(p) for p in expected.path]
            np.testing.assert_array_equal(path.poses, np.reshape(rows, (-1, 7)))
            assert path.step_ns == 1_000_000_000 + len(expected.path)
            assert path.confidence == expected.confidence
        size = other.shape.dimensions
        assert one.shape.type == SHAPE_POLYGON
        assert one.shape.dimensions == (size.x, size.y)
        assert one.shape.footprint.points == [(p.x, p.y) for p in other.shape.footprint.points]


def test_bytes_that_end_early_are_refused(typestore, offline):
    data = bytes(typestore.serialize_cdr(message_of(offline), TYPE))
    for length in range(0, len(data), 7):
        with pytest.raises(MessageError):
            predicted_objects_from_cdr(data[:length])


def test_a_message_that_claims_more_than_its_bytes_can_hold_is_refused(typestore, offline):
    data = bytearray(typestore.serialize_cdr(message_of(offline), TYPE))
    objects = data.index(struct.pack("<I", 4), 16)
    data[objects : objects + 4] = struct.pack("<I", 4_000_000_000)
    with pytest.raises(MessageError, match="claims 4000000000 objects, expected at most 5 in"):
        predicted_objects_from_cdr(bytes(data))


@pytest.mark.parametrize(
    ("labels", "corners", "words"),
    [
        (65, 0, "65 classifications, expected at most 64"),
        (1, 4097, "4097 points of a footprint, expected at most 4096"),
    ],
)
def test_more_than_any_publisher_has_is_refused(typestore, offline, labels, corners, words):
    one = item(offline, np.random.default_rng(5), labels, (), corners)
    message = offline.make(TYPE, header=make_header(offline, 1, "map"), objects=[one])
    with pytest.raises(MessageError, match=words):
        predicted_objects_from_cdr(bytes(typestore.serialize_cdr(message, TYPE)))
