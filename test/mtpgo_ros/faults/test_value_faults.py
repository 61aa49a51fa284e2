# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Values that no tracker should send, over real DDS."""

import dataclasses

import numpy as np
import pytest
from fault_harness import OK, WARN
from ros_helpers import message_of

from mtpgo_core.schema import AgentClass

OTHERS = (0, 2, 3)
"""Rows of the road users that are not at fault."""


def spoilt(states, row=1, **values):
    """Return the states with values of one road user replaced."""
    arrays = {name: getattr(states, name).copy() for name in values}
    for name, value in values.items():
        arrays[name][row] = value
    return dataclasses.replace(states, **arrays)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e39], ids=str)
def test_a_position_that_is_no_place(node, value):
    node.fresh().healthy()
    with node.counts(non_finite=1):
        # The road user is known: it is carried on from its last observation.
        node.predict(spoilt(node.states(), position=value), *OTHERS)
    node.healthy()
    assert node.said("input", WARN, "without a finite position")


@pytest.mark.parametrize("name", ["velocity", "acceleration", "yaw", "size", "z", "covariance"])
def test_a_number_beyond_reason_in_any_other_field(node, name):
    node.fresh().healthy()
    # An absurd speed is a reason to reject the observation, anything else is unknown.
    rejected = int(name == "velocity")
    with node.counts(too_fast=rejected, non_finite=0, not_published=0, non_finite_output=0):
        for value in (np.nan, np.inf, 1e38):
            prediction = node.predict(spoilt(node.states(), **{name: value}), *OTHERS)
            assert (np.abs(prediction.z) < 1e8).all()
    node.healthy()


@pytest.mark.parametrize("value", [1e39, -1e39], ids=str)
def test_a_height_beyond_float32(node, value):
    prediction = node.fresh().predict(spoilt(node.states(), z=value))
    assert prediction.z[1] == 0.0  # unknown
    with node.counts(not_published=0):
        node.healthy()


def test_a_zero_quaternion(marker_node):
    marker_node.fresh()
    for _ in range(3):
        states = marker_node.states()
        message = message_of(states, "markers")
        orientation = message.markers[1].pose.orientation
        orientation.z = orientation.w = 0.0
        marker_node.send(message)
        prediction = marker_node.answer(states.stamp_ns).prediction
    # The velocity is estimated from the positions.
    marker_node.check(prediction, states, tolerance_m=2.0)
    assert np.abs(prediction.yaw[1]).max() < 1e-3  # the direction of its motion


def test_an_absurd_speed(node):
    node.fresh().healthy()
    with node.counts(too_fast=1):
        node.predict(spoilt(node.states(), velocity=(5000.0, 0.0)), *OTHERS)
    node.healthy()


@pytest.mark.parametrize("size", [(-4.5, -1.8), (0.0, 0.0), (1e30, 1e-30)], ids=str)
def test_a_negative_zero_or_endless_size(node, size):
    node.fresh()
    node.predict(spoilt(node.states(), size=size))
    node.healthy()


def test_an_unknown_class(node):
    node.fresh()
    with node.counts(unknown_class=1):
        prediction = node.predict(spoilt(node.states(), agent_class=0))
    assert prediction.agent_class.tolist() == [1, 0, 1, 1]


def test_class_255(node):
    node.fresh()
    with node.counts(unknown_class=1):
        prediction = node.predict(spoilt(node.states(), agent_class=255))
    assert prediction.agent_class.tolist() == [1, 0, 1, 1]


def test_a_changing_class(node):
    node.fresh()
    for label in (AgentClass.CAR, AgentClass.PEDESTRIAN, AgentClass.TRUCK, AgentClass.UNKNOWN):
        prediction = node.predict(spoilt(node.states(), agent_class=label))
    assert prediction.agent_class.tolist() == [1, AgentClass.TRUCK, 1, 1]  # the last known


COVARIANCES = {
    "zero": np.zeros((4, 4)),
    "negative": -np.eye(4),
    "indefinite": np.eye(4) + 2.0 * np.eye(4)[::-1],
    "1e38": 1e38 * np.eye(4),
    "singular": np.ones((4, 4)),
    "tiny": 1e-38 * np.eye(4),
}


@pytest.mark.parametrize("name", COVARIANCES)
def test_a_tracker_covariance_that_is_none(node, name):
    node.fresh().healthy()
    with node.counts(not_published=0, non_finite_output=0):
        prediction = node.predict(spoilt(node.states(), covariance=COVARIANCES[name]))
    assert (prediction.covariance[..., 0, 0] < 1e6).all()
    node.healthy()


def test_the_velocity_is_missing(node):
    node.fresh().healthy(steps=3)
    # Estimated from the positions: right to a few decimetres per second.
    node.predict(spoilt(node.states(), velocity=np.nan), *OTHERS)
    states = node.states()
    prediction = node.predict(spoilt(states, velocity=np.nan), *OTHERS)
    assert prediction.mean[1, 0, 0, 2] == pytest.approx(10.0, abs=0.5)


def test_the_velocity_is_zero_while_moving(node):
    node.fresh().healthy(steps=2)
    with node.counts(restarted=0):
        for _ in range(3):
            node.predict(spoilt(node.states(), velocity=0.0), *OTHERS)
    node.healthy()


def test_the_velocity_is_in_the_wrong_frame(node):
    node.fresh().healthy(steps=2)
    with node.counts(restarted=0):
        for _ in range(3):
            # What an object frame turned by a quarter makes of (10, 0) m/s.
            node.predict(spoilt(node.states(), velocity=(0.0, -10.0)), *OTHERS)
    node.healthy()


def test_a_scene_of_bad_values_only(node):
    node.fresh()
    with node.counts(non_finite=4):
        states = node.states()
        node.send(spoilt(states, slice(None), position=np.nan))
    # An empty prediction would look like an empty road.
    assert all(answer.prediction.stamp_ns != states.stamp_ns for answer in node.answers)


def test_utm_coordinates(node):
    shift = np.array([691_000.25, 5_334_000.75])
    node.fresh()
    for _ in range(2):
        states = node.states()
        states = dataclasses.replace(states, position=states.position + shift)
        node.predict(states, tolerance_m=1e-3)


def test_every_level_ends_with_its_fault(node):
    node.fresh()
    for name in ("input", "model", "timing"):
        node.level_while_healthy(name, OK)
