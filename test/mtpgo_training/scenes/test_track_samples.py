# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Windows cut from a whole recording equal those of the node's history."""

import dataclasses

import numpy as np
import pytest
from traffic import braking_cars

from mtpgo_core.history.track_history import TrackHistory
from mtpgo_core.task.task_description import HistoryConfig
from mtpgo_training.scenes import track_samples as samples
from mtpgo_training.scenes.track_samples import SampleTable, take_in
from mtpgo_training.scenes.windows import (
    cut_restarted_windows,
    cut_tracks,
    cut_windows,
    frames_every,
)

HISTORY = HistoryConfig()
FIELDS = ("key", "agent_class", "z", "size", "position", "velocity", "acceleration", "yaw")


def odd_recording(seed=0, rate=25.0):
    """Everything that the history has a rule for: gaps, jumps, unknown values, reused numbers."""
    rng = np.random.default_rng(seed)
    plain = braking_cars(tracks=14, seconds=12.0, rate=rate, seed=seed)
    rows = len(plain)
    keep = rng.random(rows) > 0.03  # single rows are missing
    for track in range(0, 14, 3):  # gaps that are bridged, masked, and forgotten
        start, length = rng.uniform(1.0, 5.0), rng.choice([0.3, 0.8, 2.0, 4.5])
        time = plain.frame / rate
        keep &= ~((plain.track == track) & (time > start) & (time < start + length))
    position, velocity = plain.position.copy(), plain.velocity.copy()
    position[(plain.track == 1) & (plain.frame > 120)] += 80.0  # a number used again elsewhere
    position[rng.random(rows) < 0.01] = np.nan
    position[rng.random(rows) < 0.003] = np.inf
    velocity[rng.random(rows) < 0.2] = np.nan
    velocity[plain.track == 4] = np.nan
    velocity[rng.random(rows) < 0.005] = 300.0
    yaw = plain.yaw.copy()
    yaw[rng.random(rows) < 0.3] = np.nan
    yaw[plain.track == 5] = np.nan
    odd = dataclasses.replace(
        plain,
        position=position,
        velocity=velocity,
        acceleration=rng.normal(0.0, 1.0, (rows, 2)),
        yaw=yaw,
        track_id=np.roll(plain.track_id, 5),  # the keys are not in the order of the tracks
        agent_class=rng.integers(0, 5, 14).astype(np.uint8),
    )
    return odd.select_rows(keep)


def jittered_recording(seed=0):
    """25 Hz with a jitter of 0.04 s on a grid of 1 ms; some messages are closer than 5 ms."""
    rng = np.random.default_rng(seed)
    plain = braking_cars(tracks=8, seconds=10.0, rate=25.0, seed=seed)
    stamps = np.unique(plain.frame)
    moved = np.sort(stamps * 40 + rng.integers(-20, 21, len(stamps)))
    moved += np.arange(len(moved))  # no two at the same time
    return dataclasses.replace(
        plain, frame_rate=1000.0, frame=moved[np.searchsorted(stamps, plain.frame)]
    )


def message_by_message(recording, history, frames):
    """Windows of the history itself."""
    past, windows = TrackHistory(history), []
    wanted = set(frames.tolist())
    for frame, states in zip(recording.frames.tolist(), recording.states(), strict=True):
        past.update(states)
        if frame in wanted:
            windows.append(past.window(states.stamp_ns))
    return windows


def assert_same(a, b):
    assert a.stamp_ns == b.stamp_ns
    assert a.frame_id == b.frame_id
    np.testing.assert_array_equal(a.valid, b.valid)
    for name in FIELDS:
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)
    np.testing.assert_array_equal(a.covariance, b.covariance)


