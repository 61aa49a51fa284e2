# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Tracked objects in a MarkerArray: identity, actions, times, round trip."""

import dataclasses

import numpy as np
import pytest

from msg_adapters.inputs.object_markers import marker_keys
from msg_adapters.registry import INPUTS
from mtpgo_core.class_map import class_map
from mtpgo_core.errors import MessageError
from mtpgo_core.identity import keys_from_integers
from mtpgo_core.schema import AgentClass

ADAPTER = INPUTS["markers"]
CUBE, CYLINDER, TEXT = 1, 3, 9
ADD, DELETE, DELETE_ALL = 0, 2, 3


def marker(types, ns, number, *, kind=CUBE, action=ADD, sec=4, frame="map", text="", x=1.0):
    make = types.make
    return make(
        "visualization_msgs/msg/Marker",
        header=make(
            "std_msgs/msg/Header",
            stamp=make("builtin_interfaces/msg/Time", sec=sec, nanosec=0),
            frame_id=frame,
        ),
        ns=ns,
        id=number,
        type=kind,
        action=action,
        pose=make(
            "geometry_msgs/msg/Pose",
            position=make("geometry_msgs/msg/Point", x=x, y=2.0, z=0.5),
            orientation=make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=1.0, w=0.0),
        ),
        scale=make("geometry_msgs/msg/Vector3", x=4.0, y=1.5, z=1.0),
        text=text,
    )


def markers(types, *items):
    return types.make("visualization_msgs/msg/MarkerArray", markers=list(items))


def test_boxes_become_tracks(offline, decoded):
    message = markers(
        offline,
        marker(offline, "car", 7),
        marker(offline, "labels", 7, kind=TEXT),
        marker(offline, "pedestrian", 7, kind=CYLINDER, x=5.0, sec=3),
        marker(offline, "", -2, text="Truck"),
    )
    for again in decoded(message, ADAPTER.message_type, with_rclpy=True).values():
        report = ADAPTER.decode(again)
        states = report.states
        assert (states.stamp_ns, states.frame_id) == (4_000_000_000, "map")
        np.testing.assert_allclose(states.position, [[1.0, 2.0], [5.0, 2.0], [1.0, 2.0]])
        np.testing.assert_allclose(states.yaw, [np.pi] * 3)
        np.testing.assert_allclose(states.size, [[4.0, 1.5]] * 3)
        assert states.agent_class.tolist() == [
            AgentClass.CAR,
            AgentClass.PEDESTRIAN,
            AgentClass.TRUCK,
        ]
        assert len(np.unique(states.key, axis=0)) == 3
        assert states.key[:, 0].tolist() == [7, 7, 2**32 - 2]
        assert states.key[2, 1:].tolist() == [0, 0, 0]
        assert report.skipped == {"marker of type 9, neither CUBE nor CYLINDER": 1}
        assert np.isnan(states.velocity).all()


def test_namespace_and_id_are_the_identity():
    key = marker_keys(["a", "b", "a", "a"], [1, 1, 2, 1])
    assert key[0].tolist() == key[3].tolist()
    assert len(np.unique(key, axis=0)) == 3


def test_actions_are_followed_in_order(offline):
    message = markers(
        offline,
        marker(offline, "", 1),
        marker(offline, "", 0, action=DELETE_ALL),
        marker(offline, "", 2),
        marker(offline, "", 3),
        marker(offline, "", 3, action=DELETE),
        marker(offline, "", 9, action=DELETE),
        marker(offline, "", 5, action=7),
    )
    report = ADAPTER.decode(message)
    assert report.states.key[:, 0].tolist() == [2]
    assert report.removed[:, 0].tolist() == [3, 9]
    assert report.cleared
    assert report.skipped == {"marker with action 7": 1}


def test_a_class_map_reads_namespace_and_then_text(offline):
    message = markers(
        offline,
        marker(offline, "vehicle.car", 1, text="tracked"),
        marker(offline, "tracks", 2, text="human.pedestrian.adult"),
        marker(offline, "", 3, text="car"),
    )
    found = ADAPTER.to_states(message, class_map=class_map("nuscenes")).agent_class
    assert found.tolist() == [AgentClass.CAR, AgentClass.PEDESTRIAN, AgentClass.CAR]
    assert ADAPTER.to_states(message).agent_class.tolist() == [0, 0, AgentClass.CAR]


def test_time_of_an_array_without_objects(offline, decoded):
    for again in decoded(markers(offline), ADAPTER.message_type, with_rclpy=True).values():
        states = ADAPTER.to_states(again, fallback_stamp_ns=55)
        assert (len(states), states.stamp_ns) == (0, 55)
        with pytest.raises(MessageError, match="nothing in it says the time"):
            ADAPTER.to_states(again)


def test_stamp_zero_means_now(offline):
    message = markers(offline, marker(offline, "", 1, sec=0))
    assert ADAPTER.to_states(message, fallback_stamp_ns=77).stamp_ns == 77
    assert ADAPTER.to_states(message).stamp_ns == 0


def test_two_frames_are_refused(offline):
    message = markers(offline, marker(offline, "", 1), marker(offline, "", 2, frame="odom"))
    with pytest.raises(MessageError, match="frames 'map', 'odom', expected one"):
        ADAPTER.to_states(message)


def without_motion(states):
    unknown = np.full((len(states), 2), np.nan)
    return dataclasses.replace(
        states,
        velocity=unknown,
        acceleration=unknown,
        covariance=np.full((len(states), 4, 4), np.nan),
    )


def test_round_trip(states, offline, decoded, assert_equal):
    wide = dataclasses.replace(
        states, key=keys_from_integers([1, 2**32 - 1, 2**31, 2**64 + 5, 2**128 - 1])
    )
    message = ADAPTER.from_states(wide, offline)
    for again in decoded(message, ADAPTER.message_type, with_rclpy=True).values():
        assert_equal(ADAPTER.to_states(again), without_motion(wide))


def test_rclpy_classes_with_field_checks(states, online, typestore, assert_equal):
    serialization = pytest.importorskip("rclpy.serialization")
    data = serialization.serialize_message(ADAPTER.from_states(states, online))
    found = ADAPTER.to_states(typestore.deserialize_cdr(data, ADAPTER.message_type))
    assert_equal(found, without_motion(states))
