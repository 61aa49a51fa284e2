# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The model's input, number by number."""

import dataclasses
import math

import core_helpers
import numpy as np
import pytest
from core_helpers import states_of

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.history.track_history import TrackHistory
from mtpgo_core.scene.lane_map import LaneMap
from mtpgo_core.scene.scene_builder import build_scenes, class_one_hot, static_features
from mtpgo_core.scene.trails.trail_context import TrailContext
from mtpgo_core.scene.trails.trail_memory import TrailMemory
from mtpgo_core.schema import AgentClass
from mtpgo_core.task.task_description import GRAPH_POLICIES, HistoryConfig, SceneConfig

HISTORY = HistoryConfig(steps=4, acceleration_source="message")
NORTH = math.pi / 2


def window_of(offset=(0.0, 0.0), heading=NORTH, steps=4):
    """Agent 1 drives along ``heading`` at 5 m/s, agent 2 is 4 m to its left at t."""
    history = TrackHistory(HISTORY)
    forward = np.array([math.cos(heading), math.sin(heading)])
    left = np.array([-forward[1], forward[0]])
    for k in range(steps):
        first = np.array(offset) + forward * k * 1.0
        second = np.array(offset) + forward * (steps - 1) * 1.0 + 4.0 * left
        history.update(
            states_of(
                0.2 * k,
                [1, 2],
                [first, second],
                velocity=[5.0 * forward, 0.0 * forward],
                acceleration=[0.5 * forward, 0.25 * left],
                yaw=[heading, heading + math.pi],
                agent_class=np.uint8([AgentClass.CAR, AgentClass.PEDESTRIAN]),
            )
        )
    return history.window()


@pytest.mark.parametrize("heading", [NORTH, 0.3, -2.5, math.pi])
@pytest.mark.parametrize("offset", [(0.0, 0.0), (691_234.5, 5_334_567.25)])
def test_centre_heading_by_hand(heading, offset):
    batch = build_scenes(window_of(offset, heading), SceneConfig(), centres=np.array([0]))
    assert batch.features.shape == (1, 2, 4, 8)
    assert batch.features.dtype == np.float32
    x = [-3.0, -2.0, -1.0, 0.0]
    centre = [[v, 0.0, 5.0, 0.0, 0.5, 0.0, 1.0, 0.0] for v in x]
    other = [[0.0, 4.0, 0.0, 0.0, 0.0, 0.25, -1.0, 0.0]] * 4
    np.testing.assert_allclose(batch.features[0], [centre, other], atol=2e-6)
    assert batch.valid.all()
    assert batch.agent.tolist() == [[0, 1]]
    forward = np.array([math.cos(heading), math.sin(heading)])
    np.testing.assert_allclose(batch.origin, [np.array(offset) + 3.0 * forward])
    assert math.remainder(batch.rotation[0] - heading, 2 * math.pi) == pytest.approx(0.0, abs=1e-9)


def test_site_origin_neither_turns_nor_moves():
    config = SceneConfig(frame="site_origin", site_origin=(10.0, -20.0))
    batch = build_scenes(window_of(), config, centres=np.array([0, 1]))
    np.testing.assert_array_equal(batch.origin, [[10.0, -20.0], [10.0, -20.0]])
    np.testing.assert_array_equal(batch.rotation, [0.0, 0.0])
    now = batch.features[0, 0, -1]
    np.testing.assert_allclose(now, [-10.0, 23.0, 0.0, 5.0, 0.0, 0.5, 0.0, 1.0], atol=1e-6)


@pytest.mark.parametrize(
    ("heading", "rotation"), [(0.2, 0.0), (-0.2, 0.0), (math.pi - 0.2, math.pi), (-3.0, math.pi)]
)
def test_driving_direction_is_one_of_two(heading, rotation):
    batch = build_scenes(
        window_of(heading=heading), SceneConfig(frame="driving_direction"), centres=np.array([0])
    )
    assert batch.rotation.tolist() == [rotation]
    velocity = batch.features[0, 0, -1, 2:4]
    expected = 5.0 * np.array([math.cos(heading - rotation), math.sin(heading - rotation)])
    np.testing.assert_allclose(velocity, expected, atol=1e-6)
    assert velocity[0] > 0.0


def test_driving_direction_of_a_standing_agent_is_its_yaws():
    config = SceneConfig(frame="driving_direction")
    batch = build_scenes(window_of(heading=0.0), config, centres=np.array([1]))
    assert batch.rotation.tolist() == [math.pi]


