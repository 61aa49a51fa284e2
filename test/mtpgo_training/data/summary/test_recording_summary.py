# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The numbers of a recording, against hand-worked ones."""

import dataclasses
import json

import numpy as np
import pytest

from mtpgo_core.schema import AgentClass
from mtpgo_training.data.recording import Recording
from mtpgo_training.data.summary.recording_summary import summarise


def traffic():
    """10 s at 10 Hz: a car at 10 m/s, one that changes its lane to the left, a parked truck, and a
    pedestrian in the first half."""
    frames = np.arange(101)
    t = frames / 10
    tracks = {
        0: (frames, np.stack([10 * t, 0 * t], 1)),
        1: (frames, np.stack([10 * t, -10 + 3.5 * np.clip((t - 4) / 3, 0, 1)], 1)),
        2: (frames, np.stack([50 + 0 * t, 20 + 0 * t], 1)),
        3: (frames[:50], np.stack([t[:50], 30 + 0 * t[:50]], 1)),
    }
    frame = np.concatenate([f for f, _ in tracks.values()])
    track = np.concatenate([np.full(len(f), k) for k, (f, _) in tracks.items()])
    order = np.lexsort((track, frame))
    n = len(frame)
    return Recording(
        name="r", layout="table", location="here", frame_rate=10.0, frame=frame[order],
        track=track[order], position=np.concatenate([p for _, p in tracks.values()])[order],
        velocity=np.full((n, 2), np.nan), acceleration=np.full((n, 2), np.nan),
        yaw=np.full(n, np.nan), track_id=np.arange(4), size=np.full((4, 2), np.nan),
        agent_class=np.array([1, 1, AgentClass.TRUCK, AgentClass.PEDESTRIAN], dtype=np.uint8),
    )  # fmt: skip


def test_the_numbers_of_a_recording():
    summary = summarise(traffic())
    assert (summary.duration_s, summary.frame_rate, summary.tracks) == (10.0, 10.0, 4)
    assert summary.rows == 353
    assert summary.classes == {"car": 2, "truck": 1, "pedestrian": 1}
    assert summary.agents_most == 4
    assert summary.agents_mean == pytest.approx(353 / 101)
    time, count = summary.agents_over_time.T
    assert (count[time < 4.8] == 4).all()
    assert (count[time > 5.1] == 3).all()
    np.testing.assert_allclose(summary.extent_m, [100, 40])
    speed = summary.speed
    assert speed["truck"] == {"rows": 100.0, "moving": 0.0}
    assert speed["pedestrian"]["q50"] == pytest.approx(1.0)
    assert speed["car"]["moving"] == 1.0
    assert speed["car"]["max"] == pytest.approx(np.hypot(10, 3.5 / 3))
    assert speed["all"]["moving"] == pytest.approx(249 / 349)
    assert summary.known["velocity"] == 0.0
    assert summary.known["class"] == 1.0


def test_road_users_are_counted_where_their_sensors_take_turns():
    by_turns = traffic()
    by_turns = by_turns.select_rows((by_turns.frame + by_turns.track) % 2 == 0)
    summary = summarise(by_turns)
    assert summary.agents_most == 4
    assert summary.agents_mean == pytest.approx(353 / 101, abs=0.05)
    away = traffic().select_rows(~np.isin(traffic().frame, range(10, 20)) | (traffic().track > 0))
    assert summarise(away).agents_mean == pytest.approx(343 / 101)
    bridged = traffic().select_rows(
        ~np.isin(traffic().frame, range(10, 14)) | (traffic().track > 0)
    )
    assert summarise(bridged).agents_mean == pytest.approx(353 / 101)


def test_manoeuvres_are_counted_every_second():
    summary = summarise(traffic())
    # Three road users at 0, 1, ..., 5 s. Only from 3 s on do the next 5 s have the whole change,
    # from 4 s to 7 s, and a second of driving straight on before and after it.
    assert summary.manoeuvre_count == 18
    assert summary.manoeuvres["standing"] == pytest.approx(6 / 18)
    assert summary.manoeuvres["change_left"] == pytest.approx(1 / 18)
    assert summary.manoeuvres["lane_keep"] == pytest.approx(11 / 18)
    assert summary.manoeuvres["change_right"] == summary.manoeuvres["turning"] == 0.0


def test_one_row_and_json():
    one = traffic().select_rows(np.arange(353) == 0)
    summary = summarise(one)
    assert (summary.duration_s, summary.manoeuvre_count) == (0.0, 0)
    for content in (summary, summarise(dataclasses.replace(traffic(), name="other"))):
        assert json.loads(json.dumps(content.to_json(), allow_nan=False))["location"] == "here"
