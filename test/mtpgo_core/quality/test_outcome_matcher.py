# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Which truth every step of a published prediction gets."""

import dataclasses

import numpy as np
import pytest
from observed_stream import S_NS, STEPS, Stream

from mtpgo_core.prediction.constant_velocity import predict_constant_velocity
from mtpgo_core.quality.prediction_memory import MemoryLimits


def test_each_step_gets_its_truth_when_its_time_comes():
    stream = Stream()
    stream.drive(np.arange(0, 6, 0.2), predict_at=[0.0], offset_m=0.5)
    np.testing.assert_array_equal(stream.rows("step"), np.arange(STEPS))
    np.testing.assert_allclose(stream.rows("truth")[:, 0], 2.0 * np.arange(1, 26))
    np.testing.assert_allclose(stream.rows("heaviest_mean")[:, 1], 0.5)
    np.testing.assert_allclose(stream.rows("ade"), 0.5, atol=1e-5)  # float32 of 50 m
    np.testing.assert_allclose(stream.rows("cv_ade"), 0.0, atol=1e-9)
    assert [len(o) for o in stream.found[:4]] == [0, 1, 1, 1]
    assert stream.unknown == {}


def test_truth_between_observations_is_interpolated():
    stream = Stream()
    stream.drive(np.arange(0, 6, 0.3), predict_at=[0.0])
    np.testing.assert_allclose(stream.rows("truth")[:, 0], 2.0 * np.arange(1, 26))


def test_a_slow_input_resolves_several_steps_at_once():
    stream = Stream()
    stream.drive([0.0, 0.45, 0.9], predict_at=[0.0])
    assert [len(o) for o in stream.found] == [0, 2, 2]


def test_all_predictions_in_flight_are_resolved():
    stream = Stream()
    times = np.arange(0, 12, 0.2)
    stream.drive(times, predict_at=times)
    whole = len(times) - STEPS
    np.testing.assert_array_equal(
        np.bincount(stream.rows("step")), whole + np.arange(STEPS - 1, -1, -1)
    )
    assert stream.unknown == {}


def test_a_long_gap_has_no_truth():
    stream = Stream()
    stream.drive([*np.arange(0, 1.01, 0.2), *np.arange(1.8, 6, 0.2)], predict_at=[0.0])
    known = np.isfinite(stream.rows("truth")[:, 0])
    expected = np.ones(STEPS, dtype=bool)
    expected[5:8] = False  # 1.2, 1.4 and 1.6 s
    np.testing.assert_array_equal(known, expected)
    assert stream.unknown == {"gap": 3}


def test_a_gap_within_the_limit_is_bridged():
    stream = Stream()
    stream.drive([*np.arange(0, 1.01, 0.2), *np.arange(1.4, 6, 0.2)], predict_at=[0.0])
    assert np.isfinite(stream.rows("truth")).all()
    assert stream.unknown == {}


def test_a_teleport_ends_the_truth():
    stream = Stream()
    stream.drive(np.arange(0, 1.01, 0.2), predict_at=[0.0])
    for time_s in np.arange(1.2, 6, 0.2):
        stream.observe(time_s, {1: (500.0 + 10.0 * time_s, 0.0)})
    known = np.isfinite(stream.rows("truth")[:, 0])
    np.testing.assert_array_equal(known, np.arange(STEPS) < 5)
    np.testing.assert_allclose(stream.rows("ade"), 0.0, atol=1e-5)  # of the five known steps
    assert stream.unknown == {"restarted": 20}


def test_a_reused_identity_is_another_road_user():
    stream = Stream()
    stream.drive([0.0, 0.2], predict_at=[0.2])
    for time_s in np.arange(0.4, 4.2, 0.2):
        stream.observe(time_s, {2: (10.0 * time_s, 50.0)})
    for time_s in np.arange(
        4.2, 6, 0.2
    ):  # forgotten after 3.5 s, at a place it could have reached
        stream.observe(time_s, {1: (10.0 * time_s, 0.0)})
    assert not np.isfinite(stream.rows("truth")).any()
    assert stream.unknown["left"] > 0
    assert sum(stream.unknown.values()) == STEPS


@pytest.mark.parametrize(
    ("time_s", "frame", "cause"),
    [(-50.0, "map", "clock_reset"), (1.2, "other", "frame_changed")],
)
def test_another_clock_or_frame_ends_all_predictions(time_s, frame, cause):
    stream = Stream()
    stream.drive(np.arange(0, 1.01, 0.2), predict_at=[0.0])
    for i in range(20):
        stream.observe(time_s + 0.2 * i, {1: (0.0, 0.0)}, frame=frame)
    assert np.isfinite(stream.rows("truth")).all()
    assert stream.unknown == {cause: 20}


