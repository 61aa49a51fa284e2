# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Windows of a recording: what is in them, when there is one, and the tracks cut into pieces."""

import numpy as np
import pytest
from odd_traffic import assert_same_window, jittered_recording, odd_recording
from traffic import braking_cars, cut_windows

from mtpgo_core.history.track_index import find_sort_keys, sort_keys
from mtpgo_core.task.task_description import HistoryConfig
from mtpgo_training.scenes.history_replay import replay
from mtpgo_training.scenes.track_samples import SampleTable, take_in
from mtpgo_training.scenes.windows import Windows, cut_tracks, frames_every

HISTORY = HistoryConfig()


def restarted_windows(recording):
    """The pieces of the tracks, the track of each, and windows of the pieces every 0.2 s."""
    pieces, owner = cut_tracks(recording, 1.0, np.random.default_rng(0))
    frames = frames_every(recording, 0.2).tolist()
    stamps_ns = np.array([recording.stamp_ns(frame) for frame in frames])
    table = SampleTable(take_in(pieces, HISTORY), HISTORY)
    return pieces, owner, Windows(pieces, table, stamps_ns, owner)


def rows_of(keys, wanted):
    """[n] row of each of ``wanted`` [n, 4] in ``keys``."""
    names = sort_keys(keys)
    order = np.argsort(names)
    return order[find_sort_keys(names[order], sort_keys(wanted))]


def test_a_window_contains_nothing_that_comes_later():
    whole = braking_cars()
    half = whole.between(0.0, 4.0)
    full, cut = (cut_windows(r, HISTORY, 0.2) for r in (whole, half))
    assert len(full) > len(cut) > 15
    for a, b in zip(full, cut, strict=False):
        assert a.window.stamp_ns == b.window.stamp_ns
        order = rows_of(a.window.key, b.window.key)
        np.testing.assert_array_equal(a.window.position[order], b.window.position)
        np.testing.assert_array_equal(a.window.acceleration[order], b.window.acceleration)


def test_restarted_windows_are_the_history_of_the_pieces():
    recording = odd_recording(3)
    pieces, owner, windows = restarted_windows(recording)
    reference = list(replay(pieces, HISTORY, windows.instants.stamp_ns.tolist()))
    assert len(windows) == len(reference)
    for mine, theirs in zip(windows, reference, strict=True):
        piece = pieces.find_tracks(theirs.key)
        newest = {int(owner[p]): int(p) for p in np.sort(piece)}
        keep = np.array([newest[int(owner[p])] == p for p in piece], dtype=bool)
        assert_same_window(mine.window, theirs.select(keep))
        np.testing.assert_array_equal(mine.track, owner[piece[keep]])


def test_restarted_agents_have_short_pasts_and_their_own_future():
    recording = braking_cars()
    _, _, windows = restarted_windows(recording)
    assert len(windows) == len(cut_windows(recording, HISTORY, 0.2))
    lengths = []
    for tracked in windows[10:]:
        present = tracked.window.valid[:, -1]
        lengths.extend(tracked.window.valid[present].sum(axis=1))
        frame = round((tracked.window.stamp_ns - recording.start_time_ns) * 1e-9 * 10)
        for agent in np.flatnonzero(present):
            rows = (recording.frame == frame) & (recording.track == tracked.track[agent])
            np.testing.assert_allclose(
                tracked.window.position[agent, -1], recording.position[rows][0]
            )
    assert min(lengths) == 1
    assert max(lengths) <= 6


def test_instants_are_the_last_column_of_the_windows():
    windows = cut_windows(odd_recording(1), HISTORY, 0.4)
    for w, tracked in enumerate(windows):
        rows = windows.instants.rows(w)
        window = tracked.window
        np.testing.assert_array_equal(windows.instants.present[rows], window.valid[:, -1])
        np.testing.assert_array_equal(windows.instants.track[rows], tracked.track)
        np.testing.assert_array_equal(windows.instants.position[rows], window.position[:, -1])
        np.testing.assert_array_equal(windows.instants.velocity[rows], window.velocity[:, -1])


def test_one_agent_seen_once_gives_one_window():
    recording = braking_cars(tracks=1)
    once = recording.select_rows(np.arange(len(recording)) == 40)
    (tracked,) = cut_windows(once, HISTORY, 0.2)
    assert tracked.window.valid.tolist() == [[False] * 15 + [True]]


def test_frames_every_takes_the_nearest_frames_that_there_are():
    steady = braking_cars(seconds=3.0, rate=10.0)
    np.testing.assert_array_equal(frames_every(steady, 0.5), np.arange(0, 30, 5))
    for longer in (3.0, 1e30, np.inf):
        np.testing.assert_array_equal(frames_every(steady, longer), [0])
    missing = steady.select_rows(~np.isin(steady.frame, [10, 11]))
    np.testing.assert_array_equal(frames_every(missing, 0.5), [0, 5, 15, 20, 25])
    jittered = jittered_recording()
    frames = frames_every(jittered, 0.2)
    assert 45 <= len(frames) <= 52
    assert np.abs(np.diff(frames) - 200).max() <= 60


def test_windows_are_a_sequence():
    windows = cut_windows(braking_cars(seconds=2.0), HISTORY, 0.2)
    stamps = windows.instants.stamp_ns.tolist()
    assert [tracked.window.stamp_ns for tracked in windows] == stamps
    assert [tracked.window.stamp_ns for tracked in windows[2:8:3]] == stamps[2:8:3]
    assert windows[-1].window.stamp_ns == stamps[-1]
    for index in (len(windows), -len(windows) - 1):
        with pytest.raises(IndexError):
            windows[index]


def test_there_is_no_window_at_a_time_without_an_agent():
    recording = braking_cars(seconds=3.0)
    gap = recording.select_rows((recording.frame < 8) | (recording.frame > 22))
    frames = (cut_windows(gap, HISTORY, 0.2).instants.stamp_ns - gap.start_time_ns) // 10**8
    # The stride is 2 frames; 8 to 22 are missing, and no frame is near enough to stand in.
    assert frames.tolist() == [0, 2, 4, 6, 24, 26, 28]


def test_pieces_of_a_track_follow_each_other_and_last_as_long_as_asked():
    recording = braking_cars(tracks=3, seconds=5.0, rate=10.0)
    pieces, owner = cut_tracks(recording, 1.2, np.random.default_rng(3))
    np.testing.assert_array_equal(owner[pieces.track], recording.track)
    np.testing.assert_array_equal(pieces.position, recording.position)
    lengths = np.bincount(pieces.track)
    assert lengths.max() == 12
    for track in range(3):
        frames = [recording.frame[pieces.track == p] for p in np.flatnonzero(owner == track)]
        assert [f[0] for f in frames[1:]] == [f[-1] + 1 for f in frames[:-1]]
        assert all(len(f) == 12 for f in frames[1:-1])
