# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The trails of a recording: those of the node, causal, and worth having."""

import numpy as np
import pytest
from traffic import turning_cars

from mtpgo_core.scene.trails.trail_context import TrailContext, trail_features
from mtpgo_core.scene.trails.trail_memory import TrailMemory
from mtpgo_core.task.task_description import HistoryConfig
from mtpgo_training.data.ground_truth import FutureTable, future_columns
from mtpgo_training.scenes.history_replay import replay
from mtpgo_training.scenes.recorded_trails import recorded_trails
from mtpgo_training.scenes.track_samples import SampleTable, take_in
from mtpgo_training.scenes.windows import frames_every

HISTORY = HistoryConfig()
H = 25


def memory_of(recording):
    return recorded_trails(recording, SampleTable(take_in(recording, HISTORY), HISTORY))


def features(memory, window):
    return trail_features(window, TrailContext(memory, H, HISTORY.dt_s))


@pytest.fixture(scope="module")
def cars():
    return turning_cars()


@pytest.fixture(scope="module")
def windows(cars):
    """The windows that the node would predict from, one per step of the grid."""
    frames = frames_every(cars, HISTORY.dt_s).tolist()
    return list(replay(cars, HISTORY, map(cars.stamp_ns, frames)))


def test_the_whole_recording_answers_as_the_node_did_at_each_instant(cars, windows):
    offline, online = memory_of(cars), TrailMemory()
    compared = 0
    for window in windows:
        online.add(window, HISTORY.dt_s)
        then = features(online, window)
        np.testing.assert_allclose(features(offline, window), then, atol=1e-5)
        compared += int((then[..., 2] > 0.0).sum())
    assert len(offline) == len(online) > 300
    assert compared > 10_000


def test_what_comes_later_changes_nothing(cars, windows):
    end = len(windows) // 2
    whole = memory_of(cars)
    half = memory_of(cars.between(end_s=(windows[end].stamp_ns - windows[0].stamp_ns) * 1e-9))
    for window in windows[: end + 1 : 5]:
        np.testing.assert_array_equal(features(whole, window), features(half, window))
    assert (features(whole, windows[-1]) != features(half, windows[-1])).any()


def test_constant_speed_along_the_nearest_of_the_ways_halves_the_error_of_constant_velocity(
    cars, windows
):
    memory = memory_of(cars)
    future = FutureTable(cars, max_gap_s=HISTORY.max_gap_s, columns=future_columns(cars, 0.0))
    straight, along = [], []
    for window in windows[75:-25:2]:
        there = window.valid[:, -1]
        ahead = future.at(cars.find_tracks(window.key), window.stamp_ns, H, HISTORY.dt_s)
        there &= ahead.known.all(axis=1)
        speed = np.hypot(*np.nan_to_num(window.velocity[:, -1]).T)
        distance = speed[:, None] * HISTORY.dt_s * np.arange(1, H + 1)
        course = np.stack([np.cos(window.yaw[:, -1]), np.sin(window.yaw[:, -1])], axis=-1)
        left = np.stack([-course[:, 1], course[:, 0]], axis=-1)
        ways = features(memory, window).astype(np.float64)
        path = (ways[..., :1] + distance[:, None, :, None]) * course[:, None, None]
        path += ways[..., 1:2] * left[:, None, None]
        moved = (ahead.position - window.position[:, -1:])[:, None]
        path = np.concatenate([distance[:, None, :, None] * course[:, None, None], path], axis=1)
        error = np.linalg.norm(path - moved, axis=-1).mean(axis=-1)
        straight += error[there, 0].tolist()
        along += error[there].min(axis=1).tolist()
    assert len(straight) > 80
    assert np.mean(along) < 0.5 * np.mean(straight)