def test_a_prediction_made_before_the_clock_was_set_back_is_dropped():
    stream = Stream()
    stream.drive(np.arange(0, 1.01, 0.2))
    late, window = stream.history.window(), stream.history.window()
    stream.observe(-50.0, {1: (0.0, 0.0)})
    cv = predict_constant_velocity(late, horizon_steps=STEPS, dt_s=0.2)
    stream.matcher.add(cv, window)
    for i in range(1, 400):
        stream.observe(-50.0 + 0.2 * i, {1: (2.0 * i, 0.0)})
    assert not len(stream.rows("step"))
    assert stream.unknown == {"no_track": STEPS}


def test_predictions_after_one_that_was_made_before_the_clock_was_set_back_are_kept():
    stream = Stream()
    stream.drive(np.arange(0, 1.01, 0.2))
    window = stream.history.window()
    late = predict_constant_velocity(window, horizon_steps=STEPS, dt_s=0.2, modes=2)
    stream.observe(-50.0, {1: (0.0, 0.0)})  # while the model computes
    stream.matcher.add(late, window)
    for i in range(1, 11):
        stream.observe(-50.0 + 0.2 * i, {1: (2.0 * i, 0.0)})
        stream.predict()
    assert len(stream.rows("step")) == sum(range(10))


def test_a_clock_that_is_set_forward_by_years_ends_all_predictions():
    """A recording of another time, then the present: with few tracks 64 bits are not enough."""
    stream = Stream()
    drivers = range(40)
    for time_s in np.arange(0, 1.01, 0.2):
        stream.observe(time_s, {k: (10.0 * time_s, 10.0 * k) for k in drivers})
        stream.predict()
    for time_s in 1.7e9 + 0.2 * np.arange(10):
        stream.observe(time_s, {k: (10.0 * (time_s - 1.7e9), 10.0 * k) for k in drivers})
        stream.predict()
    assert stream.unknown["left"] > 0
    known = np.isfinite(stream.rows("truth")).all(axis=1)
    assert known.sum() == len(drivers) * (sum(range(6)) + sum(range(10)))


def test_a_prediction_of_a_track_that_restarted_meanwhile_is_dropped():
    stream = Stream()
    stream.drive(np.arange(0, 1.01, 0.2))
    window = stream.history.window()
    stream.observe(1.2, {1: (900.0, 0.0)})  # while the model computes
    stream.matcher.add(predict_constant_velocity(window, horizon_steps=STEPS, dt_s=0.2), window)
    for i in range(30):
        stream.observe(1.4 + 0.2 * i, {1: (902.0 + 2.0 * i, 0.0)})
    assert not len(stream.rows("step"))


def test_a_prediction_that_comes_late_gets_the_truth_of_steps_that_have_passed():
    stream = Stream()
    stream.drive(np.arange(0, 1.01, 0.2))
    window = stream.history.window()
    stream.drive(np.arange(1.2, 2.01, 0.2))
    stream.matcher.add(predict_constant_velocity(window, horizon_steps=STEPS, dt_s=0.2), window)
    assert len(stream.observe(2.2, {1: (22.0, 0.0)})) == 6


def test_a_delayed_horizon_is_compared_at_its_own_times():
    stream = Stream()
    stream.drive(np.arange(0, 1.01, 0.2))
    window = stream.history.window(101 * S_NS + 100_000_000)
    cv = predict_constant_velocity(window, horizon_steps=STEPS, dt_s=0.2)
    shifted = dataclasses.replace(cv, stamp_ns=101 * S_NS, time_s=cv.time_s + 0.1)
    stream.matcher.add(shifted, window)
    stream.drive(np.arange(1.2, 7, 0.2))
    np.testing.assert_allclose(stream.rows("truth")[:, 0], 11.0 + 2.0 * np.arange(1, 26))
    np.testing.assert_allclose(stream.rows("cv_mean"), stream.rows("truth"), atol=1e-6)


def test_road_users_observed_in_separate_messages_wait_for_their_own():
    stream = Stream()
    for i in range(30):
        stream.observe(0.2 * i, {1: (2.0 * i, 0.0)})
        stream.observe(0.2 * i + 0.1, {2: (2.0 * i + 1.0, 9.0)})
        if i == 0:
            stream.predict()
    track = stream.rows("track")
    assert np.isfinite(stream.rows("truth")).all()
    assert sorted(np.bincount(track)) == [STEPS, STEPS]