def test_polar_context_counts_from_the_origin():
    config = SceneConfig(context="polar", frame="site_origin", site_origin=(0.0, 3.0))
    batch = build_scenes(window_of(heading=0.0), config, centres=np.array([0]))
    assert batch.features.shape[-1] == len(config.features) == 11
    first = batch.features[0, 0, -1, 8:]  # at (3, 0): 3 to the right, 3 below
    np.testing.assert_allclose(first, [math.sqrt(18), math.sqrt(0.5), -math.sqrt(0.5)], atol=1e-6)
    centred = dataclasses.replace(config, frame="centre_heading")
    own = build_scenes(window_of(), centred, centres=np.array([0])).features[0, 0, -1, 8:]
    np.testing.assert_array_equal(own, [0.0, 1.0, 0.0])


def test_the_polar_angle_at_the_origin_is_zero_whatever_the_signs_of_zeros():
    config = SceneConfig(context="polar", angles="radians")
    theta = config.features.index("theta")
    for heading in (0.0, 2.0, -2.0, math.pi, NORTH, -NORTH):
        batch = build_scenes(window_of(heading=heading), config, centres=np.array([0]))
        assert batch.features[0, 0, -1, theta] == 0.0
        assert batch.features[0, 1, -1, theta] == pytest.approx(-NORTH, abs=1e-6)  # to the left


def test_lane_context_is_the_lane_maps():
    lanes = LaneMap([np.array([[-50.0, y], [50.0, y]]) for y in (-2.0, 2.0, 6.0)])
    config = SceneConfig(context="lanes")
    batch = build_scenes(window_of(heading=0.0), config, centres=np.array([0]), lanes=lanes)
    np.testing.assert_allclose(batch.features[0, 0, :, 8:], [[0.0, 0.5]] * 4, atol=1e-6)
    # The other one faces against the lines: it has no lane, hence zeros.
    np.testing.assert_array_equal(batch.features[0, 1, :, 8:], 0.0)
    with pytest.raises(ConfigurationError, match="no lane lines are given"):
        build_scenes(window_of(), config)


def test_the_context_road_is_leaders_and_lanes():
    lanes = LaneMap([np.array([[-50.0, y], [50.0, y]]) for y in (-2.0, 2.0, 6.0)])
    given = {"centres": np.array([0]), "lanes": lanes}
    features = {
        context: build_scenes(window_of(heading=0.0), SceneConfig(context=context), **given)
        for context in ("road", "leaders", "lanes")
    }
    road = features["road"].features[0, :, :, 8:]
    assert SceneConfig(context="road").features[8:][-3:] == ("in_lane", "d_l", "d_r")
    np.testing.assert_array_equal(road[..., :-3], features["leaders"].features[0, :, :, 8:])
    np.testing.assert_array_equal(road[..., -2:], features["lanes"].features[0, :, :, 8:])
    np.testing.assert_array_equal(road[..., -3], [[1.0] * 4, [0.0] * 4])
    with pytest.raises(ConfigurationError, match="'road' but no lane lines are given"):
        build_scenes(window_of(), SceneConfig(context="road"))


def test_ways_along_lanes_need_trails_and_lanes():
    with pytest.raises(ConfigurationError, match=r"lane_ways is True.*without scene\.trails"):
        SceneConfig(lane_ways=True)
    config = SceneConfig(trails=True, lane_ways=True)
    assert config.uses_lanes
    trails = TrailContext(TrailMemory(), 5, 0.2)
    with pytest.raises(ConfigurationError, match="lane_ways but no lane lines are given"):
        build_scenes(window_of(), config, trails=trails)
    lanes = LaneMap([np.array([[-50.0, y], [50.0, y]]) for y in (-2.0, 2.0, 6.0)])
    scenes = [
        build_scenes(window_of(heading=0.0), config, lanes=some, trails=trails).trails
        for some in (lanes, LaneMap(()))
    ]
    assert scenes[0].any()
    assert not scenes[1].any()


def test_absence_is_zero_and_masked():
    history = TrackHistory(HISTORY)
    for k in range(4):
        ids = [1, 2] if k >= 2 else [1]
        position = [[100.0 + k, 5.0], [90.0, 7.0]][: len(ids)]
        history.update(states_of(0.2 * k, ids, position))
    batch = build_scenes(history.window(), SceneConfig(), centres=np.array([0]))
    assert batch.valid[0].tolist() == [[True] * 4, [False, False, True, True]]
    assert not batch.features[0, 1, :2].any()
    assert batch.features[0, 1, 2:, 6].all()


