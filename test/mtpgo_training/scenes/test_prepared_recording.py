# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A prepared recording: what differs between training and validation, weights and candidates."""

import dataclasses

import numpy as np
import pytest
from traffic import braking_cars

from mtpgo_core.task.task_description import HistoryConfig, SceneConfig
from mtpgo_training.data.data_config import DataConfig
from mtpgo_training.data.splits import NamedRecording, split
from mtpgo_training.scenes.prepared_recording import prepare, prepare_all, source_weight

HISTORY, SCENE = HistoryConfig(), SceneConfig()
DATA = DataConfig(
    stride_s=0.4, validation_stride_s=1.0, restart_probability=0.5, velocity_smoothing_s=0.5
)
CARS = braking_cars(tracks=5, seconds=5.0)


def prepared(recording=CARS, data=DATA, scene=SCENE, *, training=True, **options):
    return prepare(recording, HISTORY, scene, data, training=training, **options)


def test_training_and_validation_have_their_own_strides_restarts_and_smoothing():
    train, validate = prepared(), prepared(training=False)
    assert set(np.diff(train.windows.instants.stamp_ns).tolist()) == {400_000_000}
    assert set(np.diff(validate.windows.instants.stamp_ns).tolist()) == {1_000_000_000}
    assert len(train.restarted) == len(train.windows)
    assert validate.restarted is None
    noise = np.random.default_rng(0).normal(0.0, 0.3, CARS.velocity.shape)
    noisy = dataclasses.replace(CARS, velocity=CARS.velocity + noise)
    asked = np.array([1]), CARS.stamp_ns(10), 5, 0.2
    recorded = noisy.velocity[noisy.track == 1][12:21:2]
    kept = prepared(noisy, training=False).future.at(*asked).velocity[0]
    smooth = prepared(noisy).future.at(*asked).velocity[0]
    np.testing.assert_array_equal(kept, recorded)
    assert np.abs(smooth - recorded).max() > 0.05


def test_restarts_follow_from_the_seed():
    one, same, other = (
        [tracked.window.valid.sum() for tracked in prepared(seed=seed).restarted]
        for seed in (1, 1, 2)
    )
    assert one == same != other
    assert prepared(data=dataclasses.replace(DATA, restart_probability=0.0)).restarted is None


def test_lanes_are_kept_only_for_the_context_that_needs_them():
    line = np.array([[0.0, 0.0], [9.0, 0.0]])
    recording = dataclasses.replace(CARS, lanes=(line,))
    assert prepared(recording).lanes is None
    assert prepared(recording, scene=SceneConfig(context="lanes")).lanes is not None


def test_candidates_are_the_agents_present_at_the_time():
    gone = CARS.select_rows((CARS.track != 2) | (CARS.frame <= 20))
    source = prepared(gone)
    left = 0
    for w, tracked in enumerate(source.windows):
        present = np.flatnonzero(tracked.window.valid[:, -1])
        found = source.candidates(w)
        np.testing.assert_array_equal(found.index, present)
        np.testing.assert_array_equal(found.position, tracked.window.position[present, -1])
        left += len(tracked.track) - len(present)
    assert left > 3


@pytest.mark.parametrize("restarted", [False, True])
def test_chance_and_lane_change_of_a_candidate_are_those_of_its_track(restarted):
    source = prepared()
    instants = source.windows.instants
    source = dataclasses.replace(
        source, chance=0.1 * instants.track, changes=instants.track.astype(np.int8)
    )
    for w in range(len(source.windows)):
        found = source.candidates(w, restarted=restarted)
        tracked = source.window(w, restarted=restarted)
        np.testing.assert_array_equal(found.changes, tracked.track[found.index])
        np.testing.assert_allclose(found.chance, 0.1 * tracked.track[found.index])


def test_without_restarts_the_windows_are_the_plain_ones():
    source = prepared(training=False)
    one, other = source.window(1, restarted=True), source.windows[1]
    np.testing.assert_array_equal(one.window.valid, other.window.valid)
    np.testing.assert_array_equal(
        source.candidates(1, restarted=True).index, source.candidates(1).index
    )


def test_the_weight_of_a_recording_has_priority_over_its_directory():
    one, two = (
        NamedRecording("cars", braking_cars(name, seconds=5.0, tracks=3)) for name in ("01", "02")
    )
    data = DataConfig(source_weight={"cars": 0.5, "cars/02": 2.0})
    assert (source_weight(one, data), source_weight(two, data)) == (0.5, 2.0)
    assert source_weight(one, DataConfig()) == 1.0
    part = split([two], DataConfig(split="time", block_s=1.0), 0, 0.1).train[0]
    assert source_weight(part, data) == 2.0
    (first, second) = prepare_all([one, two], HISTORY, SCENE, data, training=True)
    assert (first.weight, second.weight) == (0.5, 2.0)
