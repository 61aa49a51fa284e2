# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Augmented features against features of the augmented world."""

import dataclasses

import numpy as np
import pytest
from traffic import braking_cars, cut_windows, turning_cars

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.scene.lane_map import LaneMap
from mtpgo_core.scene.scene_builder import build_scenes, static_features
from mtpgo_core.scene.trails.trail_context import TrailContext, trail_features
from mtpgo_core.task.task_description import CONTEXT_FEATURES, HistoryConfig, SceneConfig
from mtpgo_training.scenes.augmentation import Augmentation
from mtpgo_training.scenes.recorded_trails import recorded_trails
from mtpgo_training.scenes.track_samples import SampleTable, take_in


def test_a_turn_is_that_of_the_world():
    scene = SceneConfig(frame="site_origin", context="polar", max_neighbours=3)
    recording = braking_cars(seconds=4.0)
    turn = 0.7
    c, s = np.cos(turn), np.sin(turn)
    matrix = np.array([[c, s], [-s, c]])
    turned = recording.__class__(
        **{
            **{f: getattr(recording, f) for f in recording.__dataclass_fields__},
            "position": recording.position @ matrix,
            "velocity": recording.velocity @ matrix,
            "yaw": recording.yaw + turn,
        }
    )
    plain, expected = (
        build_scenes(
            cut_windows(r, HistoryConfig(), 0.2)[-1].window, scene, centres=np.array([0])
        ).features[0]
        for r in (recording, turned)
    )
    given = Augmentation(turn_rad=turn).features(plain, scene.features)
    valid = np.abs(plain).sum(axis=-1) > 0
    np.testing.assert_allclose(given[valid], expected[valid], atol=2e-4, rtol=1e-4)


@pytest.mark.parametrize(
    "change", [Augmentation(mirror=True), Augmentation(turn_rad=0.7), Augmentation(scale=1.3)]
)
def test_changed_trails_are_those_of_the_changed_world(change):
    history = HistoryConfig()
    plain = turning_cars()
    heading = change.vectors(np.stack([np.cos(plain.yaw), np.sin(plain.yaw)], axis=1))
    changed = dataclasses.replace(
        plain,
        position=change.vectors(plain.position),
        velocity=change.vectors(plain.velocity),
        yaw=np.arctan2(heading[:, 1], heading[:, 0]),
    )
    there, expected = (
        trail_features(
            cut_windows(recording, history, 0.2)[-30].window,
            TrailContext(
                recorded_trails(recording, SampleTable(take_in(recording, history), history)),
                25,
                history.dt_s,
            ),
        )
        for recording in (plain, changed)
    )
    given = change.trails(there)
    same = (given[..., 2] > 0.0) & (expected[..., 2] > 0.0)
    # The points of the trails are at other places, and more of them are within a scaled reach.
    assert same.sum() > 0.8 * (given[..., 2] > 0.0).sum() > 100
    apart = np.linalg.norm(given - expected, axis=-1)[same]
    assert np.median(apart) < 0.1
    assert np.quantile(apart, 0.9) < 0.4
    turned = np.abs(given[..., 1][same])
    assert turned.max() > 20.0


def mirrored(recording):
    """The recording with left and right swapped."""
    mirror = np.array([1.0, -1.0])
    return dataclasses.replace(
        recording,
        position=mirror * recording.position,
        velocity=mirror * recording.velocity,
        yaw=-recording.yaw,
    )


def test_a_mirror_changes_the_sign_of_what_is_to_the_left_and_is_its_own_inverse():
    names = SceneConfig(context="lanes").features
    features = np.arange(1.0, 11.0, dtype=np.float32)[None]
    mirror = Augmentation(mirror=True)
    out = mirror.features(features, names)
    np.testing.assert_array_equal(out, [[1, -2, 3, -4, 5, -6, 7, -8, -9, -10]])
    np.testing.assert_array_equal(mirror.features(out, names), features)


