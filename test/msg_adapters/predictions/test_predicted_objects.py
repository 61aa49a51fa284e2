# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Predictions from PredictedObjects: round trip, covariance, uneven paths, what is refused."""

import dataclasses
import math

import numpy as np
import pytest

from msg_adapters.conversions import flat36, make_duration, make_pose
from msg_adapters.inputs.autoware import PACKAGE
from msg_adapters.outputs.autoware_predictions import (
    prediction_to_predicted_objects,
    prediction_to_predicted_objects_bytes,
)
from msg_adapters.predictions import prediction_from_predicted_objects
from mtpgo_core.errors import MessageError
from mtpgo_core.prediction.constant_velocity import ConstantVelocityNoise
from mtpgo_core.risk.footprint_overlap import is_covariance
from mtpgo_core.schema import Prediction, Source

TYPE = PACKAGE + "PredictedObjects"


@pytest.fixture
def read(typestore):
    """A function from a message object to the prediction in its bytes."""

    def read(message, **options):
        data = bytes(typestore.serialize_cdr(message, TYPE))
        return prediction_from_predicted_objects(data, **options)

    return read


@pytest.fixture
def message(prediction, offline):
    """The predictor's message; its covariances are all zero."""
    return prediction_to_predicted_objects(prediction, offline)


def with_covariance(message, position, velocity):
    """Fill the covariances [2, 2] of pose and twist of every object."""
    for item in message.objects:
        k = item.kinematics
        k.initial_pose_with_covariance.covariance = flat36(np.array(position, float))
        k.initial_twist_with_covariance.covariance = flat36(np.array(velocity, float))
    return message


def path(types, places, step_s, confidence):
    """A path through [k, 3] x, y, yaw."""
    return types.make(
        PACKAGE + "PredictedPath",
        path=[make_pose(types, np.array([x, y]), 0.0, yaw) for x, y, yaw in places],
        time_step=make_duration(types, step_s),
        confidence=confidence,
    )


def test_what_the_predictor_publishes_comes_back(prediction):
    found = prediction_from_predicted_objects(prediction_to_predicted_objects_bytes(prediction))
    assert (found.stamp_ns, found.frame_id) == (prediction.stamp_ns, "map")
    for name in ("key", "agent_class"):
        np.testing.assert_array_equal(getattr(found, name), getattr(prediction, name))
    for name in ("z", "size", "initial", "initial_yaw", "time_s", "weight", "yaw"):
        np.testing.assert_allclose(
            getattr(found, name), getattr(prediction, name), rtol=1e-6, err_msg=name
        )
    np.testing.assert_allclose(found.mean[..., :2], prediction.mean[..., :2])
    way = np.diff(prediction.mean[..., :2], axis=2)
    np.testing.assert_allclose(found.mean[:, :, 1:, 2:], way / 0.2)
    assert (found.source == Source.OTHER).all()


def test_without_a_covariance_there_is_none_unless_one_is_assumed(message, read):
    assert np.isnan(read(message).covariance).all()
    assumed = read(message, assume_covariance=True)
    noise, t = ConstantVelocityNoise(), assumed.time_s
    spread = np.linalg.eigvalsh(assumed.covariance)
    start = noise.position_std_m**2 + noise.velocity_std_mps**2 * t**2
    shape = spread[..., 0].shape
    across, along = (start + q * t**3 / 3 for q in (noise.across_m2ps3, noise.along_m2ps3))
    np.testing.assert_allclose(spread[..., 0], np.broadcast_to(across, shape))
    np.testing.assert_allclose(spread[..., 1], np.broadcast_to(along, shape))


@pytest.mark.parametrize("lacking", ["position", "velocity"])
def test_half_a_covariance_is_none(message, read, lacking):
    given = {"position": 0.1 * np.eye(2), "velocity": 0.1 * np.eye(2)}
    given[lacking] = np.zeros((2, 2))
    assert np.isnan(read(with_covariance(message, **given)).covariance).all()


def test_the_covariance_grows_and_turns_with_the_path(prediction, offline, read):
    """A car heads north and turns right: what was along y is along x behind the bend."""
    north = math.pi / 2
    one = dataclasses.replace(
        first(prediction),
        initial=np.array([[0.0, 0.0, 0.0, 10.0]]),
        initial_yaw=np.array([north]),
    )
    message = prediction_to_predicted_objects(one, offline)
    message.objects[0].kinematics.predicted_paths = [
        path(offline, [(0, 0, north), (0, 10, north), (10, 15, 0.0)], 1.0, 1.0)
    ]
    # Position in the frame of the map, velocity in that of the car.
    with_covariance(message, np.diag([0.04, 0.25]), np.diag([1.0, 0.01]))
    found = read(message)
    noise = ConstantVelocityNoise()

    def grown(t):
        along = 0.25 + 1.0 * t**2 + noise.along_m2ps3 * t**3 / 3
        return along, 0.04 + 0.01 * t**2 + noise.across_m2ps3 * t**3 / 3

    along, across = grown(1.0)
    np.testing.assert_allclose(found.covariance[0, 0, 0], np.diag([across, along]), atol=1e-12)
    along, across = grown(2.0)
    np.testing.assert_allclose(found.covariance[0, 0, 1], np.diag([along, across]), atol=1e-12)
    np.testing.assert_allclose(found.mean[0, 0, :, 2:], [[0.0, 10.0], [10.0, 5.0]], atol=1e-12)


