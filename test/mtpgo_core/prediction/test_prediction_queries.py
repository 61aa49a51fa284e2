# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Questions of consumers, by hand-worked numbers and against the obvious slow computation."""

import dataclasses
import uuid

import numpy as np
import pytest

from mtpgo_core.frames import Pose2
from mtpgo_core.identity import keys_from_integers, keys_from_texts
from mtpgo_core.prediction.prediction_queries import (
    agent_row,
    at_times,
    first_places,
    mixture_moments,
    most_probable,
    most_probable_mode,
    to_frame,
    without_missing_steps,
)
from mtpgo_core.schema import Prediction

UUID = uuid.UUID("00112233-4455-6677-8899-aabbccddeeff")


@pytest.fixture
def prediction():
    """Two agents, two modes, three steps at 1, 2 and 3 s; agent 0 drives at (10, 0) m/s."""
    mean = np.zeros((2, 2, 3, 4))
    mean[0, 0] = [[10, 0, 10, 0], [20, 0, 10, 0], [30, 0, 10, 0]]
    mean[0, 1] = [[10, 2, 10, 2], [20, 4, 10, 2], [30, 6, 10, 2]]
    mean[1, :, :, 1] = 50.0
    covariance = np.zeros((2, 2, 3, 2, 2))
    covariance[...] = np.diag([1.0, 4.0])
    covariance *= np.array([1.0, 2.0, 3.0])[:, None, None]
    yaw = np.zeros((2, 2, 3))
    yaw[1, 0] = [3.0, -3.0, -2.8]
    return Prediction(
        stamp_ns=5_000_000_000,
        frame_id="map",
        key=np.concatenate([keys_from_integers([17]), keys_from_texts([str(UUID)])]),
        agent_class=np.array([1, 7], np.uint8),
        z=np.zeros(2),
        size=np.full((2, 2), np.nan),
        initial=np.full((2, 4), np.nan),
        initial_yaw=np.full(2, np.nan),
        time_s=np.array([1.0, 2.0, 3.0]),
        weight=np.array([[0.75, 0.25], [0.5, 0.5]]),
        mean=mean,
        yaw=yaw,
        covariance=covariance,
        source=np.zeros(2, np.uint8),
        sigma_factor_50=np.array([[1.0, 0.8, 0.6], [1.0, 1.0, 1.0]]),
    )


def test_an_agent_is_found_by_number_uuid_text_and_key(prediction):
    for identity in (17, "17", prediction.key[0], np.int64(17)):
        assert agent_row(prediction, identity) == 0
    for identity in (UUID, str(UUID), UUID.hex, prediction.key[1], UUID.int):
        assert agent_row(prediction, identity) == 1


@pytest.mark.parametrize("identity", [18, "hero", uuid.UUID(int=5)])
def test_an_agent_that_is_not_predicted_is_a_key_error(prediction, identity):
    with pytest.raises(KeyError, match="is not among the 2 predicted"):
        agent_row(prediction, identity)


def test_the_most_probable_mode_is_that_of_the_largest_weight(prediction):
    swapped = dataclasses.replace(prediction, weight=np.array([[0.25, 0.75], [0.6, 0.4]]))
    assert most_probable_mode(swapped).tolist() == [1, 0]
    best = most_probable(swapped)
    assert best.weight.tolist() == [[0.75], [0.6]]
    np.testing.assert_array_equal(best.mean[0, 0], prediction.mean[0, 1])
    np.testing.assert_array_equal(best.covariance[1, 0], prediction.covariance[1, 0])
    assert best.yaw.shape == (2, 1, 3)


def test_moments_of_the_mixture_by_hand(prediction):
    mean, covariance = mixture_moments(prediction)
    # Modes at y = 0 (0.75) and y = 4 (0.25): mean 1, variance between them 0.75 * 0.25 * 16 = 3.
    assert mean[0, 1] == pytest.approx([20.0, 1.0, 10.0, 0.5])
    assert covariance[0, 1] == pytest.approx(np.array([[2.0, 0.0], [0.0, 8.0 + 3.0]]))
    assert covariance[1] == pytest.approx(prediction.covariance[1, 0])


