# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""ObjectList of perception_msgs: state models, covariance, reference point, round trip."""

import dataclasses
import sys

import numpy as np
import pytest

from msg_adapters.conversions import turn_velocity
from msg_adapters.inputs.ika import PACKAGE
from msg_adapters.registry import INPUTS
from mtpgo_core.errors import MessageError
from mtpgo_core.identity import keys_from_integers
from mtpgo_core.schema import AgentClass

ADAPTER = INPUTS["ika"]
YAW = np.pi / 2
# x y z vel_lon vel_lat acc_lon acc_lat yaw yaw_rate width length height
ISCACTR = [1.0, 2.0, 0.5, 10.0, 1.0, -2.0, 0.0, YAW, 0.1, 1.8, 4.5, 1.5]
# x y z vel_lon vel_lat acc_lon acc_lat roll pitch yaw (three rates) length width height
HEXAMOTION = [1.0, 2.0, 0.5, 10.0, 1.0, -2.0, 0.0, 0.01, 0.02, YAW, 0.3, 0.4, 0.1, 4.5, 1.8, 1.5]


def ika_object(types, model, state, covariance=(), *, labels=((4, 1.0),), reference=(0, 0.0, 0.0)):
    make = types.make
    point, x, y = reference
    return make(
        PACKAGE + "Object",
        id=2**64 - 1,
        existence_probability=1.0,
        state=make(
            PACKAGE + "ObjectState",
            header=make("std_msgs/msg/Header", frame_id="elsewhere"),
            model_id=model,
            sensor_id=np.array([3], dtype=np.uint64),
            continuous_state=types.doubles(state),
            continuous_state_covariance=types.doubles(np.asarray(covariance, float).reshape(-1)),
            classifications=[
                make(PACKAGE + "ObjectClassification", type=kind, probability=probability)
                for kind, probability in labels
            ],
            reference_point=make(
                PACKAGE + "ObjectReferencePoint",
                value=point,
                translation_to_geometric_center=make(
                    "geometry_msgs/msg/Vector3", x=x, y=y, z=0.25
                ),
            ),
        ),
    )


def object_list(types, *objects):
    header = types.make(
        "std_msgs/msg/Header",
        stamp=types.make("builtin_interfaces/msg/Time", sec=8, nanosec=2),
        frame_id="map",
    )
    return types.make(PACKAGE + "ObjectList", header=header, objects=list(objects))


@pytest.mark.parametrize(("model", "state"), [(16, ISCACTR), (17, HEXAMOTION)])
def test_both_state_models_give_the_same_states(offline, decoded, model, state):
    message = object_list(offline, ika_object(offline, model, state))
    for again in decoded(message, ADAPTER.message_type).values():
        states = ADAPTER.to_states(again)
        assert (states.stamp_ns, states.frame_id) == (8_000_000_002, "map")
        np.testing.assert_array_equal(states.key, keys_from_integers([2**64 - 1]))
        np.testing.assert_allclose(states.position, [[1.0, 2.0]])
        np.testing.assert_allclose(states.z, [0.5])
        np.testing.assert_allclose(states.velocity, [[-1.0, 10.0]], atol=1e-12)
        np.testing.assert_allclose(states.acceleration, [[0.0, -2.0]], atol=1e-12)
        np.testing.assert_allclose(states.yaw, [YAW])
        np.testing.assert_allclose(states.size, [[4.5, 1.8]])
        assert np.isnan(states.covariance).all()
        header = ADAPTER.to_states(again, twist_frame="header")
        np.testing.assert_allclose(header.velocity, [[10.0, 1.0]])


def test_covariance_with_values_not_set_and_unknown(offline, decoded):
    covariance = np.zeros((12, 12))
    np.fill_diagonal(covariance, sys.float_info.max)
    covariance[0, 0], covariance[1, 1], covariance[0, 1], covariance[1, 0] = 0.5, 0.3, 0.1, 0.1
    covariance[3, 3], covariance[4, 4], covariance[0, 3], covariance[3, 0] = 4.0, 1.0, 0.7, 0.7
    covariance[5, 5] = covariance[10, 10] = -1.0
    message = object_list(offline, ika_object(offline, 16, ISCACTR, covariance))
    for again in decoded(message, ADAPTER.message_type).values():
        states = ADAPTER.to_states(again)
        # Not set: longitudinal acceleration (so no direction of it stays known) and length.
        assert np.isnan(states.acceleration).all()
        np.testing.assert_allclose(states.size, [[np.nan, 1.8]])
        # At 90 degrees the longitudinal velocity is vy.
        wanted = [
            [0.5, 0.1, 0.0, 0.7],
            [0.1, 0.3, 0.0, 0.0],
            [0.0, 0.0, 1.0, 0.0],
            [0.7, 0.0, 0.0, 4.0],
        ]
        np.testing.assert_allclose(states.covariance[0], wanted, atol=1e-12)