@pytest.mark.parametrize("context", ["none", "leaders", "traffic"])
@pytest.mark.parametrize("policy", GRAPH_POLICIES)
def test_agents_that_have_left_take_no_part(policy, context):
    history = TrackHistory(HISTORY)
    cars = np.full(3, AgentClass.CAR, dtype=np.uint8)
    history.update(
        states_of(0.0, [1, 2, 3], [[20, 0], [0, 0], [10, 0]], yaw=[0, 0, 0], agent_class=cars)
    )
    history.update(states_of(0.6, [2, 3], [[0, 0], [10, 0]], yaw=[0, 0], agent_class=cars[1:]))
    window = history.window()
    assert len(window) == 3
    config = SceneConfig(policy=policy, context=context)
    batch = build_scenes(window, config)
    assert set(batch.agent[batch.agent >= 0].tolist()) == {1, 2}
    alone = build_scenes(window.select(np.array([1, 2])), config)
    np.testing.assert_array_equal(batch.features, alone.features)
    around = build_scenes(window, config, centres=np.array([2]))
    assert around.agent.tolist() == [[2, 1]]
    if context != "none":
        gap = config.features.index("lead1_gap")
        assert around.features[0, 1, 0, gap] == (10.0 if context == "leaders" else 5.5)
        assert around.features[0, 0, 0, gap] == 80.0  # agent 1 was ahead of it and has left
    nobody = build_scenes(window.select(np.array([0])), config)
    assert nobody.agent.shape == (0, 1)


def test_unknown_motion_is_zero_along_the_scenes_axis():
    history = TrackHistory(HISTORY)
    history.update(states_of(0.0, [1, 2], [[0, 0], [3, 4]], yaw=[1.0, np.nan]))
    batch = build_scenes(history.window(), SceneConfig(), centres=np.array([0]))
    np.testing.assert_array_equal(batch.features[0, 1, -1, 2:], [0, 0, 0, 0, 1, 0])
    assert np.isfinite(batch.features).all()


def test_padding_reaches_to_the_largest_graph_only():
    history = TrackHistory(HISTORY)
    position = [[0, 0], [1, 0], [2, 0], [500, 0], [900, 0], [901, 0]]
    cars = np.full(6, AgentClass.CAR, dtype=np.uint8)
    history.update(states_of(0.0, range(6), position, agent_class=cars))
    batch = build_scenes(history.window(), SceneConfig())
    assert batch.features.shape[:2] == (3, 3)
    padding = batch.agent < 0
    assert padding.sum() == 3
    assert not batch.valid[padding].any()
    assert not batch.features[padding].any()
    assert not batch.static[padding].any()
    assert not batch.primary[padding].any()
    assert sorted(batch.agent[batch.primary].tolist()) == list(range(6))


def test_nobody_gives_an_empty_batch():
    batch = build_scenes(TrackHistory(HISTORY).window(), SceneConfig())
    assert batch.features.shape == (0, 1, 4, 8)
    assert batch.primary.shape == (0, 1)


def test_one_hot_classes():
    table = class_one_hot(np.uint8([1, 7, 0, 9, 200]), ("car", "pedestrian", "nonsense"))
    assert table.tolist() == [[1, 0, 0], [0, 1, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0]]
    assert class_one_hot(np.uint8([0]), ("unknown",)).tolist() == [[1]]
    batch = build_scenes(window_of(), SceneConfig(), centres=np.array([0]))
    assert batch.static[0].argmax(axis=1).tolist() == [0, 7]


NAN, INF = math.nan, math.inf


@pytest.mark.parametrize(
    ("size", "expected"),
    [
        ((4.5, 1.8), (0.45, 0.6, 1.0)),
        ((0.5, 0.5), (0.05, 1.0 / 6.0, 1.0)),
        ((30.0, 9.0), (3.0, 3.0, 1.0)),
        ((75.0, 12.0), (3.0, 3.0, 1.0)),  # cut off at 30 m and 9 m
        ((NAN, NAN), (0.0, 0.0, 0.0)),
        ((4.5, NAN), (0.0, 0.0, 0.0)),
        ((0.0, 0.0), (0.0, 0.0, 0.0)),
        ((4.5, 0.0), (0.0, 0.0, 0.0)),
        ((-4.5, 1.8), (0.0, 0.0, 0.0)),
        ((INF, 1.8), (0.0, 0.0, 0.0)),
    ],
)
def test_sizes_follow_the_classes_and_are_zero_where_unknown(size, expected):
    window = core_helpers.window_of(
        np.zeros((2, 1, 2)), np.zeros((2, 1, 2)), np.zeros((2, 1)), size=[size, (10.0, 3.0)]
    )
    config = SceneConfig(classes=("car", "pedestrian"), sizes=True)
    assert config.static_features == ("car", "pedestrian", "length", "width", "size_known")
    features = static_features(window, config)
    assert features.dtype == np.float32
    np.testing.assert_allclose(features, [[0, 0, *expected], [0, 0, 1, 1, 1]], rtol=1e-6)