def first(prediction: Prediction) -> Prediction:
    """Return the prediction of the first agent."""
    shared = ("stamp_ns", "frame_id", "time_s")
    names = [f.name for f in dataclasses.fields(prediction) if f.name not in shared]
    return dataclasses.replace(prediction, **{n: getattr(prediction, n)[:1] for n in names})


def test_a_path_that_ends_early_is_unknown_beyond_its_end(message, read):
    short = message.objects[0].kinematics.predicted_paths[1]
    short.path = short.path[:3]
    found = read(message, assume_covariance=True)
    assert np.isfinite(found.mean[0, 1, :2, :2]).all()
    assert np.isnan(found.mean[0, 1, 2:, :2]).all()
    assert np.isnan(found.covariance[0, 1, 2:]).all()
    assert is_covariance(found.covariance[1:]).all()
    assert np.isfinite(found.weight).all()


def test_paths_with_other_time_steps_are_interpolated(prediction, offline, read):
    message = prediction_to_predicted_objects(first(prediction), offline)
    message.objects[0].kinematics.predicted_paths = [
        path(offline, [(0, 0, 3.0), (10, 0, -3.0)], 1.0, 0.75),
        path(offline, [(x, 0, 0) for x in (0, 1, 2, 3)], 0.4, 0.25),
    ]
    found = read(message)
    np.testing.assert_allclose(found.time_s, [0.4, 0.8, 1.2])
    np.testing.assert_allclose(found.mean[0, 0, :, 0], [4.0, 8.0, np.nan])
    np.testing.assert_allclose(found.mean[0, 1, :, 0], [1.0, 2.0, 3.0])
    # From 3.0 to -3.0 the short way, through pi.
    turn = 2 * (math.pi - 3.0)
    np.testing.assert_allclose(
        np.cos(found.yaw[0, 0, :2]), np.cos(3.0 + np.array([0.4, 0.8]) * turn)
    )


def test_paths_come_in_the_order_of_their_confidence(message, read, prediction):
    message.objects[0].kinematics.predicted_paths.reverse()
    found = read(message)
    np.testing.assert_allclose(found.weight, prediction.weight, rtol=1e-6)
    np.testing.assert_allclose(found.mean[..., :2], prediction.mean[..., :2])


@pytest.mark.parametrize("confidence", [0.0, 1.0, -1.0, math.nan, math.inf])
def test_confidences_that_are_no_probabilities_are_unknown(message, read, confidence):
    """They sum to one by Autoware's conventions; what another publisher means is not known."""
    for one in message.objects[1].kinematics.predicted_paths:
        one.confidence = confidence
    found = read(message)
    assert np.isnan(found.weight[1]).all()
    np.testing.assert_allclose(found.weight[[0, 2]].sum(axis=1), 1.0, rtol=1e-6)


def test_an_object_without_paths_is_unknown(message, read):
    message.objects[2].kinematics.predicted_paths = []
    found = read(message)
    assert np.isnan(found.weight[2]).all()
    assert np.isnan(found.mean[2]).all()
    for item in message.objects:
        item.kinematics.predicted_paths = []
    found = read(message)
    assert found.mean.shape == (3, 1, 1, 4)
    assert np.isnan(found.weight).all()


def test_a_message_without_objects_is_no_problem(message, read):
    message.objects = []
    found = read(message)
    assert len(found) == 0
    assert found.frame_id == "map"


def test_an_orientation_that_is_not_set_is_unknown(message, read):
    first_path = message.objects[0].kinematics.predicted_paths[0]
    first_path.path[2].orientation.z = first_path.path[2].orientation.w = 0.0
    found = read(message, assume_covariance=True)
    assert np.isnan(found.yaw[0, 0]).tolist() == [False, True, False, False, False]
    assert np.isnan(found.covariance[0, 0, 1]).all()


@pytest.mark.parametrize(
    ("step_s", "poses", "sentence"),
    [
        (0.0, 3, "a path with the time_step 0 s, expected more than 0"),
        (-0.5, 3, "a path with the time_step -0.5 s, expected more than 0"),
        (0.2, 300, "4 paths of an object and 299 steps of 0.2 s, expected at most 256 each"),
        (1e-6, 3, "steps of 1e-06 s, expected at most 256 each"),
    ],
)
def test_time_steps_and_counts_that_make_no_sense_are_refused(
    message, read, offline, step_s, poses, sentence
):
    message.objects[0].kinematics.predicted_paths[0] = path(
        offline, [(i, 0, 0) for i in range(poses)], step_s, 1.0
    )
    with pytest.raises(MessageError, match=sentence):
        read(message)


@pytest.mark.parametrize(("step_s", "end"), [(1e-9, "2e-09"), (1e9, r"2e\+09")])
def test_paths_that_end_at_once_or_never_are_refused(message, read, offline, step_s, end):
    (one, *_) = message.objects
    one.kinematics.predicted_paths = [path(offline, [(i, 0, 0) for i in range(3)], step_s, 1.0)]
    message.objects = [one]
    with pytest.raises(MessageError, match=f"end after {end} s, expected 0.001 to 10000 s"):
        read(message)


def test_few_poses_do_not_make_large_arrays(message, read, offline):
    k = message.objects[0].kinematics
    k.predicted_paths = [path(offline, [], 0.2, 0.0)] * 256
    message.objects[1].kinematics.predicted_paths = [
        path(offline, [(i, 0, 0) for i in range(200)], 0.2, 1.0)
    ]
    message.objects = [*message.objects] * 10
    with pytest.raises(MessageError, match="256 modes and 199 steps, expected at least"):
        read(message)
