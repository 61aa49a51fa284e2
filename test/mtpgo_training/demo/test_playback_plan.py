# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0

import numpy as np
import pytest
from demo_traffic import make_recording

from mtpgo_core.errors import RecordingError
from mtpgo_training.demo.playback_plan import PAUSE_S, make_plan

TRAINING = {
    "recordings": [
        {"name": "a", "sha256": "aa", "split": "train"},
        {"name": "b", "sha256": "bb", "split": "validation"},
        {"name": "c", "sha256": "cc", "split": "test"},
    ]
}


def four():
    return [make_recording(name, 2.0, sha256=2 * name) for name in ("a", "b", "c", "d")]


def test_recordings_that_the_model_was_trained_on_are_left_out():
    plan = make_plan(four(), TRAINING, play_all=False)
    assert [r.name for r in plan.recordings] == ["c", "d"]
    assert plan.left_out == ("a", "b")
    assert plan.duration_s == pytest.approx(4.0)


def test_all_are_played_on_request():
    plan = make_plan(four(), TRAINING, play_all=True)
    assert len(plan.recordings) == 4
    assert plan.left_out == ()


def test_without_a_description_of_the_training_nothing_is_left_out():
    assert len(make_plan(four(), {}, play_all=False).recordings) == 4


def test_nothing_left_to_play_is_an_error():
    with pytest.raises(RecordingError, match=r"with all recordings given \(a, b\)"):
        make_plan(four()[:2], TRAINING, play_all=False)
    empty = make_recording().select_rows(np.zeros(242, dtype=bool))
    with pytest.raises(RecordingError, match="are empty"):
        make_plan([empty], {}, play_all=False)


def test_stamps_increase_with_a_pause_for_any_first_frame():
    recordings = [make_recording("a", 2.0, start_frame=500), make_recording("b", 3.0)]
    plan = make_plan(recordings, {}, play_all=False)
    (first, end), (begin, last) = (r.span_ns for r in plan.recordings)
    assert end - first == 2 * 10**9
    assert begin - end == PAUSE_S * 10**9
    assert last - begin == 3 * 10**9
    assert [plan.at(t) for t in (first, end, end + 1, begin, last)] == [0, 0, None, 1, 1]


def test_tracks_are_found_by_their_keys(recording):
    key = np.array([[8, 0, 0, 0], [9, 0, 0, 0], [7, 0, 0, 0], [7, 1, 0, 0]], dtype=np.uint32)
    assert recording.find_tracks(key).tolist() == [1, -1, 0, -1]