def test_moments_of_the_mixture_are_those_of_samples(prediction):
    rng = np.random.default_rng(2)
    mode = rng.choice(2, size=200_000, p=prediction.weight[0])
    samples = prediction.mean[0, mode, 2, :2] + rng.normal(size=(200_000, 2)) * np.sqrt([3.0, 12])
    mean, covariance = mixture_moments(prediction, 3.0)
    assert mean[0, 0, :2] == pytest.approx(samples.mean(axis=0), abs=0.05)
    assert covariance[0, 0] == pytest.approx(np.cov(samples.T), rel=0.03, abs=0.05)


def test_a_mode_without_a_point_is_left_out_of_the_mixture(prediction):
    mean, covariance = prediction.mean.copy(), prediction.covariance.copy()
    mean[0, 0, 1] = covariance[0, 0, 1] = np.nan
    mean[0, :, 2] = np.nan
    found, spread = mixture_moments(
        dataclasses.replace(prediction, mean=mean, covariance=covariance)
    )
    np.testing.assert_array_equal(found[0, 1], prediction.mean[0, 1, 1])
    np.testing.assert_array_equal(spread[0, 1], prediction.covariance[0, 1, 1])
    assert np.isnan(found[0, 2]).all()
    assert np.isnan(spread[0, 2]).all()
    assert np.isfinite(found[1]).all()


def test_between_two_steps_all_is_interpolated(prediction):
    found = at_times(prediction, [1.25, 2.0])
    assert found.time_s.tolist() == [1.25, 2.0]
    assert found.mean[0, 1, 0] == pytest.approx([12.5, 2.5, 10.0, 2.0])
    assert found.covariance[0, 0, 0] == pytest.approx(np.diag([1.25, 5.0]))
    assert found.sigma_factor_50[0] == pytest.approx([0.95, 0.8])
    np.testing.assert_array_equal(found.mean[:, :, 1], prediction.mean[:, :, 1])


def test_the_yaw_takes_the_shorter_arc(prediction):
    found = at_times(prediction, [1.5, 2.5]).yaw[1, 0]
    assert abs(found[0]) == pytest.approx(np.pi)  # half way from 3.0 to -3.0 across pi
    assert found[1] == pytest.approx(-2.9)


def test_before_the_first_step_it_is_carried_back_by_its_velocity(prediction):
    found = at_times(prediction, [0.0, 0.5])
    assert found.mean[0, 1, :, :2] == pytest.approx(np.array([[0.0, 0.0], [5.0, 1.0]]))
    np.testing.assert_array_equal(found.covariance[0, 0, 0], prediction.covariance[0, 0, 0])


def test_before_the_stamp_and_after_the_horizon_nothing_is_known(prediction):
    found = at_times(prediction, [-0.1, 3.00001, 3.1, np.nan])
    for values in (found.mean[..., 0], found.yaw, found.covariance[..., 0, 0]):
        known = np.isfinite(values).all(axis=(0, 1))
        assert known.tolist() == [False, True, False, False]  # 3.00001 s is a rounded 3 s
    np.testing.assert_array_equal(found.weight, prediction.weight)


def test_one_missing_step_spoils_only_the_times_beside_it(prediction):
    mean = prediction.mean.copy()
    mean[0, 0, 1] = np.nan
    found = at_times(dataclasses.replace(prediction, mean=mean), [1.0, 1.5, 2.0, 2.5, 3.0])
    assert np.isfinite(found.mean[0, 0, :, 0]).tolist() == [True, False, False, False, True]
    assert np.isfinite(found.mean[0, 1]).all()
    step_unknown = dataclasses.replace(prediction, time_s=np.array([1.0, np.nan, 3.0]), mean=mean)
    assert at_times(step_unknown, 2.0).mean[0, 0, 0, :2] == pytest.approx([20.0, 0.0])