def test_turned_covariance_is_that_of_turned_samples():
    rng = np.random.default_rng(0)
    root = rng.normal(size=(4, 4))
    samples = rng.normal(size=(200_000, 4)) @ root.T
    angle = 0.7
    turn = np.eye(4)
    turn[2:, 2:] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    found = turn_velocity((root @ root.T)[None], np.array([angle]))[0]
    np.testing.assert_allclose(found, np.cov((samples @ turn.T).T), atol=0.1)
    np.testing.assert_allclose(found, turn @ root @ root.T @ turn.T, atol=1e-12)


def test_reference_point_leads_to_the_centre(offline):
    # Rear centre: the middle is 2 m ahead, that is along +y, and 0.5 m to the left, along -x.
    message = object_list(offline, ika_object(offline, 16, ISCACTR, reference=(1, 2.0, 0.5)))
    states = ADAPTER.to_states(message)
    np.testing.assert_allclose(states.position, [[0.5, 4.0]])
    np.testing.assert_allclose(states.z, [0.75])


def test_a_reference_point_without_a_heading_is_not_shifted_anywhere(offline):
    state = [*ISCACTR[:7], float("nan"), *ISCACTR[8:]]
    message = object_list(offline, ika_object(offline, 16, state, reference=(1, 2.0, 0.5)))
    np.testing.assert_array_equal(ADAPTER.to_states(message).position, [[1.0, 2.0]])


def test_objects_that_cannot_be_read_are_counted(offline):
    message = object_list(
        offline,
        ika_object(offline, 2, [1.0, 2.0]),
        ika_object(offline, 16, ISCACTR[:5]),
        ika_object(offline, 16, ISCACTR, np.eye(3)),
        ika_object(offline, 17, HEXAMOTION),
    )
    report = ADAPTER.decode(message)
    assert len(report.states) == 1
    assert report.skipped == {
        "state model 2, neither 16 (ISCACTR) nor 17 (HEXAMOTION)": 1,
        "continuous_state of 5 values, ISCACTR has 12": 1,
        "continuous_state_covariance of 9 values, ISCACTR has 144": 1,
    }


@pytest.mark.parametrize(
    ("labels", "agent_class"),
    [
        ((), AgentClass.UNKNOWN),
        (((4, 0.2), (6, 0.5)), AgentClass.VAN),
        (((1, float("nan")), (4, 0.9)), AgentClass.CAR),
        (((3, 1.0),), AgentClass.MOTORCYCLE),
        (((7, 1.0),), AgentClass.BUS),
        (((11, 1.0),), AgentClass.TRAILER),
        (((9, 1.0),), AgentClass.UNKNOWN),
        (((12, 1.0),), AgentClass.PEDESTRIAN),
        (((13, 1.0),), AgentClass.BICYCLE),
        (((50, 1.0),), AgentClass.CAR),
        (((52, 1.0),), AgentClass.UNKNOWN),
        (((100, 1.0),), AgentClass.UNKNOWN),
    ],
)
def test_classes(offline, labels, agent_class):
    message = object_list(offline, ika_object(offline, 16, ISCACTR, labels=labels))
    assert ADAPTER.to_states(message).agent_class.tolist() == [agent_class]


def test_round_trip(states, offline, decoded, assert_equal):
    for again in decoded(ADAPTER.from_states(states, offline), ADAPTER.message_type).values():
        assert_equal(ADAPTER.to_states(again), states)


def test_unknown_survives_the_round_trip(states, offline, decoded, assert_equal):
    n = len(states)
    bare = dataclasses.replace(
        states,
        velocity=np.full((n, 2), np.nan),
        acceleration=np.full((n, 2), np.nan),
        yaw=np.full(n, np.nan),
        size=np.full((n, 2), np.nan),
        covariance=np.full((n, 4, 4), np.nan),
    )
    for again in decoded(ADAPTER.from_states(bare, offline), ADAPTER.message_type).values():
        assert_equal(ADAPTER.to_states(again), bare)


def test_identity_that_does_not_fit(states, offline):
    wide = dataclasses.replace(states, key=keys_from_integers([1, 2, 3, 4, 2**64]))
    with pytest.raises(MessageError, match="does not fit into the 64-bit id"):
        ADAPTER.from_states(wide, offline)