def test_sizes_are_part_of_a_scene_only_if_the_task_has_them():
    position = np.array([[[0.0, 0.0]], [[4.0, 0.0]], [[500.0, 0.0]]])
    sizes = [[5.0, 1.5], [NAN, NAN], [20.0, 3.0]]
    window = core_helpers.window_of(position, np.zeros((3, 1, 2)), np.zeros((3, 1)), size=sizes)
    window.agent_class[:] = [AgentClass.CAR, AgentClass.PEDESTRIAN, AgentClass.TRUCK]
    plain = build_scenes(window, SceneConfig(), centres=np.array([0, 2]))
    sized = build_scenes(window, SceneConfig(sizes=True), centres=np.array([0, 2]))
    assert plain.static.shape == (2, 2, 8)
    assert sized.static.shape == (2, 2, 11)
    np.testing.assert_array_equal(sized.static[..., :8], plain.static)
    expected = [[[0.5, 0.5, 1.0], [0.0, 0.0, 0.0]], [[2.0, 1.0, 1.0], [0.0, 0.0, 0.0]]]
    np.testing.assert_allclose(sized.static[..., 8:], expected)  # the last one is padding


@pytest.mark.parametrize("centre", [-1, 2, 99])
def test_a_centre_that_is_not_there_is_an_error(centre):
    with pytest.raises(ConfigurationError, match="not present at the window's time"):
        build_scenes(window_of(), SceneConfig(), centres=np.array([centre]))


def test_turning_and_moving_the_world_changes_no_feature():
    draw = np.random.default_rng(0)
    position, velocity = draw.uniform(-60, 60, (30, 2)), draw.uniform(-10, 10, (30, 2))
    batches = []
    for angle, shift in ((0.0, 0.0), (2.2, 4e5)):
        cos, sin = math.cos(angle), math.sin(angle)
        turn = np.array([[cos, sin], [-sin, cos]])
        history = TrackHistory(HistoryConfig())
        for k in range(20):
            moved = (position + velocity * 0.1 * k) @ turn + shift
            history.update(states_of(0.1 * k, range(30), moved, velocity=velocity @ turn))
        batches.append(build_scenes(history.window(), SceneConfig(max_neighbours=12)))
    np.testing.assert_array_equal(batches[0].agent, batches[1].agent)
    np.testing.assert_allclose(batches[0].features, batches[1].features, atol=1e-5)


def test_trails_are_those_of_each_agent_and_zero_in_the_padding():
    memory = TrailMemory()
    for k in range(40):
        states = states_of(0.2 * k - 8.0, [9], [[-30.0 + 1.6 * k, 0.0]], velocity=[[8.0, 0.0]])
        memory.add_instant(
            states.stamp_ns,
            "map",
            states.key,
            states.agent_class,
            states.position,
            states.velocity,
            np.zeros(1),
        )
    position = np.array([[[0.0, 0.0]], [[4.0, 30.0]], [[2.0, 0.5]]])
    window = core_helpers.window_of(position, np.full((3, 1, 2), [8.0, 0.0]), np.zeros((3, 1)))
    config = SceneConfig(trails=True, radius_m=10.0)
    context = TrailContext(memory, 5, 0.2)
    batch = build_scenes(window, config, centres=np.array([0, 1, 2]), trails=context)
    assert batch.trails.shape == (3, 2, 3, 5, 3)
    assert batch.trails.dtype == np.float32
    assert (batch.trails[:, :, 0, 0, 2] > 0.0).tolist() == [
        [True, True],
        [False, False],
        [True, True],
    ]
    np.testing.assert_array_equal(batch.trails[0], batch.trails[2, ::-1])
    assert build_scenes(window, SceneConfig()).trails is None
    with pytest.raises(ConfigurationError, match=r"scene\.trails"):
        build_scenes(window, config)
