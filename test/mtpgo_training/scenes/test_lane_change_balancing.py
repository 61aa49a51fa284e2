# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Lane changes drawn more often and lane keeping less, to the share that was asked for."""

import dataclasses

import numpy as np
import pytest
from traffic import braking_cars

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.task.task_description import HistoryConfig, SceneConfig
from mtpgo_training.data.data_config import DataConfig
from mtpgo_training.data.recording import Recording
from mtpgo_training.scenes.lane_change_balancing import NO_MANOEUVRE, balanced_copies
from mtpgo_training.scenes.prepared_recording import prepare
from mtpgo_training.scenes.scene_dataset import SceneDataset

HISTORY, SCENE = HistoryConfig(), SceneConfig(max_neighbours=7)
BALANCED = DataConfig(
    restart_probability=0.0, stride_s=0.4, lane_change_share=2.0 / 3.0, lane_change_copies=2.0
)
WIDTH_M = 3.75


def motorway(name="01", *, left=2, right=1, keep=27, lines=True, seconds=20.0, rate=10.0):
    """Cars at 25 m/s along +x, some of which change to the next lane at different times."""
    rng = np.random.default_rng(5)
    frames = np.arange(round(seconds * rate))
    t = frames / rate
    tracks = left + right + keep
    side = np.array([1.0] * left + [-1.0] * right + [0.0] * keep)
    x = 25.0 * t + 40.0 * np.arange(tracks)[:, None]
    ease = 1.0 / (1.0 + np.exp(-2.0 * (t - rng.uniform(9.0, 11.0, tracks)[:, None])))
    y = WIDTH_M * (0.5 + side[:, None] * ease)  # from the middle lane
    vy = np.gradient(y, 1.0 / rate, axis=1)
    frame, track = np.meshgrid(frames, np.arange(tracks))
    order = np.lexsort((track.ravel(), frame.ravel()))

    def column(*values):
        return np.stack([np.broadcast_to(v, x.shape).ravel()[order] for v in values], axis=1)

    ends = np.array([-100.0, 3000.0])
    lane = tuple(np.stack([ends, np.full(2, WIDTH_M * k)], axis=1) for k in (-1, 0, 1, 2))
    return Recording(
        name=name,
        layout="highd",
        location="made",
        frame_rate=rate,
        frame=frame.ravel()[order],
        track=track.ravel()[order],
        position=column(x, y),
        velocity=column(25.0, vy),
        acceleration=np.full((x.size, 2), np.nan),
        yaw=np.arctan2(column(vy)[:, 0], 25.0),
        track_id=np.arange(1, tracks + 1),
        agent_class=np.ones(tracks, dtype=np.uint8),
        size=np.tile([4.5, 1.9], (tracks, 1)),
        lanes=lane if lines else (),
        sha256="f" * 64,
    )


def dataset(recording, data=BALANCED, seed=1):
    source = prepare(recording, HISTORY, SCENE, data, training=True)
    return SceneDataset([source], HISTORY, SCENE, data, 25, seed)


def drawn(data, epochs=6):
    """Share of left, right and keeping among the centres of some epochs."""
    source = data.sources[0]
    found = []
    for epoch in range(epochs):
        data.set_epoch(epoch)
        for item in data.items:
            found.append(
                int(source.changes[source.windows.instants.rows(item.window)][item.centre])
            )
    return {value: float(np.mean(np.array(found) == value)) for value in (-1, 0, 1, NO_MANOEUVRE)}


@pytest.mark.parametrize("lines", [True, False])
def test_a_third_each_of_left_right_and_keeping(lines):
    data = dataset(motorway(lines=lines))
    share = drawn(data)
    assert share[NO_MANOEUVRE] == 0.0
    for value in (-1, 0, 1):
        assert share[value] == pytest.approx(1 / 3, abs=0.08)


@pytest.mark.parametrize("lines", [True, False])
def test_what_is_a_lane_change(lines):
    data = dataset(motorway(lines=lines, left=1, right=1, keep=1))
    changes, instants = data.sources[0].changes, data.sources[0].windows.instants
    for track, value in ((0, 1), (1, -1), (2, 0)):
        mine = changes[instants.track == track]
        assert set(mine.tolist()) <= {value, 0, NO_MANOEUVRE}
        assert (mine == value).sum() >= 4
    before_the_end = instants.stamp_ns[instants.window] <= instants.stamp_ns[0] + 14.5e9
    assert (changes[~before_the_end & (instants.track == 2)] == NO_MANOEUVRE).sum() >= 5


def test_the_share_follows_from_counts():
    found = np.array([1] * 10 + [-1] * 5 + [0] * 400 + [NO_MANOEUVRE] * 50, dtype=np.int8)
    copies = balanced_copies([(found, np.ones(len(found)))], 2.0 / 3.0, 2.0)
    assert copies[1] * 10 == pytest.approx(15.0)  # 2 x 15 changes, half of them to each side
    assert copies[-1] * 5 == pytest.approx(15.0)
    assert copies[0] * 400 == pytest.approx(15.0)
    assert copies[NO_MANOEUVRE] == 0.0


def test_changes_to_one_side_and_too_few_lane_keepers():
    found = np.array([1] * 10 + [0] * 3, dtype=np.int8)
    copies = balanced_copies([(found, np.ones(13))], 0.5, 1.0)
    assert copies[1] == pytest.approx(1.0)
    assert copies[0] == 1.0


def test_the_draw_is_that_of_seed_and_epoch():
    one, same, other = (dataset(motorway(), seed=seed) for seed in (1, 1, 2))
    for data in (one, same, other):
        data.set_epoch(3)
    assert one.items == same.items != other.items


def test_no_lane_change_at_all_is_reported():
    with pytest.raises(ConfigurationError, match="no agent changes its lane"):
        dataset(motorway(left=0, right=0, keep=3))


def test_only_the_classes_named_are_centres():
    recording = braking_cars()
    classes = recording.agent_class.copy()
    classes[::2] = 7
    recording = dataclasses.replace(recording, agent_class=classes)
    data = DataConfig(restart_probability=0.5, centre_classes=("pedestrian",))
    scenes = dataset(recording, data)
    assert len(scenes) > 30
    for item in scenes.items:
        source = scenes.sources[0]
        windows = source.views[item.view].windows
        assert windows[item.window].window.agent_class[item.centre] == 7
