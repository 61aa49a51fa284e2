# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Departed agents in past graphs, angles in radians and origins by site, number by number."""

import math

import numpy as np
import pytest
from core_helpers import states_of

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.history.track_history import TrackHistory
from mtpgo_core.options import from_dict
from mtpgo_core.scene.scene_builder import build_scenes
from mtpgo_core.task.task_description import HistoryConfig, SceneConfig, TaskDescription


def window_of(left_at=2, extra=()):
    """Agent 1 stands at (10, 0) for four steps, agent 2 is 5 m above it until it leaves."""
    history = TrackHistory(HistoryConfig(steps=4, max_extrapolation_s=0.0))
    for k in range(4):
        agents, places = [1], [[10.0, 0.0]]
        if k < left_at:
            agents, places = [1, 2], [*places, [10.0, 5.0]]
        agents += [number for number, _ in extra]
        places += [place for _, place in extra]
        history.update(
            states_of(
                0.2 * k,
                agents,
                places,
                velocity=np.zeros((len(agents), 2)),
                acceleration=np.zeros((len(agents), 2)),
                yaw=[0.5] * len(agents),
            )
        )
    return history.window()


def test_departed_agents_are_left_out_by_default():
    batch = build_scenes(window_of(), SceneConfig())
    assert batch.agent.tolist() == [[0]]


@pytest.mark.parametrize("policy", ["cover", "each", "scene", "ego"])
def test_departed_agents_are_in_the_graphs_of_their_steps(policy):
    window = window_of()
    batch = build_scenes(window, SceneConfig(policy=policy, departed_agents=True))
    assert batch.agent.tolist() == [[0, 1]]
    assert batch.valid[0].tolist() == [[True] * 4, [True, True, False, False]]
    assert batch.primary.tolist() == [[True, False]]
    x = batch.features[0, 1, :, :2]
    c, s = math.cos(0.5), math.sin(0.5)  # the scene's x axis is the centre's yaw
    np.testing.assert_allclose(x, [[5 * s, 5 * c]] * 2 + [[0, 0]] * 2, atol=1e-5)


def test_departed_agents_out_of_reach_or_above_the_limit():
    far = SceneConfig(departed_agents=True, radius_m=4.9)
    assert build_scenes(window_of(), far).agent.tolist() == [[0]]
    crowd = window_of(extra=[(7, [11.0, 0.0])])
    full = SceneConfig(departed_agents=True, max_neighbours=1)
    for row in build_scenes(crowd, full).agent.tolist():
        present = crowd.valid[:, -1]
        assert all(present[agent] for agent in row if agent >= 0)


def test_forced_centres_keep_their_positions_in_the_window():
    window = window_of()
    batch = build_scenes(window, SceneConfig(departed_agents=True), centres=np.array([0]))
    assert batch.agent.tolist() == [[0, 1]]
    with pytest.raises(ConfigurationError, match="not present at the window's time"):
        build_scenes(window, SceneConfig(departed_agents=True), centres=np.array([1]))


def test_angles_in_radians_by_hand():
    config = SceneConfig(
        frame="site_origin", site_origin=(7.0, -4.0), context="polar", angles="radians"
    )
    assert config.features == ("x", "y", "vx", "vy", "ax", "ay", "yaw", "r", "theta")
    found = build_scenes(window_of(left_at=0), config).features[0, 0, -1]
    # x - x_0 = 3, y - y_0 = 4: r = 5, theta = arctan2(y_0 - y, x - x_0) = arctan2(-4, 3)
    np.testing.assert_allclose(
        found[[0, 1, 6, 7, 8]], [3, 4, 0.5, 5, math.atan2(-4, 3)], rtol=1e-6
    )


def test_an_origin_for_each_site():
    scene = from_dict(
        SceneConfig, {"frame": "site_origin", "site_origins": {1: [3, 4], "b": [5.5, -1]}}, "scene"
    )
    assert scene.site_origins == {"1": (3.0, 4.0), "b": (5.5, -1.0)}
    for location, origin in scene.site_origins.items():
        batch = build_scenes(window_of(), scene.at_site(location))
        np.testing.assert_array_equal(batch.origin[0], origin)
    again = TaskDescription.from_json(TaskDescription(scene=scene).to_json()).scene
    assert again == scene
    with pytest.raises(ConfigurationError, match="the site is '2', expected one with an origin"):
        scene.at_site("2")
    with pytest.raises(ConfigurationError, match="the site is not given"):
        scene.at_site(None)
    plain = SceneConfig()
    assert plain.at_site("2") is plain


@pytest.mark.parametrize("origin", [[1.0], "ab", [1.0, "x"], [1.0, math.nan], 3])
def test_a_bad_origin_is_named(origin):
    with pytest.raises(ConfigurationError, match=r"site_origins.7 is .* expected two numbers"):
        from_dict(SceneConfig, {"site_origins": {"7": origin}}, "scene")
