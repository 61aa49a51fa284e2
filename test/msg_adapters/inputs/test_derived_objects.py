# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""ObjectArray of derived_object_msgs: header frame, classes, shapes, round trip."""

import dataclasses

import numpy as np
import pytest

from msg_adapters.inputs.derived_objects import PACKAGE
from msg_adapters.registry import INPUTS
from mtpgo_core.errors import MessageError
from mtpgo_core.identity import keys_from_integers
from mtpgo_core.schema import AgentClass

ADAPTER = INPUTS["derived"]


def derived_object(types, **changes):
    """An object at yaw 90 degrees whose twist is (3, 4)."""
    given = {"id": 2**32 - 1, "classification": 6, "shape": (1, [4.5, 1.8, 1.5])} | changes
    make = types.make
    kind, dimensions = given["shape"]
    half = np.pi / 4
    return make(
        PACKAGE + "Object",
        header=make("std_msgs/msg/Header", frame_id="elsewhere"),
        id=given["id"],
        detection_level=1,
        object_classified=True,
        pose=make(
            "geometry_msgs/msg/Pose",
            position=make("geometry_msgs/msg/Point", x=-1.0, y=2.0, z=3.0),
            orientation=make(
                "geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=np.sin(half), w=np.cos(half)
            ),
        ),
        twist=make(
            "geometry_msgs/msg/Twist",
            linear=make("geometry_msgs/msg/Vector3", x=3.0, y=4.0, z=0.0),
        ),
        accel=make(
            "geometry_msgs/msg/Accel",
            linear=make("geometry_msgs/msg/Vector3", x=0.5, y=-0.25, z=0.0),
        ),
        polygon=make(
            "geometry_msgs/msg/Polygon",
            points=[make("geometry_msgs/msg/Point32", x=1.0, y=2.0, z=3.0)],
        ),
        shape=make(
            "shape_msgs/msg/SolidPrimitive", type=kind, dimensions=types.doubles(dimensions)
        ),
        classification=given["classification"],
        classification_certainty=200,
        classification_age=12,
    )


def object_array(types, *objects):
    header = types.make(
        "std_msgs/msg/Header",
        stamp=types.make("builtin_interfaces/msg/Time", sec=5, nanosec=1),
        frame_id="map",
    )
    return types.make(PACKAGE + "ObjectArray", header=header, objects=list(objects))


def test_twist_is_in_the_header_frame(offline, decoded):
    message = object_array(offline, derived_object(offline), derived_object(offline, id=3))
    for again in decoded(message, ADAPTER.message_type).values():
        states = ADAPTER.to_states(again)
        assert (states.stamp_ns, states.frame_id) == (5_000_000_001, "map")
        np.testing.assert_array_equal(states.key, keys_from_integers([2**32 - 1, 3]))
        np.testing.assert_allclose(states.position, [[-1.0, 2.0]] * 2)
        np.testing.assert_allclose(states.z, [3.0, 3.0])
        np.testing.assert_allclose(states.yaw, [np.pi / 2] * 2)
        np.testing.assert_allclose(states.velocity, [[3.0, 4.0]] * 2)
        np.testing.assert_allclose(states.acceleration, [[0.5, -0.25]] * 2)
        np.testing.assert_allclose(states.size, [[4.5, 1.8]] * 2)
        turned = ADAPTER.to_states(again, twist_frame="object")
        np.testing.assert_allclose(turned.velocity, [[-4.0, 3.0]] * 2)


@pytest.mark.parametrize(
    ("label", "agent_class"),
    [
        (4, AgentClass.PEDESTRIAN),
        (5, AgentClass.BICYCLE),
        (6, AgentClass.CAR),
        (7, AgentClass.TRUCK),
        (8, AgentClass.MOTORCYCLE),
        (9, AgentClass.UNKNOWN),
        (0, AgentClass.UNKNOWN),
        (200, AgentClass.UNKNOWN),
    ],
)
def test_classes(offline, label, agent_class):
    message = object_array(offline, derived_object(offline, classification=label))
    assert ADAPTER.to_states(message).agent_class.tolist() == [agent_class]


@pytest.mark.parametrize(
    ("shape", "size"),
    [
        ((2, [0.5]), [1.0, 1.0]),
        ((3, [1.7, 0.25]), [0.5, 0.5]),
        ((4, [1.0, 0.3]), [0.6, 0.6]),
        ((1, []), [np.nan, np.nan]),
        ((5, [1.0]), [np.nan, np.nan]),
    ],
)
def test_shapes(offline, decoded, shape, size):
    message = object_array(offline, derived_object(offline, shape=shape))
    for again in decoded(message, ADAPTER.message_type).values():
        np.testing.assert_allclose(ADAPTER.to_states(again).size, [size])


def test_round_trip(states, offline, decoded, assert_equal):
    wanted = dataclasses.replace(states, covariance=np.full((len(states), 4, 4), np.nan))
    for again in decoded(ADAPTER.from_states(states, offline), ADAPTER.message_type).values():
        assert_equal(ADAPTER.to_states(again), wanted)


def test_identity_that_does_not_fit(states, offline):
    wide = dataclasses.replace(states, key=keys_from_integers([1, 2, 3, 4, 2**32]))
    with pytest.raises(MessageError, match="0x100000000 does not fit into the 32-bit id"):
        ADAPTER.from_states(wide, offline)