def test_a_mirrored_road_has_the_lane_positions_of_the_mirrored_features():
    scene = SceneConfig(frame="site_origin", context="lanes", max_neighbours=11, radius_m=1e3)
    # Three lanes of unequal width along x, and a recording whose cars are in all of them.
    lines = [np.array([[-1e3, y], [1e3, y]]) for y in (-2.0, 1.5, 5.5, 8.5)]
    recording = braking_cars(seconds=4.0)
    along = 0.05 * np.sin(np.arange(len(recording)))
    recording = dataclasses.replace(
        recording,
        position=np.stack([recording.position[:, 0] - 500.0, recording.track % 10 - 1.7], axis=1),
        velocity=np.stack([np.full(len(recording), 8.0), 8.0 * along], axis=1),
        yaw=along,
    )
    turned = [line * [1.0, -1.0] for line in lines]
    plain, expected = (
        build_scenes(
            cut_windows(r, HistoryConfig(), 0.2)[-1].window,
            scene,
            centres=np.array([0]),
            lanes=LaneMap(drawn),
        ).features[0]
        for r, drawn in ((recording, lines), (mirrored(recording), turned))
    )
    place = [scene.features.index(name) for name in ("d_l", "d_r")]
    assert np.ptp(plain[..., place], axis=(0, 1)) == pytest.approx([1.8, 1.8], abs=0.4)
    given = Augmentation(mirror=True).features(plain, scene.features)
    np.testing.assert_allclose(given, expected, atol=1e-4)


def test_an_unknown_feature_is_refused():
    with pytest.raises(ConfigurationError, match="'speed_limit'"):
        Augmentation(mirror=True).features(np.zeros((1, 1), np.float32), ("speed_limit",))


def test_a_scale_changes_lengths_and_speeds_but_not_directions():
    names = SceneConfig(context="polar").features
    features = np.arange(1.0, 12.0, dtype=np.float32)[None]
    out = Augmentation(scale=2.0).features(features, names)
    np.testing.assert_array_equal(out, [[2, 4, 6, 8, 10, 12, 7, 8, 18, 10, 11]])
    np.testing.assert_array_equal(Augmentation(scale=2.0).vectors(np.array([1.0, 2.0])), [2, 4])


def test_a_scaled_world_has_the_leaders_of_the_scaled_features():
    scene = SceneConfig(frame="site_origin", context="leaders", max_neighbours=3)
    recording = braking_cars(seconds=4.0)
    scale = 0.8
    smaller = dataclasses.replace(
        recording, position=scale * recording.position, velocity=scale * recording.velocity
    )
    plain, expected = (
        build_scenes(
            cut_windows(r, HistoryConfig(), 0.2)[-1].window, scene, centres=np.array([0])
        ).features[0]
        for r in (recording, smaller)
    )
    given = Augmentation(scale=scale).features(plain, scene.features)
    gap = scene.features.index("lead1_gap")
    both = (plain[..., gap] < 80.0) & (expected[..., gap] < 80.0) & (plain[..., gap] > 0.0)
    assert both.sum() > 10
    one = slice(gap, gap + 3)
    np.testing.assert_allclose(given[both][:, one], expected[both][:, one], atol=1e-3, rtol=1e-3)


@pytest.mark.parametrize("scale", [0.8, 1.25])
def test_a_scaled_world_has_the_static_sizes_of_the_scaled_features(scale):
    scene = SceneConfig(sizes=True)
    recording = braking_cars(seconds=1.0)
    size = np.stack([np.linspace(2.0, 29.0, 12), np.linspace(0.5, 2.6, 12)], axis=1)
    size[4] = np.nan
    plain, expected = (
        static_features(cut_windows(r, HistoryConfig(), 0.2)[-1].window, scene)
        for r in (
            dataclasses.replace(recording, size=size),
            dataclasses.replace(recording, size=scale * size),
        )
    )
    given = Augmentation(mirror=True, scale=scale).static(plain, scene.static_features)
    np.testing.assert_allclose(given, expected, rtol=1e-6)
    assert not np.allclose(given, plain)


