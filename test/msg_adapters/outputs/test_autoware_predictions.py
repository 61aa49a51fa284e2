# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""PredictedObjects of Autoware: paths, modes, frames, time step."""

import dataclasses

import numpy as np
import pytest

from msg_adapters.conversions import yaw_from_quaternions
from msg_adapters.outputs.autoware_predictions import prediction_to_predicted_objects
from msg_adapters.registry import OUTPUTS
from mtpgo_core.errors import MessageError
from mtpgo_core.identity import keys_from_uuid_bytes

TYPE = "autoware_perception_msgs/msg/PredictedObjects"


def rows(path):
    """[H + 1, 4] x, y, z, yaw."""
    points = [(p.position.x, p.position.y, p.position.z) for p in path]
    quaternions = [
        (p.orientation.x, p.orientation.y, p.orientation.z, p.orientation.w) for p in path
    ]
    return np.column_stack([points, yaw_from_quaternions(np.array(quaternions))])


def test_paths_through_cdr(prediction, offline, decoded):
    message = prediction_to_predicted_objects(prediction, offline)
    for again in decoded(message, TYPE).values():
        assert again.header.frame_id == "map"
        assert (again.header.stamp.sec, again.header.stamp.nanosec) == (1_700_000_000, 123_456_789)
        assert len(again.objects) == 3
        for i, item in enumerate(again.objects):
            uuid = np.frombuffer(bytes(item.object_id.uuid), dtype=np.uint8)
            np.testing.assert_array_equal(keys_from_uuid_bytes(uuid)[0], prediction.key[i])
            assert item.classification[0].label == prediction.agent_class[i]
            np.testing.assert_allclose(
                [item.shape.dimensions.x, item.shape.dimensions.y], prediction.size[i]
            )
            paths = item.kinematics.predicted_paths
            confidence = [path.confidence for path in paths]
            np.testing.assert_allclose(confidence, prediction.weight[i], rtol=1e-6)
            assert sum(confidence) == pytest.approx(1.0, abs=1e-6)
            assert confidence == sorted(confidence, reverse=True)
            for mode, path in enumerate(paths):
                assert (path.time_step.sec, path.time_step.nanosec) == (0, 200_000_000)
                found = rows(path.path)
                now = [*prediction.initial[i, :2], prediction.z[i], prediction.initial_yaw[i]]
                np.testing.assert_allclose(found[0], now)
                np.testing.assert_allclose(found[1:, :2], prediction.mean[i, mode, :, :2])
                np.testing.assert_allclose(found[1:, 3], prediction.yaw[i, mode])
                np.testing.assert_allclose(found[:, 2], prediction.z[i])


def test_initial_state_is_in_the_object_frame(prediction, offline):
    still = dataclasses.replace(
        prediction,
        initial=np.tile([5.0, 6.0, -1.0, 10.0], (3, 1)),
        initial_yaw=np.full(3, np.pi / 2),
    )
    kinematics = prediction_to_predicted_objects(still, offline).objects[0].kinematics
    linear = kinematics.initial_twist_with_covariance.twist.linear
    np.testing.assert_allclose([linear.x, linear.y], [10.0, 1.0])
    position = kinematics.initial_pose_with_covariance.pose.position
    assert (position.x, position.y) == (5.0, 6.0)


def test_max_modes_and_modes_out_of_order(prediction, offline):
    message = prediction_to_predicted_objects(prediction, offline, max_modes=2)
    for i, item in enumerate(message.objects):
        confidence = [path.confidence for path in item.kinematics.predicted_paths]
        kept = prediction.weight[i, :2]
        np.testing.assert_allclose(confidence, kept / kept.sum())
    backwards = dataclasses.replace(
        prediction, weight=prediction.weight[:, ::-1], mean=prediction.mean[:, ::-1]
    )
    paths = prediction_to_predicted_objects(backwards, offline).objects[0].kinematics
    np.testing.assert_allclose(
        rows(paths.predicted_paths[0].path)[1:, :2], prediction.mean[0, 0, :, :2]
    )


def test_shifted_horizon_is_brought_back_to_the_constant_step(prediction, offline):
    """At constant velocity the interpolated path is exact wherever the horizon starts."""
    times = 0.13 + 0.2 * np.arange(5)
    velocity = np.array([3.0, -4.0])
    mean = np.zeros((3, 4, 5, 4))
    mean[..., :2] = times[:, None] * velocity
    shifted = dataclasses.replace(
        prediction,
        time_s=times,
        initial=np.zeros((3, 4)),
        initial_yaw=np.full(3, 3.1),
        mean=mean,
        yaw=np.broadcast_to(-3.1 + 0.0 * times, (3, 4, 5)),
    )
    path = prediction_to_predicted_objects(shifted, offline).objects[0].kinematics
    found = rows(path.predicted_paths[0].path)
    at = 0.2 * np.arange(5)
    np.testing.assert_allclose(found[:, :2], at[:, None] * velocity, atol=1e-12)
    # The heading passes over pi, not through zero.
    assert (np.abs(found[:, 3]) >= 3.1 - 1e-9).all()


def test_absent_package_is_named(online):
    with pytest.raises(
        MessageError,
        match="needs the package autoware_perception_msgs, which is not installed: "
        "install ros-jazzy-autoware-perception-msgs",
    ):
        OUTPUTS["autoware"].writer(online)


def test_no_agents(prediction, offline, decoded):
    shared = ("stamp_ns", "frame_id", "time_s")
    names = [f.name for f in dataclasses.fields(prediction) if f.name not in shared]
    empty = dataclasses.replace(prediction, **{n: getattr(prediction, n)[:0] for n in names})
    message = OUTPUTS["autoware"].writer(offline, max_modes=3)(empty)
    for again in decoded(message, TYPE).values():
        assert len(again.objects) == 0
        assert again.header.frame_id == "map"