def test_without_agents_or_steps_nothing_fails(prediction):
    empty = dataclasses.replace(
        prediction,
        **{
            name: getattr(prediction, name)[:0]
            for name in ("key", "agent_class", "z", "size", "initial", "initial_yaw", "source")
        },
        time_s=np.empty(0),
        weight=np.empty((0, 0)),
        mean=np.empty((0, 0, 0, 4)),
        yaw=np.empty((0, 0, 0)),
        covariance=np.empty((0, 0, 0, 2, 2)),
    )
    assert at_times(empty, [1.0, 2.0]).mean.shape == (0, 0, 2, 4)
    assert mixture_moments(empty, 1.0)[0].shape == (0, 1, 4)
    assert len(most_probable(to_frame(empty, Pose2(1.0, 2.0, 3.0), "odom"))) == 0


def test_another_frame_turns_positions_velocities_yaws_and_covariances(prediction):
    # A quarter to the left, then 100 m along x of the other frame.
    found = to_frame(prediction, Pose2(x=100.0, y=0.0, yaw=np.pi / 2), "odom")
    assert found.frame_id == "odom"
    assert found.mean[0, 1, 1] == pytest.approx([96.0, 20.0, -2.0, 10.0])
    assert found.covariance[0, 0, 0] == pytest.approx(np.diag([4.0, 1.0]))
    assert found.yaw[0, 0, 0] == pytest.approx(np.pi / 2)
    assert found.yaw[1, 0, 0] == pytest.approx(3.0 + np.pi / 2 - 2 * np.pi)
    np.testing.assert_array_equal(found.weight, prediction.weight)


def test_to_another_frame_and_back_is_the_same(prediction):
    pose = Pose2(x=-7.0, y=3.0, yaw=2.4)
    back = to_frame(to_frame(prediction, pose, "odom"), pose.inverse(), "map")
    np.testing.assert_allclose(back.mean, prediction.mean, atol=1e-12)
    np.testing.assert_allclose(back.covariance, prediction.covariance, atol=1e-12)
    np.testing.assert_allclose(np.cos(back.yaw), np.cos(prediction.yaw), atol=1e-12)


def test_the_mahalanobis_distance_does_not_depend_on_the_frame(prediction):
    covariance = prediction.covariance + np.array([[0.0, 0.6], [0.6, 0.0]])
    turned = dataclasses.replace(prediction, covariance=covariance)
    pose, point = Pose2(x=5.0, y=-2.0, yaw=0.7), np.array([12.0, 1.0])

    def distance(one, at):
        away = at - one.mean[..., :2]
        inverse = np.linalg.inv(one.covariance)
        return np.einsum("...i,...ij,...j", away, inverse, away)

    np.testing.assert_allclose(
        distance(to_frame(turned, pose, "odom"), pose.point(point)), distance(turned, point)
    )


def test_steps_without_a_point_are_left_out(prediction):
    prediction.time_s[1] = np.nan
    rest = without_missing_steps(prediction)
    assert rest.time_s.tolist() == [1.0, 3.0]
    np.testing.assert_array_equal(rest.mean, prediction.mean[:, :, [0, 2]])
    np.testing.assert_array_equal(rest.covariance, prediction.covariance[:, :, [0, 2]])
    np.testing.assert_array_equal(rest.sigma_factor_50, [[1.0, 0.6], [1.0, 1.0]])
    assert rest.yaw.shape == (2, 2, 2)
    assert without_missing_steps(rest) is rest


def test_where_agents_were_is_told_by_the_first_point_that_is_there(prediction):
    np.testing.assert_allclose(first_places(prediction), [[0.0, 0.0], [0.0, 50.0]])
    prediction.mean[0, 0] = prediction.mean[0, 1, 0] = np.nan
    prediction.mean[1] = np.nan
    np.testing.assert_allclose(first_places(prediction), [[0.0, 0.0], [np.nan, np.nan]])
    empty = dataclasses.replace(prediction, mean=np.empty((2, 0, 3, 4)), yaw=np.empty((2, 0, 3)))
    assert np.isnan(first_places(empty)).all()
