# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Input adapters, odometry, lane lines and predictions, from the CDR bytes of a message."""

from __future__ import annotations

import functools

import numpy as np
from fuzz_target import FuzzTarget

from msg_adapters.bags.bag_types import bag_typestore
from msg_adapters.inputs.ego_odometry import EgoOdometry, EgoOptions
from msg_adapters.inputs.lane_markers import lanes_from_markers, lanes_to_markers
from msg_adapters.inputs.odometry import pose_of
from msg_adapters.outputs.autoware_predictions import prediction_to_predicted_objects_bytes
from msg_adapters.predictions import (
    Pose2,
    at_times,
    mixture_moments,
    most_probable,
    prediction_from_cdr,
    prediction_from_predicted_objects,
    prediction_to_pointcloud2,
    to_frame,
)
from msg_adapters.registry import INPUTS
from msg_adapters.types import TypestoreTypes
from mtpgo_core.identity import keys_from_integers
from mtpgo_core.scene.lane_map import LaneMap
from mtpgo_core.schema import AgentClass, Prediction, tracked_states

NOW_NS = 1_700_000_000_000_000_000
ODOMETRY, MARKERS = "nav_msgs/msg/Odometry", "visualization_msgs/msg/MarkerArray"


@functools.cache
def typestore():
    """Return the one typestore, which takes a second to make."""
    return bag_typestore()


def deserialised(data, message_type):
    """Return the message, None if the middleware would not have delivered these bytes."""
    try:
        return typestore().deserialize_cdr(data, message_type)
    except Exception:
        return None


def states(count):
    """Return tracked states as they come from a tracker."""
    draw = np.random.default_rng(0)
    return tracked_states(
        NOW_NS,
        "map",
        keys_from_integers(range(count)),
        draw.uniform(-50, 50, (count, 2)),
        velocity=draw.uniform(-9, 9, (count, 2)),
        yaw=draw.uniform(-3, 3, count),
        size=draw.uniform(1, 5, (count, 2)),
        agent_class=np.full(count, AgentClass.CAR, dtype=np.uint8),
        covariance=np.tile(0.1 * np.eye(4), (count, 1, 1)),
    )


def adapter_target(adapter):
    """Return the target of one input adapter."""

    def run(data):
        message = deserialised(data, adapter.message_type)
        if message is None:
            return
        out = adapter.decode(message, fallback_stamp_ns=NOW_NS).states
        assert out.position.shape == (len(out.key), 2)

    def seeds():
        types = TypestoreTypes(typestore())
        return [
            bytes(
                typestore().serialize_cdr(
                    adapter.from_states(states(count), types), adapter.message_type
                )
            )
            for count in (0, 1, 3)
        ]

    return FuzzTarget(f"cdr_{adapter.name}", run, seeds)


def odometry_target():
    """Return the target of the ego's pose."""

    def run(data):
        message = deserialised(data, ODOMETRY)
        if message is None:
            return
        pose_of(message)
        ego = EgoOdometry(EgoOptions())
        ego.add(message)
        joined = ego.join(states(3), keys_from_integers([1])[0])
        assert np.isfinite(joined.states.position).all() or not joined.known

    def seeds():
        message = TypestoreTypes(typestore()).make(ODOMETRY)
        message.header.frame_id = "map"
        message.header.stamp.sec = NOW_NS // 10**9
        return [bytes(typestore().serialize_cdr(message, ODOMETRY))]

    return FuzzTarget("cdr_odometry", run, seeds)


def lanes_target():
    """Return the target of lane lines."""

    def run(data):
        message = deserialised(data, MARKERS)
        if message is not None:
            LaneMap(lanes_from_markers(message).polylines)

    def seeds():
        lines = [np.array([[0.0, 0.0], [50.0, 1.0], [90.0, 3.0]]), np.array([[0, 4], [90, 6.0]])]
        types = TypestoreTypes(typestore())
        message = lanes_to_markers(lines, types, stamp_ns=NOW_NS, frame_id="map")
        return [bytes(typestore().serialize_cdr(message, MARKERS))]

    return FuzzTarget("cdr_lanes", run, seeds)


def two_agents():
    """Return a prediction of two agents."""
    shape = (2, 2, 3)
    return Prediction(
        stamp_ns=NOW_NS,
        frame_id="map",
        key=keys_from_integers([1, 2]),
        agent_class=np.full(2, AgentClass.CAR, dtype=np.uint8),
        z=np.zeros(2),
        size=np.ones((2, 2)),
        initial=np.zeros((2, 4)),
        initial_yaw=np.zeros(2),
        time_s=np.array([0.2, 0.4, 0.6]),
        weight=np.full((2, 2), 0.5),
        mean=np.ones((*shape, 4)),
        yaw=np.zeros(shape),
        covariance=np.broadcast_to(np.eye(2), (*shape, 2, 2)),
        source=np.zeros(2, dtype=np.uint8),
    )


def predictions_target():
    """Return the target of the public decoder of predictions."""

    def run(data):
        prediction = prediction_from_cdr(data)
        n, modes, _ = prediction.yaw.shape
        with np.errstate(invalid="ignore", over="ignore"):
            later = to_frame(at_times(prediction, [0.0, 0.3, 9.0]), Pose2(1.0, 2.0, 3.0), "odom")
            mean, _ = mixture_moments(prediction)
        assert later.mean.shape == (n, modes, 3, 4)
        assert len(mean) == len(most_probable(prediction)) == n

    def seeds():
        message = prediction_to_pointcloud2(two_agents(), TypestoreTypes(typestore()))
        return [bytes(typestore().serialize_cdr(message, "sensor_msgs/msg/PointCloud2"))]

    return FuzzTarget("cdr_predictions", run, seeds)


def predicted_objects_target():
    """Return the target of predictions in Autoware's message."""

    def run(data):
        for assumes in (False, True):
            prediction = prediction_from_predicted_objects(data, assume_covariance=assumes)
            n, _, steps = prediction.yaw.shape
            assert prediction.weight.shape[0] == prediction.covariance.shape[0] == n
            assert len(prediction.time_s) == steps <= 256

    def seeds():
        return [prediction_to_predicted_objects_bytes(two_agents())]

    return FuzzTarget("cdr_predicted_objects", run, seeds)


def targets():
    """Return the targets of this file."""
    adapters = map(adapter_target, INPUTS.values())
    return [
        *adapters,
        odometry_target(),
        lanes_target(),
        predictions_target(),
        predicted_objects_target(),
    ]
