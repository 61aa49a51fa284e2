# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Noise of a track, against noise of known deviation; changes of velocity, worked by hand."""

import numpy as np
import pytest
from core_helpers import window_of

from mtpgo_core.scene.scene_builder import build_scenes, static_features
from mtpgo_core.scene.track_summary import (
    MIDDLE_LOG,
    SMALLEST_STD,
    rescaled_noise,
    track_summary,
    velocity_changes,
)
from mtpgo_core.task.task_description import (
    CHANGE_STEPS,
    CHANGES_ALONG,
    NOISE_FEATURES,
    TRACK_FEATURES,
    SceneConfig,
)

T, DT_S = 16, 0.2
TIME_S = np.arange(T) * DT_S
NOISE = len(NOISE_FEATURES) + 1  # and whether it is known
KNOWN = NOISE - 1


def track_noise(window):
    """The first columns."""
    return track_summary(window)[:, :NOISE]


def changes(window):
    """The changes along and across, by their steps."""
    features = track_summary(window)[:, NOISE:]
    return features[:, : len(CHANGES_ALONG)], features[:, len(CHANGES_ALONG) :]


def std_of(levels):
    """The deviations (m, m/s) that features stand for."""
    return 10.0 ** (levels - MIDDLE_LOG) - SMALLEST_STD


def heading(angle, along, across):
    """[n, T, 2] vectors with these components along and across a direction."""
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([c * along - s * across, s * along + c * across], axis=-1)


def drive(agents=400, angle=0.0, position_std=(0.0, 0.0), velocity_std=(0.0, 0.0), **window):
    """A window of agents that speed up at 1.5 m/s^2, with white noise along and across."""
    draw = np.random.default_rng(0)
    noise = draw.normal(size=(4, agents, T))
    speed = np.tile(5.0 + 1.5 * TIME_S, (agents, 1))
    way = 5.0 * TIME_S + 0.75 * TIME_S**2 + np.zeros((agents, 1))
    position = heading(angle, way + position_std[0] * noise[0], position_std[1] * noise[1])
    velocity = heading(angle, speed + velocity_std[0] * noise[2], velocity_std[1] * noise[3])
    return window_of(position + 4e5, velocity, np.full((agents, T), angle), **window)


@pytest.mark.parametrize("angle", [0.0, 2.2])
def test_the_noise_is_that_of_each_quantity_along_and_across_the_heading(angle):
    window = drive(angle=angle, position_std=(0.3, 0.02), velocity_std=(0.1, 0.5))
    features = track_noise(window)
    assert track_summary(window).shape == (400, len(TRACK_FEATURES))
    # The last velocity gives the heading, so a noisy one turns it a little.
    rms = np.sqrt((std_of(features[:, :KNOWN]) ** 2).mean(axis=0))
    np.testing.assert_allclose(rms, [0.1, 0.5, 0.3, 0.02], rtol=0.25)
    assert (features[:, KNOWN] == 1.0).all()


def test_one_agent_is_enough_for_an_estimate():
    quiet, noisy = (
        track_noise(drive(position_std=(std, std), velocity_std=(std, std)))[:, :KNOWN]
        for std in (0.02, 0.3)
    )
    assert np.quantile(quiet, 0.99) < np.quantile(noisy, 0.01)


def test_an_accelerated_motion_without_noise_has_none():
    features = track_noise(drive(agents=3))
    assert std_of(features[:, :KNOWN]) == pytest.approx(0.0, abs=1e-6)
    assert (features[:, KNOWN] == 1.0).all()


@pytest.mark.parametrize(("samples", "known"), [(1, False), (5, False), (6, True), (16, True)])
def test_a_short_past_says_nothing(samples, known):
    valid = np.zeros((400, T), dtype=bool)
    valid[:, T - samples :] = True
    features = track_noise(drive(position_std=(0.3, 0.3), velocity_std=(1, 1), valid=valid))
    assert (features[:, KNOWN] == known).all()
    assert ((features != 0.0).any(axis=1) == known).all()


def test_a_gap_is_no_noise():
    valid = np.ones((2, T), dtype=bool)
    valid[1, 6:9] = False
    window = drive(agents=2, valid=valid)
    np.testing.assert_allclose(track_noise(window)[1], track_noise(window)[0], atol=1e-4)


def test_an_unknown_velocity_leaves_the_noise_unknown():
    window = drive(agents=2, position_std=(0.3, 0.3))
    window.velocity[0] = np.nan
    features = track_noise(window)
    assert not features[0].any()
    assert features[1].all()


