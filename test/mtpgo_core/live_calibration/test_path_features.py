# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The numbers that corrections of paths are computed from."""

import dataclasses

import numpy as np
import pytest

from mtpgo_core.history.track_history import TrackHistory
from mtpgo_core.identity import keys_from_integers
from mtpgo_core.live_calibration.path_features import FEATURES, MIXTURE, path_features
from mtpgo_core.prediction.constant_velocity import predict_constant_velocity
from mtpgo_core.prediction.output_assembly import with_time_origin
from mtpgo_core.scene.track_summary import velocity_changes
from mtpgo_core.schema import tracked_states
from mtpgo_core.task.task_description import HistoryConfig

GAP_M, SPEED_MPS = 20.0, 10.0
ALONG, ACROSS = 0, 1
LEADERS, SPEED, CONSTANT = slice(11, 17), 17, 18


def observed(turn=0.0, mirror=1.0, braking_mps2=0.0, with_velocity=True):
    """The window of three cars in a lane, the first of which brakes, turned and mirrored."""
    history, cos, sin = TrackHistory(HistoryConfig()), np.cos(turn), np.sin(turn)
    axes = np.array([[cos, sin], [-mirror * sin, mirror * cos]])
    for step in range(18):
        time_s = 0.2 * step
        speed = SPEED_MPS - braking_mps2 * time_s * np.array([0.0, 0.0, 1.0])
        x = GAP_M * np.arange(3) + 0.5 * (SPEED_MPS + speed) * time_s
        place = np.stack([x, 0.2 * np.sin(time_s) * np.ones(3)], axis=1)
        velocity = np.stack([speed, 0.2 * np.cos(time_s) * np.ones(3)], axis=1)
        states = tracked_states(
            10**12 + round(time_s * 1e9),
            "map",
            keys_from_integers(range(3)),
            place @ axes,
            velocity=velocity @ axes if with_velocity else None,
        )
        history.update(states)
    return history.window()


def predicted(window):
    """Two modes: one that gains 1 m a second to the front, one that gains 1 m to the left."""
    prediction = predict_constant_velocity(window, horizon_steps=25, dt_s=0.2, modes=2)
    ahead = window.velocity[:, -1] / np.linalg.norm(window.velocity[:, -1], axis=1)[:, None]
    left = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
    mean = prediction.mean.copy()
    for mode, way in enumerate((ahead, left)):
        mean[:, mode, :, :2] += way[:, None] * prediction.time_s[:, None]
    weight = np.tile([0.75, 0.25], (len(window), 1))
    return dataclasses.replace(prediction, mean=mean, weight=weight)


def features_of(window, prediction=None):
    prediction = predicted(window) if prediction is None else prediction
    return path_features(prediction, window, np.arange(len(window)))


def test_what_each_number_is():
    window = observed(braking_mps2=1.0)
    found = features_of(window)
    assert found.values.shape == (3, 2, FEATURES)
    np.testing.assert_allclose(found.values[:, ALONG, :3], 1.0)  # m/s ahead of constant velocity
    np.testing.assert_allclose(found.values[:, ACROSS, :3], 0.0, atol=1e-12)
    np.testing.assert_allclose(found.values[:, ALONG, MIXTURE], -0.25)
    np.testing.assert_allclose(found.values[:, ACROSS, MIXTURE], 0.25)
    np.testing.assert_allclose(found.values[..., 6:11], velocity_changes(window))
    np.testing.assert_allclose(found.values[2, ALONG, 6:11], -0.5, atol=0.05)  # of 2 m/s^2
    near = np.exp(-np.array([20.0, 40.0 - 0.5 * 3.4**2]) / 20.0)
    last = found.values[0, ALONG, LEADERS].reshape(2, 3)  # behind both
    np.testing.assert_allclose(last[:, 0], 3.0 * near, rtol=0.02)
    assert last[0, 1] == pytest.approx(0.0, abs=1e-6)
    assert last[1, 1] == pytest.approx(-3.4 * near[1], rel=0.05)
    assert last[1, 2] == pytest.approx(-1.0 * near[1], rel=0.3)
    assert not found.values[2, ALONG, LEADERS].any()  # no leader
    assert not found.values[:, ACROSS, LEADERS].any()
    speed = np.hypot(*window.velocity[:, -1].T)
    np.testing.assert_allclose(found.values[:, ALONG, SPEED], speed / 10.0)
    assert (found.values[:, ALONG, CONSTANT] == 1.0).all()
    assert not found.values[:, ACROSS, SPEED:].any()