def test_the_memory_is_bounded():
    stream = Stream(MemoryLimits(agents=3, cycles=10, modes=1))
    for i in range(60):
        stream.observe(0.1 * i, {k: (i, 10.0 * k) for k in range(5)}, velocity=(10.0, 0.0))
        stream.predict(modes=4)
    memory = stream.matcher.memory
    assert memory.weight.shape == (10, 3, 1)
    assert memory.left_out == 2 * 10  # of 0, 0.6, ... 5.4 s: 5.5 s are spread over ten cycles
    assert len(np.unique(stream.rows("track"))) == 3
    np.testing.assert_array_equal(np.unique(stream.rows("stamp_ns")) % (6 * S_NS // 10), 4 * 10**8)


def test_a_row_says_which_agent_of_the_published_prediction_it_is_of():
    """Though one has gone meanwhile, one is not in the window, and only two are kept."""
    stream = Stream(MemoryLimits(agents=2))
    stream.observe(0.0, {k: (0.0, 10.0 * k) for k in range(5)})
    window = stream.history.window()
    published = predict_constant_velocity(window, horizon_steps=STEPS, dt_s=0.2)
    window = window.select(np.array([0, 2, 3, 4]))
    stream.observe(0.1, {0: (900.0, 0.0), 2: (1.0, 20.0), 3: (1.0, 30.0), 4: (1.0, 40.0)})
    stream.matcher.add(published, window)
    outcomes = stream.observe(0.2, {k: (2.0, 10.0 * k) for k in (2, 3, 4)})
    np.testing.assert_array_equal(outcomes.row, [2, 3])
    np.testing.assert_allclose(outcomes.truth, published.mean[outcomes.row, 0, 0, :2], atol=1e-6)


def test_all_modes_of_a_row_are_given():
    stream = Stream()
    stream.drive([0.0], predict_at=[0.0])
    outcomes = stream.observe(0.2, {1: (2.0, 0.0)})
    weight, mean, covariance = outcomes.mixture()
    np.testing.assert_array_equal(weight, [[1.0, 0.0]])
    np.testing.assert_allclose(mean, [[[2.0, 0.0]] * 2], atol=1e-6)
    np.testing.assert_array_equal(covariance[0, 0], outcomes.heaviest_covariance[0])
    np.testing.assert_allclose(covariance[0, 0], outcomes.cv_covariance[0])


def test_nothing_is_lost_at_utm_coordinates():
    """Where float32 has a grid of half a metre."""
    stream, east, north = Stream(), 691_000.25, 5_334_000.3
    for time_s in np.arange(0, 6, 0.2):
        stream.observe(time_s, {1: (east + 10.0 * time_s, north)})
        if time_s == 0.0:
            stream.predict(offset_m=0.5)
    error_m = stream.rows("heaviest_mean") - stream.rows("truth")
    np.testing.assert_allclose(error_m, np.tile([0.0, 0.5], (STEPS, 1)), atol=1e-4)
    np.testing.assert_allclose(stream.rows("ade"), 0.5, atol=1e-4)


def test_a_growing_number_of_modes_loses_no_prediction():
    """As where there are fewer and fewer road users than all modes are published of."""
    stream, weights = Stream(), []
    for number in range(60):
        outcomes = stream.observe(0.2 * number, {1: (2.0 * number, 0.0)})
        weight, _, covariance = outcomes.mixture()
        weights.append(weight.sum(axis=1))
        assert (covariance[..., 0, 0] > 0.0).all()
        stream.predict(modes=1 + number // 10)
    assert len(stream.rows("step")) == sum(min(number, STEPS) for number in range(60))
    np.testing.assert_allclose(np.concatenate(weights), 1.0)
    np.testing.assert_allclose(stream.rows("ade"), 0.0, atol=1e-5)
    assert stream.unknown == {}


def test_a_changing_number_of_modes_loses_no_prediction():
    stream, weights = Stream(), []
    times = np.arange(0, 12, 0.2)
    for number, time_s in enumerate(times):
        outcomes = stream.observe(time_s, {1: (10.0 * time_s, 0.0)})
        weights.append(outcomes.mixture()[0].sum(axis=1))
        stream.predict(modes=(3, 1, 2)[number % 3])
    whole = len(times) - STEPS
    np.testing.assert_array_equal(
        np.bincount(stream.rows("step")), whole + np.arange(STEPS - 1, -1, -1)
    )
    np.testing.assert_allclose(np.concatenate(weights), 1.0)
    np.testing.assert_allclose(stream.rows("ade"), 0.0, atol=1e-5)
    assert stream.unknown == {}
