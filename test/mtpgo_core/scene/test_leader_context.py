# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Features of the two agents ahead, by hand-worked numbers and a simple loop."""

import numpy as np
import pytest
from core_helpers import window_of

from mtpgo_core.history.track_history import TrackHistory
from mtpgo_core.identity import keys_from_integers
from mtpgo_core.scene import neighbour_geometry as surroundings
from mtpgo_core.scene.leader_context import BAND_M, leader_features
from mtpgo_core.scene.neighbour_geometry import NEAR_M
from mtpgo_core.scene.scene_builder import build_scenes
from mtpgo_core.schema import tracked_states
from mtpgo_core.task.task_description import HistoryConfig, SceneConfig

REACH_M = 80.0


def test_two_leaders_northbound_by_hand():
    # Heading north; 10 m and 30 m ahead in the lane, one next to it, one behind, one beyond reach.
    position = [[0, 0], [0.5, 10], [-1, 30], [3.5, 5], [0, -8], [0, 95]]
    velocity = [[0, 12], [0, 9], [0, 15], [0, 1], [0, 1], [0, 1]]
    acceleration = [[0, 0], [0, -2], [0, 1], [0, 9], [0, 9], [0, 9]]
    window = window_of(
        np.array(position)[:, None],
        np.array(velocity)[:, None],
        np.full((6, 1), np.pi / 2),
        acceleration=np.array(acceleration)[:, None],
    )
    got = leader_features(window, np.array([0]))[0, 0]
    expected = [10, np.exp(-10 / NEAR_M), -3, -2, 30, np.exp(-30 / NEAR_M), 3, 1]
    np.testing.assert_allclose(got, expected, atol=1e-12)


def test_without_an_agent_ahead_the_features_are_neutral():
    window = window_of([[[0, 0]], [[-5, 0]]], np.zeros((2, 1, 2)), np.zeros((2, 1)))
    got = leader_features(window, np.array([0]))[0, 0]
    np.testing.assert_array_equal(got, [REACH_M, 0, 0, 0] * 2)


def test_whatever_is_ahead_leads_however_near():
    """Pedestrians in a crowd, heading east: one 0.4 m ahead, one abreast."""
    position = [[[0, 0]], [[0.4, 0.2]], [[0, 0.5]]]
    window = window_of(position, np.ones((3, 1, 2)) * [1, 0], np.zeros((3, 1)))
    gaps = leader_features(window, np.array([0]))[0, 0, [0, 4]]
    np.testing.assert_allclose(gaps, [0.4, REACH_M])


def test_an_absent_agent_is_no_leader_at_that_step():
    window = window_of(
        np.array([[[0, 0], [0, 0]], [[10, 0], [10, 0]]]),
        np.zeros((2, 2, 2)),
        np.zeros((2, 2)),
        valid=[[True, True], [False, True]],
    )
    gap = leader_features(window, np.array([0]))[0, :, 0]
    np.testing.assert_array_equal(gap, [REACH_M, 10])


@pytest.mark.parametrize("reach_m", [REACH_M, 50.0])
def test_many_random_agents_against_a_loop(monkeypatch: pytest.MonkeyPatch, reach_m: float):
    monkeypatch.setattr(surroundings, "_BLOCK", 100)  # several blocks
    rng = np.random.default_rng(3)
    n, steps = 30, 3
    window = window_of(
        rng.uniform(-60, 60, (n, steps, 2)),
        rng.normal(0, 5, (n, steps, 2)),
        rng.uniform(-np.pi, np.pi, (n, steps)),
        valid=rng.random((n, steps)) < 0.8,
        acceleration=rng.normal(0, 1, (n, steps, 2)),
    )
    got = leader_features(window, np.arange(n), reach_m)
    seen = 0
    for i in range(n):
        for k in range(steps):
            if not window.valid[i, k]:
                continue
            ahead = np.array([np.cos(window.yaw[i, k]), np.sin(window.yaw[i, k])])
            left = np.array([-ahead[1], ahead[0]])
            found = []
            for j in range(n):
                offset = window.position[j, k] - window.position[i, k]
                if j != i and 0 < offset @ ahead < reach_m and abs(offset @ left) < BAND_M:
                    dv = (window.velocity[j, k] - window.velocity[i, k]) @ ahead
                    ax = window.acceleration[j, k] @ ahead
                    gap = offset @ ahead
                    found.append((gap, np.exp(-gap / NEAR_M), dv, ax))
            seen += len(found) > 0
            found = [*sorted(found), (reach_m, 0, 0, 0), (reach_m, 0, 0, 0)][:2]
            np.testing.assert_allclose(got[i, k], np.ravel(found), atol=1e-9)
    assert seen > 10


def test_scenes_carry_the_columns_and_no_frame_changes_them():
    history = TrackHistory(HistoryConfig())
    for k in range(16):
        t = 0.2 * k
        history.update(
            tracked_states(
                round(t * 1e9),
                "map",
                keys_from_integers([1, 2]),
                np.array([[10 * t, 0.0], [25 + 8 * t, 0.5]]),
                velocity=np.array([[10.0, 0.0], [8.0, 0.0]]),
                yaw=np.zeros(2),
            )
        )
    config = SceneConfig(context="leaders")
    batch = build_scenes(history.window(), config, centres=np.array([0, 1]))
    columns = {name: i for i, name in enumerate(config.features)}
    mine = batch.features[0, 0]  # the follower, in its own graph
    times = 0.2 * np.arange(16)
    np.testing.assert_allclose(mine[:, columns["lead1_gap"]], 25 - 2 * times, atol=1e-4)
    np.testing.assert_allclose(mine[:, columns["lead1_dv"]], -2.0, atol=1e-5)
    other = batch.features[1, 1]  # the follower again, in the leader's graph
    np.testing.assert_allclose(other[:, 8:], mine[:, 8:], atol=1e-6)
    short = SceneConfig(context="leaders", leader_reach_m=21.0)
    gap = build_scenes(history.window(), short, centres=np.array([0])).features[0, 0]
    seen = 25 - 2 * times < 21.0
    np.testing.assert_allclose(
        gap[:, columns["lead1_gap"]], np.where(seen, 25 - 2 * times, 21.0), atol=1e-4
    )