def test_they_do_not_depend_on_the_frame_and_a_mirror_changes_the_sign_across():
    plain = features_of(observed(braking_mps2=1.0))
    turned = features_of(observed(turn=2.0, braking_mps2=1.0))
    np.testing.assert_allclose(turned.values, plain.values, atol=1e-9)
    np.testing.assert_allclose(turned.sigma, plain.sigma, atol=1e-9)
    np.testing.assert_allclose(turned.course - plain.course, 2.0)
    window = observed(mirror=-1.0, braking_mps2=1.0)
    prediction = predicted(window)
    mean = prediction.mean.copy()
    uniform = predict_constant_velocity(window, horizon_steps=25, dt_s=0.2).mean[:, 0]
    mean[:, 1] = 2.0 * uniform - mean[:, 1]
    mirrored = features_of(window, dataclasses.replace(prediction, mean=mean))
    np.testing.assert_allclose(mirrored.values[:, ALONG], plain.values[:, ALONG], atol=1e-9)
    np.testing.assert_allclose(mirrored.values[:, ACROSS], -plain.values[:, ACROSS], atol=1e-9)


def test_where_the_horizon_begins_after_the_observation_they_are_the_same():
    window = observed(braking_mps2=1.0)
    later = with_time_origin(predicted(window), window.stamp_ns - 200_000_000)
    assert later.time_s[0] == pytest.approx(0.4)
    np.testing.assert_allclose(
        features_of(window, later).values, features_of(window).values, atol=1e-9
    )


def test_standard_deviations_are_those_of_the_heaviest_mode_along_the_course():
    window = observed(turn=np.pi / 2)
    prediction = predicted(window)
    covariance = prediction.covariance.copy()
    covariance[:, 0] = np.diag([4.0, 9.0])  # the course is y
    found = features_of(window, dataclasses.replace(prediction, covariance=covariance))
    np.testing.assert_allclose(found.sigma[..., ALONG], 3.0, rtol=0.01)
    np.testing.assert_allclose(found.sigma[..., ACROSS], 2.0, rtol=0.01)


def test_a_leader_whose_velocity_is_not_known_says_nothing_of_it():
    window = observed()
    velocity, acceleration = window.velocity.copy(), window.acceleration.copy()
    velocity[1:] = acceleration[1:] = np.nan
    prediction = predicted(window)
    unknown = dataclasses.replace(window, velocity=velocity, acceleration=acceleration)
    row = np.array([0])
    one = dataclasses.replace(
        prediction,
        **{
            name: getattr(prediction, name)[:1]
            for name in ("key", "initial", "weight", "mean", "covariance", "sigma_factor_50")
        },
        calibration=prediction.calibration[:1],
    )
    found = path_features(one, unknown, row).values[0, ALONG, LEADERS].reshape(2, 3)
    assert (found[:, 0] > 0.0).all()
    assert not found[:, 1:].any()


@pytest.mark.parametrize(("speed", "share"), [(0.51, 0.02), (0.75, 0.5), (1.0, 1.0), (9.0, 1.0)])
def test_corrections_fade_in_between_standing_and_moving(speed, share):
    window = observed()
    velocity = window.velocity * (speed / np.hypot(*window.velocity[:, -1:].T).T[..., None])
    slow = dataclasses.replace(window, velocity=velocity)
    assert features_of(slow).share == pytest.approx(share)


def test_a_slip_of_the_tracker_is_bounded():
    window = observed()
    acceleration = window.acceleration.copy()
    acceleration[1], acceleration[2] = 1e6, np.inf
    found = features_of(dataclasses.replace(window, acceleration=acceleration)).values
    assert np.abs(found).max() == 100.0


def test_an_empty_window_has_no_features():
    window = observed().select(np.empty(0, dtype=np.intp))
    prediction = predict_constant_velocity(window, horizon_steps=25, dt_s=0.2, modes=2)
    found = path_features(prediction, window, np.empty(0, dtype=np.intp))
    assert found.values.shape == (0, 2, FEATURES)
