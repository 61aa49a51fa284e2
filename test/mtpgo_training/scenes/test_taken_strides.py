# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Strides that are no whole number of frames: at 10 and 2.5 Hz, and what is said of them."""

import dataclasses

import numpy as np
import pytest
from traffic import braking_cars

from mtpgo_training.scenes.taken_strides import (
    rounded_stride_s,
    rounded_strides,
    rounding_sentences,
)
from mtpgo_training.scenes.windows import frames_every


@pytest.mark.parametrize(
    ("rate", "stride_s", "taken_s"),
    [
        (10.0, 0.25, 0.2),
        (10.0, 0.26, 0.3),
        (10.0, 0.3, None),
        (2.5, 0.2, 0.4),
        (2.5, 1.0, 0.8),
        (2.5, 0.4, None),
        (29.97, 1.0, None),  # 30 frames are 1.001 s
        (10.0, 60.25, None),  # longer than the recording: one instant is left
    ],
)
def test_what_becomes_of_a_stride(rate, stride_s, taken_s):
    recording = braking_cars(rate=rate, seconds=9.0)
    found = rounded_stride_s(recording, stride_s)
    assert found == (None if taken_s is None else pytest.approx(taken_s))
    frames = frames_every(recording, stride_s)
    steps_s = np.diff(frames) / recording.frame_rate
    np.testing.assert_allclose(steps_s, taken_s or stride_s, rtol=0.01)


def test_a_recording_without_road_users_has_every_stride():
    recording = braking_cars()
    empty = recording.select_rows(np.zeros(len(recording), dtype=np.bool_))
    assert rounded_stride_s(empty, 0.25) is None


def test_each_stride_that_is_taken_is_said_once_with_a_recording():
    slow, fast = braking_cars(rate=2.5), braking_cars(rate=10.0)
    same = dataclasses.replace(fast, frame_rate=20.0)
    recordings = {"a/01": slow, "a/02": fast, "b/01": fast, "b/02": same}
    taken_s = rounded_strides(recordings, 0.25)
    assert taken_s == pytest.approx({"a/01": 0.4, "a/02": 0.2, "b/01": 0.2})
    told = "--stride is 0.25 s, which is no whole number of frames: instants are scored every"
    assert rounding_sentences("--stride", 0.25, taken_s, "instants are scored") == [
        f"{told} 0.4 s (a/01)",
        f"{told} 0.2 s (a/02 and 1 more)",
    ]
    assert rounding_sentences("--stride", 0.25, {}, "instants are scored") == []
