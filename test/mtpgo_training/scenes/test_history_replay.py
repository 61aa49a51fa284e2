# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Replay of a recording: the windows of the node's history, fed frame by frame."""

import numpy as np
from odd_traffic import assert_same_window
from traffic import braking_cars

from mtpgo_core.history.track_history import TrackHistory
from mtpgo_core.task.task_description import HistoryConfig
from mtpgo_training.scenes.history_replay import replay

HISTORY = HistoryConfig()
RECORDING = braking_cars(tracks=5, seconds=3.0, rate=10.0)


def stamps(*times_s):
    return [RECORDING.start_time_ns + round(t * 1e9) for t in times_s]


def fed_by_hand(stamp_ns):
    """The window of a history that has observed every frame up to a time."""
    history = TrackHistory(HISTORY)
    for states in RECORDING.states():
        if states.stamp_ns <= stamp_ns:
            history.update(states)
    return history.window(stamp_ns)


def test_a_window_holds_every_frame_up_to_its_time():
    times = stamps(0.0, 0.7, 0.75, 2.9, 3.2)
    for window, stamp_ns in zip(replay(RECORDING, HISTORY, times), times, strict=True):
        assert_same_window(window, fed_by_hand(stamp_ns))


def test_no_frame_is_observed_before_it_is_due():
    observed = []
    windows = replay(
        RECORDING, HISTORY, stamps(0.5, 0.5, 1.0), on_frame=lambda: observed.append(1)
    )
    counts = [len(observed) for _ in windows]
    assert counts == [6, 6, 11]


def test_before_the_first_frame_the_window_is_empty():
    (window,) = replay(RECORDING, HISTORY, stamps(-1.0))
    assert len(window) == 0


def test_with_one_sample_every_agent_is_seen_for_the_first_time():
    for window in replay(RECORDING, HISTORY, stamps(1.0, 2.5), one_sample=True):
        assert len(window) == 5
        np.testing.assert_array_equal(window.valid[:, :-1], False)
        assert window.valid[:, -1].all()
