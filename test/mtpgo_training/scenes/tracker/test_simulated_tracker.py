# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What a simulated tracker reports of a recording."""

import dataclasses
import time

import numpy as np
import pytest
from traffic import braking_cars

from mtpgo_core.schema import AgentClass
from mtpgo_training.scenes.tracker.simulated_tracker import (
    SimulatedTracker,
    draw_tracker,
)
from mtpgo_training.scenes.tracker.tracker_config import TrackerConfig, ideal_tracker

CARS = braking_cars(tracks=10, seconds=12.0)
SEED = (0, 0)


def observe(recording=CARS, seed=SEED, **changes):
    tracker = dataclasses.replace(ideal_tracker(), **changes)
    return SimulatedTracker(tracker, seed).observe(recording)


def true_rows(observed, recording=CARS):
    """The recording's row of each row of the observations."""
    code = recording.track * 100_000 + recording.frame
    order = np.argsort(code)
    return order[np.searchsorted(code[order], observed.track * 100_000 + observed.frame)]


def fast_turn(seconds=8.0, rate=10.0):
    """A car that speeds up at 3 m/s^2, and one that stands and then starts."""
    t = np.arange(0.0, seconds, 1.0 / rate)
    plain = braking_cars(tracks=2, seconds=seconds, rate=rate)
    frame, track = np.repeat(np.arange(len(t)), 2), np.tile([0, 1], len(t))
    start = np.maximum(t - 4.0, 0.0)
    x = np.stack([5.0 * t + 1.5 * t**2, 1.0 * start**2], axis=1).reshape(-1)
    v = np.stack([5.0 + 3.0 * t, 2.0 * start], axis=1).reshape(-1)
    zero = np.zeros_like(x)
    return dataclasses.replace(
        plain,
        frame=frame,
        track=track,
        position=np.stack([x, zero], axis=1),
        velocity=np.stack([v, zero], axis=1),
        acceleration=np.full((len(x), 2), np.nan),
        yaw=np.where(track == 1, 0.7, 0.0),
    )


def test_an_ideal_tracker_gives_the_truth_with_the_lag_of_a_causal_filter():
    seen = observe()
    assert len(seen) == len(CARS)
    np.testing.assert_array_equal(seen.key, CARS.key)
    np.testing.assert_array_equal(seen.frame, CARS.frame)
    np.testing.assert_array_equal(seen.track, CARS.track)
    assert np.abs(seen.position - CARS.position).max() < 0.05
    settled = CARS.frame > 25
    assert np.abs(seen.velocity - CARS.velocity)[settled].max() < 0.1
    lag = observe(fast_turn(), order=2, process_noise=1.0)
    late = lag.track == 0
    behind = fast_turn().velocity[late, 0] - lag.velocity[late, 0]
    assert 0.1 < behind[-1] < 1.5  # an accelerating car is reported as slower than it is


def test_nothing_of_the_future_enters():
    tracker = {
        "position_std_m": 0.1, "drift_std_m": 0.1, "order": 2, "yaw_std_rad": 0.05,
    }  # fmt: skip
    whole = observe(fast_turn(), **tracker)
    changed = fast_turn()
    later = changed.frame >= 40
    changed.position[later] += [25.0, 9.0]
    other = observe(changed, **tracker)
    before = whole.frame < 40
    for name in ("position", "velocity", "yaw"):
        first, second = getattr(whole, name), getattr(other, name)
        np.testing.assert_array_equal(first[before], second[before])
        assert np.abs(first[~before] - second[~before]).max() > 0.1


@pytest.mark.parametrize(("white_m", "drift_m"), [(0.2, 0.0), (0.0, 0.2)])
def test_positions_have_the_noise_of_the_measurements(white_m, drift_m):
    seen = observe(
        position_std_m=white_m, drift_std_m=drift_m, drift_time_s=2.0, assumed_std_m=0.001,
        process_noise=50.0,
    )  # fmt: skip
    error = seen.position - CARS.position[true_rows(seen)]
    assert error.std() == pytest.approx(0.2, abs=0.04)
    order = np.lexsort((seen.frame, seen.track))
    pairs = error[order][1:] * error[order][:-1]
    correlation = pairs.mean() / error.var()
    assert correlation == pytest.approx(np.exp(-0.05) if drift_m else 0.0, abs=0.15)


def test_a_filter_that_expects_noise_smooths_it():
    rough, smooth = (
        observe(position_std_m=0.3, assumed_std_m=assumed, order=2, process_noise=0.5)
        for assumed in (0.01, 0.3)
    )
    errors = [np.abs(r.velocity - CARS.velocity)[CARS.frame > 30].mean() for r in (rough, smooth)]
    assert errors[1] < 0.5 * errors[0]


