# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A prepared recording: what differs between training and validation, weights and candidates."""

import dataclasses

import numpy as np
import pytest
from traffic import braking_cars

from mtpgo_core.task.task_description import HistoryConfig, SceneConfig
from mtpgo_training.data.data_config import DataConfig
from mtpgo_training.data.recording_cache import RecordingCache
from mtpgo_training.data.splits import NamedRecording, split
from mtpgo_training.scenes.history_replay import replay
from mtpgo_training.scenes.prepared_recording import (
    RECORDED,
    RESTARTED,
    TRACKED,
    prepare,
    prepare_all,
    source_weight,
    trackers_of,
)
from mtpgo_training.scenes.tracker.simulated_tracker import SimulatedTracker

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


def with_trackers(**changes):
    return dataclasses.replace(DATA, tracker_share=0.5, **changes)


def test_training_has_as_many_trackers_as_wanted_and_validation_one():
    train = prepared(data=with_trackers(tracker_variants=2, validation_tracker=True))
    assert len(train.tracked) == 2
    for windows in (view.windows for view in train.tracked):
        np.testing.assert_array_equal(windows.instants.stamp_ns, train.windows.instants.stamp_ns)
    assert prepared().tracked == ()
    assert prepared(data=with_trackers(), training=False).tracked == ()
    validation = with_trackers(validation_tracker=True)
    seen = [
        prepared(data=validation, training=False, seed=seed).tracked[0].windows.instants.position
        for seed in (1, 2)
    ]
    np.testing.assert_array_equal(*seen)  # runs with different seeds are comparable
    drawn = [trackers_of(CARS, validation, training=True, seed=seed) for seed in (1, 1, 2)]
    assert drawn[0] == drawn[1] != drawn[2]


def test_a_tracked_window_is_what_the_history_makes_of_the_reports():
    data = with_trackers(tracker_variants=4)
    source = prepared(data=data)
    trackers = trackers_of(CARS, data, training=True, seed=0)
    for tracker, view in zip(trackers, source.tracked, strict=True):
        windows = view.windows
        stamps = windows.instants.stamp_ns
        if tracker.restarts:
            longest = max(w.window.valid.sum(axis=1).max(initial=0) for w in windows)
            assert longest < HISTORY.steps
            continue
        replayed = replay(tracker.observe(CARS), HISTORY, stamps)
        for cut, window in zip(windows, replayed, strict=True):
            for name in ("key", "agent_class", "size", "position", "velocity", "yaw", "valid"):
                np.testing.assert_array_equal(getattr(cut.window, name), getattr(window, name))
    assert {tracker.restarts for tracker in trackers} == {False, True}


def test_trackers_are_kept_in_the_cache(tmp_path, monkeypatch):
    data = with_trackers(tracker_variants=2)
    first = prepared(data=data, cache=RecordingCache(tmp_path))
    monkeypatch.setattr(SimulatedTracker, "observe", None)  # a second observation would fail
    second = prepared(data=data, cache=RecordingCache(tmp_path))
    for one, other in zip(first.tracked, second.tracked, strict=True):
        for a, b in zip(one.windows, other.windows, strict=True):
            np.testing.assert_array_equal(a.window.position, b.window.position)
            np.testing.assert_array_equal(a.track, b.track)


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


@pytest.mark.parametrize("view", [RECORDED, RESTARTED, TRACKED, TRACKED + 1])
def test_chance_and_lane_change_of_a_candidate_are_those_of_its_track(view):
    source = prepared(data=dataclasses.replace(DATA, tracker_share=0.5, tracker_variants=2))
    instants = source.windows.instants
    source = dataclasses.replace(
        source, chance=0.1 * instants.track, changes=instants.track.astype(np.int8)
    )
    for w in range(len(source.windows)):
        found = source.candidates(w, view)
        tracked = source.views[view].windows[w]
        np.testing.assert_array_equal(found.changes, tracked.track[found.index])
        np.testing.assert_allclose(found.chance, 0.1 * tracked.track[found.index])


def test_without_restarts_the_windows_are_the_plain_ones():
    source = prepared(training=False)
    one, other = source.views[RESTARTED].windows[1], source.windows[1]
    np.testing.assert_array_equal(one.window.valid, other.window.valid)
    np.testing.assert_array_equal(
        source.candidates(1, RESTARTED).index, source.candidates(1).index
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