@pytest.mark.parametrize("mirror", [False, True])
@pytest.mark.parametrize("scale", [0.8, 1.0, 1.25])
def test_a_changed_world_has_the_changed_track_summary(scale, mirror):
    scene = SceneConfig(track_summary=True)
    recording = braking_cars(seconds=4.0)
    draw = np.random.default_rng(0)
    position = recording.position + 0.2 * draw.normal(size=recording.position.shape)
    velocity = recording.velocity + 0.1 * draw.normal(size=recording.position.shape)
    factor = scale * np.array([1.0, -1.0 if mirror else 1.0])
    turned = -recording.yaw if mirror else recording.yaw
    plain, expected = (
        static_features(cut_windows(r, HistoryConfig(), 0.2)[-1].window, scene)
        for r in (
            dataclasses.replace(recording, position=position, velocity=velocity),
            dataclasses.replace(
                recording, position=position * factor, velocity=velocity * factor, yaw=turned
            ),
        )
    )
    given = Augmentation(mirror=mirror, scale=scale).static(plain, scene.static_features)
    np.testing.assert_allclose(given, expected, rtol=1e-5, atol=1e-5)
    assert plain[:, scene.static_features.index("noise_known")].any()
    assert np.allclose(given, plain) == (scale == 1.0 and not mirror)


def test_a_mirrored_world_has_the_traffic_of_the_mirrored_features():
    scene = SceneConfig(frame="site_origin", context="traffic", max_neighbours=3)
    recording = braking_cars(seconds=4.0)
    plain, expected = (
        build_scenes(
            cut_windows(r, HistoryConfig(), 0.2)[-1].window, scene, centres=np.arange(12)
        ).features
        for r in (recording, mirrored(recording))
    )
    given = Augmentation(mirror=True).features(plain, scene.features)
    for name in ("lead1_across", "left_ahead_near", "right_behind_near", "right_ahead_dv"):
        assert plain[..., scene.features.index(name)].any()
    np.testing.assert_allclose(given, expected, atol=2e-3, rtol=1e-4)


def test_a_scale_changes_gaps_and_lengths_of_the_traffic():
    names = CONTEXT_FEATURES["traffic"]
    features = np.zeros((1, len(names)), dtype=np.float32)
    row = {name: i for i, name in enumerate(names)}
    plain = {"length": 5.0, "lead1_gap": 10.0, "lead1_near": np.exp(-0.5), "lead1_across": 1.0}
    plain |= {"left_behind_gap": 80.0}  # no agent
    for name, value in plain.items():
        features[0, row[name]] = value
    out = Augmentation(scale=2.0).features(features, names)[0]
    expected = {"length": 10.0, "lead1_gap": 20.0, "lead1_near": np.exp(-1), "lead1_across": 2.0}
    expected |= {"left_behind_gap": 80.0}
    assert {name: out[row[name]] for name in plain} == pytest.approx(expected, rel=1e-6)


def test_an_empty_place_ahead_stays_empty_at_any_scale():
    names = SceneConfig(context="leaders").features
    features = np.zeros((1, len(names)), dtype=np.float32)
    features[..., [names.index("lead1_gap"), names.index("lead2_gap")]] = 80.0
    np.testing.assert_array_equal(Augmentation(scale=0.7).features(features, names), features)


@pytest.mark.parametrize("mirror", [False, True])
def test_angles_in_radians_turn_as_their_vectors_do(mirror):
    """yaw = atan2(sin, cos) and theta = -atan2(sin, cos) of the columns in the other form."""
    change = Augmentation(mirror=mirror, turn_rad=2.0, scale=1.1)
    angle = np.linspace(-3.1, 3.1, 9)
    pair = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    turned = change.features(pair, ("cos_yaw", "sin_yaw"))
    course = np.arctan2(turned[:, 1], turned[:, 0])
    found = change.features(np.stack([angle, -angle], axis=-1), ("yaw", "theta"))
    np.testing.assert_allclose(found, np.stack([course, -course], axis=-1), atol=1e-6)