def test_standing_agents_are_judged_along_their_yaw():
    window = drive(angle=1.0, position_std=(0.3, 0.02), velocity_std=(0.1, 0.02))
    window.velocity[:] -= window.velocity.mean(axis=(0, 1))
    window.velocity[:, -1] *= 0.01
    window.yaw[:] = 1.0
    position = std_of(track_noise(window)[:, 2:4])
    np.testing.assert_allclose(np.sqrt((position**2).mean(axis=0)), [0.3, 0.02], rtol=0.1)


@pytest.mark.parametrize("scale", [0.7, 1.0, 1.4])
def test_a_longer_world_has_the_rescaled_noise(scale):
    valid = np.ones((5, T), dtype=bool)
    valid[4, :13] = False
    window = drive(agents=5, position_std=(0.3, 0.02), velocity_std=(0.1, 0.5), valid=valid)
    levels = track_noise(window)[:, :KNOWN]
    window.position[:] *= scale
    window.velocity[:] *= scale
    np.testing.assert_allclose(rescaled_noise(levels, scale), track_noise(window)[:, :KNOWN])
    assert not levels[4].any()
    assert rescaled_noise(levels.astype(np.float32), scale).dtype == np.float32


def test_the_summary_follows_classes_and_sizes_where_the_task_has_it():
    window = drive(agents=3, position_std=(0.3, 0.3), velocity_std=(0.3, 0.3))
    scene = SceneConfig(classes=("car",), sizes=True, track_summary=True)
    names = ("car", "length", "width", "size_known", *TRACK_FEATURES)
    assert scene.static_features == names
    features = static_features(window, scene)
    assert features.dtype == np.float32
    np.testing.assert_allclose(features[:, 4:], track_summary(window), rtol=1e-6)
    plain = SceneConfig(classes=("car",), track_summary=True)
    np.testing.assert_array_equal(static_features(window, plain)[:, 1:], features[:, 4:])
    batch = build_scenes(window, scene, centres=np.array([1]))
    np.testing.assert_array_equal(batch.static[0], features[batch.agent[0]])


@pytest.mark.parametrize("angle", [0.0, -1.3])
def test_changes_of_velocity_by_hand(angle):
    along = np.zeros((2, T))
    along[0] = 20.0 + np.arange(T) * 0.2  # speeds up by 0.2 m/s per step
    along[1] = 20.0
    along[1, -1] = 20.4  # only now
    across = np.zeros((2, T))
    across[0, :-1] = 0.1  # until now it drifted to the left
    window = window_of(np.zeros((2, T, 2)), heading(angle, along, across), np.full((2, T), angle))
    given_along, given_across = changes(window)
    np.testing.assert_allclose(given_along[0], 0.5)
    np.testing.assert_allclose(given_along[1], [1.0, 1 / 3, 0.2, 0.1, 1 / 15])
    np.testing.assert_allclose(given_across[0], -0.25 / np.array([1, 3, 5, 10, 15]))
    np.testing.assert_allclose(given_across[1], 0.0, atol=1e-9)


def test_changes_are_zero_where_the_past_is_too_short_and_bounded_where_it_is_wild():
    valid = np.ones((2, T), dtype=bool)
    valid[1, : T - 4] = False
    velocity = np.zeros((2, T, 2))
    velocity[..., 0] = 10.0 + 100.0 * np.arange(T)
    along, _ = changes(window_of(np.zeros((2, T, 2)), velocity, np.zeros((2, T)), valid=valid))
    np.testing.assert_allclose(along, [[3, 3, 3, 3, 3], [3, 3, 0, 0, 0]])
    short = window_of(np.zeros((1, 4, 2)), velocity[:1, :4], np.zeros((1, 4)))
    np.testing.assert_allclose(changes(short)[0], [[3, 3, 0, 0, 0]])


def test_the_wildest_track_that_a_history_holds_has_finite_features():
    sign = np.where(np.arange(T) % 2, 1.0, -1.0)
    position = np.stack([1e8 * sign, -1e8 * sign], axis=-1)[None]
    velocity = np.stack([100.0 * sign, 100.0 * sign], axis=-1)[None]
    features = track_summary(window_of(position, velocity, np.zeros((1, T))))
    assert np.isfinite(features).all()
    assert np.abs(features).max() == 3.0


def test_an_empty_window_has_no_summary():
    empty = drive(agents=1).select(np.empty(0, dtype=np.intp))
    assert track_summary(empty).shape == (0, len(TRACK_FEATURES))
    assert velocity_changes(empty).shape == (0, 2, len(CHANGE_STEPS))


def test_changes_of_velocity_are_the_last_features_of_the_summary():
    window = drive(agents=3, angle=1.0, velocity_std=(0.3, 0.2))
    found = velocity_changes(window)
    np.testing.assert_array_equal(
        found.reshape(3, -1), track_summary(window)[:, -2 * len(CHANGE_STEPS) :]
    )
