# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Relative positions and motions, by hand-worked numbers."""

import numpy as np
import pytest
from core_helpers import window_of

from mtpgo_core.scene import neighbour_geometry
from mtpgo_core.scene.leader_context import leader_features
from mtpgo_core.scene.neighbour_geometry import NEAR_M, NeighbourGeometry, in_blocks, nearness
from mtpgo_core.scene.traffic_context import traffic_features


def window():
    """Agent 0 heads north at (100, 50) m; agent 1 is 30 m ahead and 2 m to its left."""
    position = [[[100.0, 50.0]], [[98.0, 80.0]], [[100.0, 40.0]]]
    velocity = [[[0.0, 10.0]], [[3.0, 12.0]], [[0.0, 9.0]]]
    acceleration = [[[0.0, 0.0]], [[1.0, -2.0]], [[0.0, 0.0]]]
    yaw = [[np.pi / 2], [0.0], [np.pi / 2]]
    return window_of(position, velocity, yaw, acceleration=np.array(acceleration))


def test_positions_are_relative_to_the_agent_and_its_yaw():
    around = NeighbourGeometry.of(window(), np.array([0]))
    assert around.along[0, 0] == pytest.approx([0.0, 30.0, -10.0], abs=1e-5)
    assert around.across[0, 0] == pytest.approx([0.0, 2.0, 0.0], abs=1e-5)
    ahead, left = around.offset(np.array([[1]]))
    assert (ahead[0, 0], left[0, 0]) == pytest.approx((30.0, 2.0))


def test_motion_is_along_the_agents_yaw():
    around = NeighbourGeometry.of(window(), np.array([0]))
    assert around.relative_speed(np.array([[1]]))[0, 0] == pytest.approx(2.0)
    assert around.acceleration(np.array([[1]]))[0, 0] == pytest.approx(-2.0)


def test_the_nearest_candidate_and_whether_there_is_one():
    around = NeighbourGeometry.of(window(), np.array([0]))
    who, there = around.nearest(around.along > 0.0, around.along)
    assert (who[0, 0], there[0, 0]) == (1, True)
    _, there = around.nearest(around.along > 100.0, around.along)
    assert not there[0, 0]


def test_an_absent_agent_has_no_position():
    seen = window()
    seen.valid[1] = False
    seen.position[1] = np.nan
    around = NeighbourGeometry.of(seen, np.array([0]))
    assert np.isnan(around.along[0, 0, 1])


def test_nearness_is_one_at_contact_and_zero_without_an_agent():
    gap, there = np.array([0.0, NEAR_M, np.nan]), np.array([True, True, False])
    assert nearness(gap, there) == pytest.approx([1.0, np.exp(-1.0), 0.0])


def test_blocks_do_not_change_the_result(monkeypatch):
    def columns(around):
        return np.nan_to_num(np.stack([around.along.sum(axis=2), around.cos], axis=-1))

    whole = in_blocks(columns, 2, window(), np.arange(3), 100.0)
    monkeypatch.setattr(neighbour_geometry, "_BLOCK", 1)
    np.testing.assert_array_equal(in_blocks(columns, 2, window(), np.arange(3), 100.0), whole)


def scattered(count, size_m, seed=0):
    """Agents at random places that move and are absent at some steps, present at the last."""
    draw = np.random.default_rng(seed)
    position = draw.uniform(0.0, size_m, (count, 1, 2)) + draw.normal(0.0, 1.0, (count, 16, 2))
    valid = draw.random((count, 16)) < 0.8
    valid[:, -1] = True
    velocity, yaw = draw.normal(0.0, 5.0, position.shape), draw.uniform(-3, 3, (count, 16))
    return window_of(position, velocity, yaw, valid, velocity)


@pytest.mark.parametrize("features", [leader_features, traffic_features])
def test_agents_out_of_reach_are_left_out_without_a_difference(features, monkeypatch):
    crowd, some = scattered(400, 900.0), np.arange(0, 400, 3)
    monkeypatch.setattr(neighbour_geometry, "_BLOCK", 1 << 30)
    whole = features(crowd, some, 40.0)
    monkeypatch.setattr(neighbour_geometry, "_BLOCK", 1 << 15)
    looked_at = []
    compute = NeighbourGeometry.of

    def spy(around, agents, place=None):
        looked_at.append(len(around))
        return compute(around, agents, place)

    monkeypatch.setattr(NeighbourGeometry, "of", spy)
    parts = features(crowd, some, 40.0)
    valid = crowd.valid[some]
    np.testing.assert_array_equal(parts[valid], whole[valid])
    assert max(looked_at) < 300


def test_a_stray_object_far_away_takes_no_precision_from_the_others():
    crowd = scattered(12, 60.0)
    position = np.concatenate([crowd.position, np.full((1, 16, 2), 9e7)])
    valid = np.concatenate([crowd.valid, np.ones((1, 16), dtype=bool)])
    velocity = np.concatenate([crowd.velocity, np.zeros((1, 16, 2))])
    yaw = np.concatenate([crowd.yaw, np.zeros((1, 16))])
    more = window_of(position, velocity, yaw, valid, velocity)
    alone, among = (NeighbourGeometry.of(one, np.arange(12)) for one in (crowd, more))
    np.testing.assert_allclose(among.along[..., :12], alone.along, atol=1e-4)
    np.testing.assert_allclose(among.across[..., :12], alone.across, atol=1e-4)
