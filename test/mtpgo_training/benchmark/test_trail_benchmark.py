# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A full memory of trails is cheap, and the junction that fills it has branches."""

import numpy as np
import pytest

from mtpgo_core.scene.trails.trail_context import TrailContext, trail_features
from mtpgo_core.scene.trails.trail_memory import CAPACITY
from mtpgo_core.task.task_description import HistoryConfig
from mtpgo_training.benchmark.trail_benchmark import (
    ARM_M,
    SPEED_MPS,
    JunctionTraffic,
    full_memory,
    trail_cost,
)

CYCLE_MS = 15.0
"""Three times what is required on a free core of a usual processor: other tests run beside."""


@pytest.fixture(scope="module")
def full():
    return full_memory()


def test_a_cycle_with_64_road_users_and_a_full_memory_is_cheap(full):
    cost = trail_cost(64, *full, rounds=15)
    assert cost.points == CAPACITY
    assert 0.0 < cost.cycle_ms < CYCLE_MS
    assert cost.memory_mb < 25.0


def test_those_who_enter_the_junction_see_where_others_went(full):
    memory, time_s = full
    window = JunctionTraffic(1000, 3, first=10**9).window(time_s, HistoryConfig())
    features = trail_features(window, TrailContext(memory, 25, 0.2))
    position, velocity = window.position[:, -1], window.velocity[:, -1]
    ahead = -(position * velocity).sum(axis=1) / SPEED_MPS  # m to the middle of the junction
    near = (ahead > 15.0) & (ahead < 25.0)
    assert near.sum() > 20
    ends = features[near, :, -1]  # [n, R, 3]
    assert (ends[..., 2] > 0.0).all(axis=1).mean() > 0.9  # three ways are known for 50 m
    assert (ends[..., 1].max(axis=1) > 15.0).mean() > 0.9  # to the left
    assert (ends[..., 1].min(axis=1) < -15.0).mean() > 0.9  # to the right


def test_vehicles_stay_on_their_ways():
    traffic = JunctionTraffic(50, 3)
    for time_s in (0.0, 7.0):
        (number, before, velocity, _), (after_number, after, _, yaw) = (
            traffic.at(time_s),
            traffic.at(time_s + 0.1),
        )
        stays = number == after_number
        moved = np.linalg.norm(after - before, axis=1)[stays]
        np.testing.assert_allclose(moved, 0.1 * SPEED_MPS, atol=0.2)
        np.testing.assert_allclose(np.linalg.norm(velocity, axis=1), SPEED_MPS)
        assert np.abs(after).max() < ARM_M + 3.0
        assert np.isfinite(yaw).all()
