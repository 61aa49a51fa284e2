# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Windows cut from a whole recording equal those of the node's history."""

import numpy as np
import pytest
from odd_traffic import assert_same_window, jittered_recording, odd_recording, replayed
from traffic import cut_windows

from mtpgo_core.task.task_description import HistoryConfig
from mtpgo_training.scenes import track_samples as samples
from mtpgo_training.scenes.track_samples import SampleTable, take_in

HISTORY = HistoryConfig()


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
    reference = replayed(recording, history, 0.2)
    there = [w for w in reference if w.valid[:, -1].any()]
    windows = cut_windows(recording, history, 0.2)
    assert len(windows) == len(there) > 40
    for mine, theirs in zip(windows, there, strict=True):
        assert_same_window(mine.window, theirs)
    assert not all(w.valid.all() for w in there)


def test_the_odd_rows_have_an_effect():
    columns = take_in(odd_recording(), HISTORY)
    begins = len(np.unique(columns["begin"]))
    assert begins > 15  # more pasts than tracks
    assert len(columns["stamp_ns"]) < len(odd_recording())
    assert take_in(jittered_recording(), HISTORY)["replaced"].sum() > 3
    assert not columns["replaced"].any()


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