def test_the_course_is_the_yaw_while_moving_and_is_held_at_standstill():
    recording = fast_turn()
    seen = observe(recording, yaw_source="course", moving_mps=0.5)
    second = seen.track == 1
    yaw, speed = seen.yaw[second], np.hypot(*seen.velocity[second].T)
    np.testing.assert_allclose(yaw[speed < 0.4][:20], 0.7)  # it never moved: the box's
    np.testing.assert_allclose(yaw[speed > 0.6], 0.0, atol=1e-6)
    back = dataclasses.replace(
        recording,
        position=recording.position[::-1].copy(),
        frame=recording.frame,
        track=recording.track,
    )
    stopping = observe(back, yaw_source="course", moving_mps=0.5)
    first = stopping.yaw[stopping.track == 0]  # drives backwards along x, then stands
    assert np.abs(first[-10:]) == pytest.approx(np.pi, abs=1e-6)


def test_what_a_tracker_does_not_know_is_missing():
    assert np.isnan(observe(gives_velocity=False).velocity).all()
    assert np.isnan(observe(gives_velocity=False).acceleration).all()
    assert np.isnan(observe(yaw_source="none").yaw).all()
    assert np.isnan(observe(order=2).acceleration).all()
    assert np.isnan(observe(gives_size=False).size).all()
    everybody = observe(unknown_class_share=1.0)
    assert (everybody.agent_class == AgentClass.UNKNOWN).all()
    many = braking_cars(tracks=300, seconds=1.0)
    some = observe(many, unknown_class_share=0.4, size_std=0.1)
    assert (some.agent_class == AgentClass.UNKNOWN).mean() == pytest.approx(0.4, abs=0.1)
    assert np.log(some.size / many.size).std() == pytest.approx(0.1, abs=0.02)
    first = np.isnan(observe().velocity[:, 0])
    assert first.sum() == len(CARS.track_id)  # one position gives no velocity


def test_box_yaws_have_noise():
    exact, noisy = observe(yaw_source="box"), observe(yaw_source="box", yaw_std_rad=0.1)
    np.testing.assert_allclose(exact.yaw, CARS.yaw)
    assert (noisy.yaw - CARS.yaw).std() == pytest.approx(0.1, abs=0.02)


def test_new_tracks_are_reported_late():
    seen = observe(birth_s=1.0)
    late = []
    for track in range(len(CARS.track_id)):
        first = CARS.frame[CARS.track == track].min()
        late.append((seen.frame[seen.track == track].min() - first) / CARS.frame_rate)
    assert 0.5 <= min(late) < max(late) <= 1.6
    assert np.isfinite(seen.velocity).all()  # the filter has run since the first measurement


def test_drop_outs_are_bursts_of_the_share_and_length_asked_for():
    many = braking_cars(tracks=100, seconds=20.0)
    seen = observe(many, dropout_share=0.1, dropout_s=0.5)
    assert 1.0 - len(seen) / len(many) == pytest.approx(0.1, abs=0.02)
    order = np.lexsort((seen.frame, seen.track))
    same = seen.track[order][1:] == seen.track[order][:-1]
    gaps = np.diff(seen.frame[order])[same] - 1
    assert gaps[gaps > 0].mean() == pytest.approx(5.0, abs=1.0)


@pytest.mark.parametrize(("rate_hz", "every"), [(5.0, 2), (25.0, 1), (3.3, 3)])
def test_a_slower_tracker_measures_every_second_or_third_frame(rate_hz, every):
    frames = np.unique(observe(rate_hz=rate_hz).frame)
    assert frames[0] == CARS.frame[0]
    assert set(np.diff(frames).tolist()) == {every}


def test_a_seed_gives_the_same_observations_and_another_other_ones():
    same, again = (draw_tracker(CARS, 5, 1).observe(CARS) for _ in range(2))
    for name in ("frame", "track", "position", "velocity", "yaw", "size", "agent_class"):
        np.testing.assert_array_equal(getattr(same, name), getattr(again, name))
    drawn = {
        repr(draw_tracker(recording, seed, number).tracker)
        for recording in (CARS, dataclasses.replace(CARS, name="02"))
        for seed in (0, 1)
        for number in (0, 1)
    }
    assert len(drawn) == 8
    config = TrackerConfig(ideal_share=1.0)
    assert draw_tracker(CARS, 0, config=config).tracker.position_std_m == 0.0


def test_classes_and_sizes_are_known_without_observing():
    drawn = draw_tracker(CARS, 3, config=TrackerConfig(ideal_share=0.0))
    seen, told = drawn.observe(CARS), drawn.attributes(CARS)
    np.testing.assert_array_equal(seen.size, told.size)
    np.testing.assert_array_equal(seen.agent_class, told.agent_class)


def test_an_empty_recording_stays_empty():
    nothing = CARS.select_rows(np.zeros(len(CARS), dtype=bool))
    assert len(draw_tracker(nothing, 0).observe(nothing)) == 0


def test_an_hour_of_agents_takes_less_than_a_second():
    hour = braking_cars(tracks=120, seconds=30.0)
    noisy = draw_tracker(hour, 0, config=TrackerConfig(ideal_share=0.0))
    tracker = dataclasses.replace(noisy, tracker=dataclasses.replace(noisy.tracker, rate_hz=25.0))
    begin = time.process_time()
    tracker.observe(hour)
    assert time.process_time() - begin < 1.0
