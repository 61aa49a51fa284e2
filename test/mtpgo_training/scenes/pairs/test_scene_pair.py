# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A training scene and its road users a moment later: the same ones, in frames that fit."""

import dataclasses

import numpy as np
import pytest
import torch
from torch_geometric.data import Batch
from traffic import braking_cars, turning_cars

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.scene.scene_builder import build_scenes
from mtpgo_core.schema import AgentClass
from mtpgo_core.task.task_description import HistoryConfig, SceneConfig
from mtpgo_training.data.data_config import DataConfig
from mtpgo_training.scenes.pairs.scene_pair import (
    are_steps_apart,
    is_compared,
    steps_between_windows,
)
from mtpgo_training.scenes.prepared_recording import prepare
from mtpgo_training.scenes.scene_dataset import SceneDataset, dense, trail_context

HISTORY, H = HistoryConfig(), 25
SCENE = SceneConfig(max_neighbours=4, radius_m=50.0, trails=True)
PLAIN = DataConfig(stride_s=0.4, restart_probability=0.0, trails_partial_probability=0.0)


def paired(recording, data=PLAIN):
    source = prepare(recording, HISTORY, SCENE, data, training=True)
    return SceneDataset([source], HISTORY, SCENE, data, H, 1, pairs=True)


@pytest.mark.parametrize(
    "changes",
    [{}, {"mirror_probability": 1.0, "rotation_std_rad": 1.0, "scale_std": 0.2}],
    ids=["as recorded", "mirrored, turned and scaled"],
)
def test_later_positions_are_the_future_of_the_scene(changes):
    """Seen at the end of the later past, in the frame of the earlier scene: its second step."""
    data = paired(turning_cars(), dataclasses.replace(PLAIN, **changes))
    compared = 0
    for sample in data:
        there = (sample.later_both > 0.0) & (sample.weight[:, 1] > 0.0)
        change = sample.later_change[there]
        seen = torch.einsum("nij,nj->ni", change[..., :2], sample.later_x[there, -1, :2])
        torch.testing.assert_close(
            seen + change[..., 2], sample.target[there, 1, :2], atol=0.02, rtol=0.0
        )
        compared += int(there.sum())
    assert compared > 300


def test_the_later_past_is_that_of_the_next_windows_own_scene():
    data = paired(braking_cars())
    (source,) = data.sources
    compared = 0
    for item, sample in zip(data.items, data, strict=True):
        if not sample.later_both[0]:
            continue
        tracked, later = source.windows[item.window], source.windows[item.window + 1]
        (centre,) = np.flatnonzero(later.track == tracked.track[item.centre])
        trails = trail_context(source, source.views[0], later, H, HISTORY.dt_s, item.trails_age)
        own = build_scenes(later.window, SCENE, centres=np.array([centre]), trails=trails)
        np.testing.assert_array_equal(sample.later_x[0], own.features[0, 0])
        np.testing.assert_array_equal(sample.later_valid[0], own.valid[0, 0])
        np.testing.assert_array_equal(sample.later_trails[0], own.trails[0, 0])
        mine = later.track[own.agent[0]]
        agents = build_scenes(
            tracked.window, SCENE, centres=np.array([item.centre]), trails=trails
        ).agent[0]
        expected = np.isin(tracked.track[agents], mine) & is_compared(tracked.window)[agents]
        np.testing.assert_array_equal(sample.later_both > 0.0, expected)
        compared += 1
    assert compared > 50


def test_no_agent_is_in_both_after_the_last_window():
    data = paired(braking_cars())
    last = len(data.sources[0].windows) - 1
    samples = [s for item, s in zip(data.items, data, strict=True) if item.window == last]
    assert samples
    for sample in samples:
        assert not sample.later_both.any()
        torch.testing.assert_close(sample.later_x, sample.x)


def test_pairs_of_different_scenes_make_a_batch():
    data = paired(braking_cars())
    fields = dense(Batch.from_data_list([data[0], data[len(data) - 1]]))
    assert fields["later_x"].shape == fields["x"].shape
    assert fields["later_trails"].shape == fields["trails"].shape
    assert fields["later_change"].shape == (*fields["weight"].shape[:2], 2, 3)


def test_a_stride_between_two_steps_is_an_error_before_anything_is_cut():
    with pytest.raises(ConfigurationError, match=r"data\.stride_s is 0\.5 .* multiple of .* 0\.2"):
        paired(braking_cars(), dataclasses.replace(PLAIN, stride_s=0.5))
    with pytest.raises(ConfigurationError, match=r"below the horizon of 0\.4 s"):
        steps_between_windows(0.4, 0.2, 2)
    assert steps_between_windows(0.4, 0.2, 3) == 2


def test_recordings_whose_frames_are_not_a_stride_apart_are_an_error():
    """With frames of 8 Hz they are 0.375 s apart."""
    with pytest.raises(ConfigurationError, match=r"no recording of data\.train has two windows"):
        paired(braking_cars(rate=8.0))


def test_stamps_of_a_camera_count_as_whole_steps():
    assert are_steps_apart(0, round(12e9 / 29.97), 0.2, 2)
    assert not are_steps_apart(0, 375_000_000, 0.2, 2)
    assert not are_steps_apart(0, 800_000_000, 0.2, 2)


def test_moving_vehicles_are_compared_and_pedestrians_and_standing_ones_are_not():
    (tracked, *_) = paired(braking_cars()).sources[0].windows
    window = tracked.window
    velocity = np.zeros_like(window.velocity)
    velocity[1:3, -1] = 3.0, 4.0
    velocity[3, -1] = np.nan
    agent_class = np.full_like(window.agent_class, AgentClass.CAR)
    agent_class[2] = AgentClass.PEDESTRIAN
    changed = dataclasses.replace(window, velocity=velocity, agent_class=agent_class)
    assert np.flatnonzero(is_compared(changed)).tolist() == [1]
