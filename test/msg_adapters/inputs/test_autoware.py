# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""TrackedObjects of Autoware: object frame, shapes, labels, unknown values, round trip."""

import dataclasses

import numpy as np
import pytest

from msg_adapters.inputs.autoware import PACKAGE
from msg_adapters.registry import INPUTS
from mtpgo_core.identity import key_to_int, keys_from_uuid_bytes
from mtpgo_core.schema import AgentClass

ADAPTER = INPUTS["autoware"]
UUID = np.arange(16, dtype=np.uint8)


def tracked_object(types, **changes):
    """One object at (1, 2, 0.5) with yaw 90 degrees, driving 10 m/s forwards and 1 to its left."""
    given = {
        "uuid": UUID,
        "availability": 2,
        "stationary": False,
        "labels": [(1, 0.2), (2, 0.7), (0, 0.1)],
        "shape": (0, (4.5, 1.8), []),
        "orientation": (0.0, 0.0, np.sin(np.pi / 4), np.cos(np.pi / 4)),
        "twist": (10.0, 1.0),
        "pose_covariance": np.zeros(36),
        "twist_covariance": np.zeros(36),
    } | changes
    make = types.make
    x, y, z, w = given["orientation"]
    shape, (length, width), corners = given["shape"]
    kinematics = make(
        PACKAGE + "TrackedObjectKinematics",
        pose_with_covariance=make(
            "geometry_msgs/msg/PoseWithCovariance",
            pose=make(
                "geometry_msgs/msg/Pose",
                position=make("geometry_msgs/msg/Point", x=1.0, y=2.0, z=0.5),
                orientation=make("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w),
            ),
            covariance=given["pose_covariance"],
        ),
        twist_with_covariance=make(
            "geometry_msgs/msg/TwistWithCovariance",
            twist=make(
                "geometry_msgs/msg/Twist",
                linear=make(
                    "geometry_msgs/msg/Vector3", x=given["twist"][0], y=given["twist"][1], z=0.0
                ),
            ),
            covariance=given["twist_covariance"],
        ),
        acceleration_with_covariance=make(
            "geometry_msgs/msg/AccelWithCovariance",
            accel=make(
                "geometry_msgs/msg/Accel",
                linear=make("geometry_msgs/msg/Vector3", x=-2.0, y=0.0, z=0.0),
            ),
        ),
        orientation_availability=given["availability"],
        is_stationary=given["stationary"],
    )
    return make(
        PACKAGE + "TrackedObject",
        object_id=make("unique_identifier_msgs/msg/UUID", uuid=given["uuid"]),
        existence_probability=0.9,
        classification=[
            make(PACKAGE + "ObjectClassification", label=label, probability=probability)
            for label, probability in given["labels"]
        ],
        kinematics=kinematics,
        shape=make(
            PACKAGE + "Shape",
            type=shape,
            footprint=make(
                "geometry_msgs/msg/Polygon",
                points=[make("geometry_msgs/msg/Point32", x=x, y=y, z=0.0) for x, y in corners],
            ),
            dimensions=make("geometry_msgs/msg/Vector3", x=length, y=width, z=1.5),
        ),
    )


def tracked_objects(types, *objects):
    header = types.make(
        "std_msgs/msg/Header",
        stamp=types.make("builtin_interfaces/msg/Time", sec=3, nanosec=250_000_000),
        frame_id="map",
    )
    return types.make(PACKAGE + "TrackedObjects", header=header, objects=list(objects))


@pytest.fixture
def read(offline, decoded, assert_equal):
    """States of one object, checked to be the same from every decoder's reading of the bytes."""

    def run(*, twist_frame="default", **changes):
        message = tracked_objects(offline, tracked_object(offline, **changes))
        found = [
            ADAPTER.to_states(again, twist_frame=twist_frame)
            for again in decoded(message, ADAPTER.message_type).values()
        ]
        assert len(found) == 2
        assert_equal(found[1], found[0], rtol=0)
        return found[0]

    return run


def test_object_frame_twist_at_ninety_degrees(read):
    states = read()
    assert states.stamp_ns == 3_250_000_000
    assert states.frame_id == "map"
    np.testing.assert_allclose(states.position, [[1.0, 2.0]])
    np.testing.assert_allclose(states.z, [0.5])
    np.testing.assert_allclose(states.yaw, [np.pi / 2])
    np.testing.assert_allclose(states.velocity, [[-1.0, 10.0]], atol=1e-12)
    np.testing.assert_allclose(states.acceleration, [[0.0, -2.0]], atol=1e-12)
    np.testing.assert_allclose(states.size, [[4.5, 1.8]])
    assert states.agent_class.tolist() == [AgentClass.TRUCK]
    np.testing.assert_array_equal(states.key, keys_from_uuid_bytes(UUID))
    assert key_to_int(states.key[0]) == int.from_bytes(bytes(UUID), "big")


def test_header_frame_on_demand(read):
    states = read(twist_frame="header")
    np.testing.assert_allclose(states.velocity, [[10.0, 1.0]])


@pytest.mark.parametrize("availability", [0, 1])
def test_without_full_orientation_the_direction_is_unknown(read, availability):
    states = read(availability=availability)
    for unknown in (states.yaw, states.velocity, states.acceleration):
        assert np.isnan(unknown).all()
    np.testing.assert_allclose(states.position, [[1.0, 2.0]])
    taken = read(availability=availability, twist_frame="header")
    np.testing.assert_allclose(taken.velocity, [[10.0, 1.0]])


@pytest.mark.parametrize("availability", [0, 2])
def test_stationary_objects_have_zero_velocity(read, availability):
    states = read(availability=availability, stationary=True)
    np.testing.assert_array_equal(states.velocity, [[0.0, 0.0]])
    np.testing.assert_array_equal(states.acceleration, [[0.0, 0.0]])


def test_covariance_turns_with_the_object(read):
    pose, twist = np.zeros((6, 6)), np.zeros((6, 6))
    pose[:2, :2] = [[0.5, 0.1], [0.1, 0.3]]
    twist[:2, :2] = [[4.0, 0.5], [0.5, 1.0]]
    covariances = {"pose_covariance": pose.reshape(36), "twist_covariance": twist.reshape(36)}
    states = read(**covariances)
    wanted = [
        [0.5, 0.1, 0.0, 0.0],
        [0.1, 0.3, 0.0, 0.0],
        [0.0, 0.0, 1.0, -0.5],
        [0.0, 0.0, -0.5, 4.0],
    ]
    np.testing.assert_allclose(states.covariance[0], wanted, atol=1e-12)
    straight = read(twist_frame="header", **covariances)
    np.testing.assert_allclose(straight.covariance[0, 2:, 2:], twist[:2, :2])


def test_a_covariance_that_was_not_filled_is_unknown(read):
    assert np.isnan(read().covariance).all()
    pose = np.diag([0.5, 0.3, 0, 0, 0, 0.0]).reshape(36)
    half = read(pose_covariance=pose).covariance[0]
    np.testing.assert_allclose(half[:2, :2], np.diag([0.5, 0.3]))
    assert np.isnan(half[2:]).all()
    assert np.isnan(half[:, 2:]).all()


@pytest.mark.parametrize(
    ("shape", "size"),
    [
        ((0, (4.5, 1.8), []), [4.5, 1.8]),
        ((1, (0.7, 0.7), []), [0.7, 0.7]),
        ((2, (0.0, 0.0), [(-1.0, -0.5), (3.0, -0.5), (3.0, 0.25)]), [4.0, 0.75]),
        ((0, (0.0, 0.0), []), [np.nan, np.nan]),
    ],
)
def test_shapes(read, shape, size):
    np.testing.assert_allclose(read(shape=shape).size, [size])


@pytest.mark.parametrize(
    ("labels", "agent_class"),
    [([], 0), ([(9, 1.0)], 0), ([(250, 1.0)], 0), ([(7, 0.1), (8, 0.2)], 8)],
)
def test_labels(read, labels, agent_class):
    assert read(labels=labels).agent_class.tolist() == [agent_class]


def test_unset_quaternion_and_nan_fields_are_unknown(read):
    states = read(orientation=(0.0, 0.0, 0.0, 0.0), twist=(np.nan, np.inf))
    assert np.isnan(states.yaw).all()
    assert np.isnan(states.velocity).all()


def test_round_trip(states, offline, decoded, assert_equal):
    message = ADAPTER.from_states(states, offline)
    wanted = dataclasses.replace(states, covariance=without_cross_terms(states.covariance))
    for again in decoded(message, ADAPTER.message_type).values():
        assert_equal(ADAPTER.to_states(again), wanted)


def without_cross_terms(covariance):
    out = covariance.copy()
    out[:, :2, 2:] = out[:, 2:, :2] = 0.0
    return out


def test_empty_array_keeps_stamp_and_frame(offline, decoded):
    for again in decoded(tracked_objects(offline), ADAPTER.message_type).values():
        states = ADAPTER.to_states(again)
        assert (len(states), states.stamp_ns, states.frame_id) == (0, 3_250_000_000, "map")


@pytest.mark.parametrize("labels", [[(7, np.nan), (1, 0.9)], [(1, 0.9), (7, np.nan)]])
def test_a_probability_that_is_no_number_decides_nothing(offline, labels):
    states = ADAPTER.to_states(tracked_objects(offline, tracked_object(offline, labels=labels)))
    assert states.agent_class.tolist() == [AgentClass.CAR]


@pytest.mark.parametrize("corner", [0, 1, 2])
def test_a_polygon_with_a_corner_that_is_nowhere_has_no_length(offline, corner):
    corners = [(0.0, 0.0), (1.0, 1.0), (3.0, 2.0)]
    corners[corner] = (np.nan, corners[corner][1])
    states = ADAPTER.to_states(
        tracked_objects(offline, tracked_object(offline, shape=(2, (0.0, 0.0), corners)))
    )
    np.testing.assert_array_equal(states.size, [[np.nan, 2.0]])