@pytest.mark.parametrize(
    "history",
    [
        HISTORY,
        HistoryConfig(velocity_source="estimated", acceleration_source="message", steps=6),
        HistoryConfig(velocity_tau_s=0.0, max_gap_s=1.0, max_extrapolation_s=0.2, dt_s=0.1),
    ],
)
@pytest.mark.parametrize("make", [odd_recording, jittered_recording])
def test_windows_equal_those_of_the_history(make, history):
    recording = make()
    frames = frames_every(recording, 0.2)
    reference = message_by_message(recording, history, frames)
    there = [w for w in reference if w.valid[:, -1].any()]
    windows = cut_windows(recording, history, 0.2)
    assert len(windows) == len(there) > 40
    for mine, theirs in zip(windows, there, strict=True):
        assert_same(mine.window, theirs)
    assert not all(w.valid.all() for w in there)


def test_the_odd_rows_have_done_something():
    columns = take_in(odd_recording(), HISTORY)
    begins = len(np.unique(columns["begin"]))
    assert begins > 15  # more pasts than tracks
    assert len(columns["stamp_ns"]) < len(odd_recording())
    assert take_in(jittered_recording(), HISTORY)["replaced"].sum() > 3
    assert not columns["replaced"].any()


def test_restarted_windows_are_the_history_of_the_pieces():
    recording = odd_recording(3)
    pieces, owner = cut_tracks(recording, 1.0, np.random.default_rng(0))
    windows = cut_restarted_windows(recording, HISTORY, 0.2, 1.0, np.random.default_rng(0))
    reference = message_by_message(pieces, HISTORY, frames_every(recording, 0.2))
    assert len(windows) == len(reference)
    for mine, theirs in zip(windows, reference, strict=True):
        piece = pieces.find_tracks(theirs.key)
        newest = {int(owner[p]): int(p) for p in np.sort(piece)}
        keep = np.array([newest[int(owner[p])] == p for p in piece], dtype=bool)
        assert_same(mine.window, theirs.select(keep))
        np.testing.assert_array_equal(mine.track, owner[piece[keep]])


def test_instants_are_the_last_column_of_the_windows():
    windows = cut_windows(odd_recording(1), HISTORY, 0.4)
    for w, tracked in enumerate(windows):
        rows = windows.instants.rows(w)
        window = tracked.window
        np.testing.assert_array_equal(windows.instants.present[rows], window.valid[:, -1])
        np.testing.assert_array_equal(windows.instants.track[rows], tracked.track)
        np.testing.assert_array_equal(windows.instants.position[rows], window.position[:, -1])
        np.testing.assert_array_equal(windows.instants.velocity[rows], window.velocity[:, -1])


def test_the_size_of_the_portions_changes_nothing(monkeypatch):
    recording = odd_recording()
    whole = take_in(recording, HISTORY)
    monkeypatch.setattr(samples, "TRACKS_AT_ONCE", 3)
    monkeypatch.setattr(samples, "ROWS_AT_ONCE", 100)
    small = take_in(recording, HISTORY)
    for name, column in whole.items():
        np.testing.assert_array_equal(column, small[name])


def test_an_empty_recording_gives_no_window():
    empty = odd_recording().select_rows(np.zeros(len(odd_recording()), dtype=bool))
    assert len(cut_windows(empty, HISTORY, 0.2)) == 0
    assert len(SampleTable(take_in(empty, HISTORY), HISTORY)) == 0


def test_one_agent_seen_once_gives_one_window():
    recording = braking_cars(tracks=1)
    once = recording.select_rows(np.arange(len(recording)) == 40)
    (tracked,) = cut_windows(once, HISTORY, 0.2)
    assert tracked.window.valid.tolist() == [[False] * 15 + [True]]


def test_frames_every_takes_what_there_is():
    steady = braking_cars(seconds=3.0, rate=10.0)
    np.testing.assert_array_equal(frames_every(steady, 0.5), np.arange(0, 30, 5))
    missing = steady.select_rows(~np.isin(steady.frame, [10, 11]))
    np.testing.assert_array_equal(frames_every(missing, 0.5), [0, 5, 15, 20, 25])
    jittered = jittered_recording()
    frames = frames_every(jittered, 0.2)
    assert 45 <= len(frames) <= 52
    assert np.abs(np.diff(frames) - 200).max() <= 60
