# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The future of a track against the closed form of its motion."""

import dataclasses

import numpy as np
import pytest

from mtpgo_training.data.ground_truth import FutureTable
from mtpgo_training.data.recording import Recording

RATE = 10.0


def parabola(frames, track, x0, speed, acceleration):
    t = frames / RATE
    x = x0 + speed * t + 0.5 * acceleration * t**2
    return frames, np.full(len(frames), track), x, speed + acceleration * t


def recording(*pieces):
    frame, track, x, v = (np.concatenate(c) for c in zip(*pieces, strict=True))
    order = np.lexsort((track, frame))
    zero = np.zeros(len(frame))
    n = int(track.max()) + 1
    return Recording(
        name="01",
        layout="ind",
        location="test",
        frame_rate=RATE,
        frame=frame[order].astype(np.int64),
        track=track[order].astype(np.int64),
        position=np.stack([x, zero], axis=-1)[order],
        velocity=np.stack([v, zero], axis=-1)[order],
        acceleration=np.full((len(frame), 2), np.nan),
        yaw=np.full(len(frame), np.nan),
        track_id=np.arange(n),
        agent_class=np.ones(n, dtype=np.uint8),
        size=np.full((n, 2), np.nan),
    )


def test_states_on_the_grid_are_the_recorded_ones_and_end_with_the_track():
    table = FutureTable(
        recording(
            parabola(np.arange(5, 40), 0, 10.0, 4.0, 1.0),
            parabola(np.arange(0, 100), 1, 0.0, 8.0, 0.0),
        )
    )
    start = recording(parabola(np.arange(2), 0, 0.0, 0.0, 0.0)).stamp_ns(30)
    future = table.at(np.array([0, 1, -1]), start, 5, 0.2)
    frames = np.array([32, 34, 36, 38, 40])
    np.testing.assert_array_equal(future.known[0], [True, True, True, True, False])
    assert future.known[1].all()
    assert not future.known[2].any()
    t = frames[:4] / RATE
    np.testing.assert_allclose(future.position[0, :4, 0], 10 + 4 * t + 0.5 * t**2)
    np.testing.assert_allclose(future.velocity[0, :4, 0], 4 + t)
    np.testing.assert_array_equal(future.position[0, 4], 0.0)
    np.testing.assert_allclose(future.position[1, :, 0], 8 * frames / RATE)


def test_between_frames_the_position_is_linear_and_long_gaps_stay_unknown():
    frames = np.array([0, 1, 2, 6, 7, 20, 21])
    table = FutureTable(recording(parabola(frames, 0, 0.0, 10.0, 0.0)), max_gap_s=0.5)
    rec = recording(parabola(frames, 0, 0.0, 10.0, 0.0))
    future = table.at(np.array([0]), rec.stamp_ns(0), 8, 0.25)
    # Frames 2.5, 5, 7.5, 10, ...: inside the bridged gap 2 to 6, then in the long one 7 to 20.
    expected = [True, True, False, False, False, False, False, True]
    np.testing.assert_array_equal(future.known[0], expected)
    np.testing.assert_allclose(future.position[0, [0, 1, 7], 0], [2.5, 5.0, 20.0])


def test_smoothed_velocities_are_exact_on_a_parabola_and_quieter_on_noise():
    clean = recording(parabola(np.arange(60), 0, 0.0, 5.0, 2.0))
    at_all = np.array([0]), clean.stamp_ns(0), 58, 0.1
    smooth = FutureTable(clean, velocity_smoothing_s=0.3).at(*at_all)
    exact = 5.0 + 2.0 * np.arange(1, 59) / RATE
    np.testing.assert_allclose(smooth.velocity[0, :, 0], exact, atol=2e-3)
    noisy = dataclasses.replace(
        clean, position=clean.position + np.random.default_rng(0).normal(0, 0.1, (60, 2))
    )
    smooth = FutureTable(noisy, velocity_smoothing_s=0.4).at(*at_all)
    raw = np.gradient(noisy.position[:, 0], 1 / RATE)[1:59]
    middle = slice(8, 50)
    error = np.abs(smooth.velocity[0, middle, 0] - exact[middle]).mean()
    assert error < 0.4 * np.abs(raw - exact)[middle].mean()


def test_unknown_velocities_are_filled_from_the_positions():
    clean = recording(parabola(np.arange(30), 0, 0.0, 5.0, 0.0))
    blank = dataclasses.replace(clean, velocity=np.full((30, 2), np.nan))
    future = FutureTable(blank).at(np.array([0]), clean.stamp_ns(0), 10, 0.2)
    np.testing.assert_allclose(future.velocity[0, :, 0], 5.0, atol=1e-3)


def test_velocities_of_a_recording_with_years_between_its_rows():
    two = recording(parabola(np.arange(2), 0, 0.0, 5.0, 0.0), parabola(np.arange(1), 1, 9, 0, 0))
    slow = dataclasses.replace(two, frame_rate=1.1e-8, velocity=np.full((3, 2), np.nan))
    table = FutureTable(slow, max_gap_s=1e9)
    future = table.at(np.array([0]), slow.stamp_ns(0), 1, 1.0 / slow.frame_rate)
    np.testing.assert_allclose(future.velocity[0, 0, 0], 0.5 * slow.frame_rate, rtol=1e-3)


@pytest.mark.parametrize("smoothing_s", [0.0, 0.3])
def test_a_row_without_a_finite_position_is_no_observation(smoothing_s):
    clean = recording(parabola(np.arange(30), 0, 0.0, 5.0, 0.0))
    position = clean.position.copy()
    position[10], position[20:27] = np.nan, np.inf
    odd = dataclasses.replace(clean, position=position)
    table = FutureTable(odd, velocity_smoothing_s=smoothing_s)
    future = table.at(np.array([0]), clean.stamp_ns(0), 29, 0.1)
    # Frame 10 is bridged, the gap from 19 to 27 is longer than 0.5 s.
    frames = np.arange(1, 30)
    np.testing.assert_array_equal(future.known[0], (frames < 20) | (frames > 26))
    exact = np.where(future.known[0], 0.5 * frames, 0.0)
    np.testing.assert_allclose(future.position[0, :, 0], exact)
    np.testing.assert_allclose(future.velocity[0, future.known[0], 0], 5.0, atol=1e-3)


def test_without_a_finite_position_nothing_is_known():
    clean = recording(parabola(np.arange(9), 0, 0.0, 5.0, 0.0))
    hidden = dataclasses.replace(clean, position=np.full((9, 2), np.nan))
    future = FutureTable(hidden).at(np.array([0, -1]), clean.stamp_ns(0), 3, 0.2)
    assert future.known.shape == (2, 3)
    assert not future.known.any()
    assert not future.position.any()


def test_a_track_seen_once_stands():
    once = recording(parabola(np.arange(1), 0, 3.0, 0.0, 0.0), parabola(np.arange(9), 1, 0, 1, 0))
    blank = dataclasses.replace(once, velocity=np.full((10, 2), np.nan))
    future = FutureTable(blank).at(np.array([0]), once.stamp_ns(-1), 1, 0.1)
    assert future.known.all()
    np.testing.assert_allclose(future.velocity[0, 0], 0.0, atol=1e-6)


@pytest.mark.parametrize("stamp", [-50, 500])
def test_outside_the_recording_nothing_is_known(stamp):
    clean = recording(parabola(np.arange(30), 0, 0.0, 5.0, 0.0))
    assert not FutureTable(clean).at(np.array([0]), clean.stamp_ns(stamp), 3, 0.2).known.any()
