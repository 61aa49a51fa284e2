# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The filter of many tracks against a plain one of a single track, and its noise."""

import numpy as np
import pytest

from mtpgo_training.scenes.tracker.kalman_scan import (
    FIRST_STD,
    RESTART_S,
    FilterModel,
    correlated_noise,
    filter_tracks,
)


def plain_filter(time_s, measured, model):
    """A textbook Kalman filter of one axis of one track."""
    first = np.diag([model.measurement_std_m, *FIRST_STD[: model.order - 1]]) ** 2
    state, covariance, out = None, None, []
    for k, z in enumerate(measured):
        dt = np.array([time_s[k] - time_s[k - 1]]) if k else np.array([np.inf])
        if dt[0] > RESTART_S:
            state, covariance = np.zeros(model.order), first.copy()
            state[0] = z
        else:
            f, q = model.transition(dt)[0], model.process_covariance(dt)[0]
            state, covariance = f @ state, f @ covariance @ f.T + q
            h = np.eye(model.order)[:1]
            gain = covariance @ h.T / (covariance[0, 0] + model.measurement_std_m**2)
            state = state + gain[:, 0] * (z - state[0])
            covariance = (np.eye(model.order) - gain @ h) @ covariance
        out.append(state)
    return np.array(out)


@pytest.mark.parametrize("order", [2, 3])
def test_many_tracks_give_the_numbers_of_a_plain_filter(order):
    rng = np.random.default_rng(order)
    model = FilterModel(order, 2.0, 0.2)
    track, time_s, measured = [], [], []
    for k, length in enumerate((30, 1, 75, 12)):
        steps = rng.choice([0.1, 0.1, 0.2, 2.0], length)
        track += [k] * length
        time_s += list(np.cumsum(steps))
        measured += list(np.cumsum(rng.normal(size=(length, 2)), axis=0))
    track, time_s, measured = np.array(track), np.array(time_s), np.array(measured)
    states, count = filter_tracks(track, time_s, measured, model)
    for k in range(4):
        mine = track == k
        for axis in range(2):
            expected = plain_filter(time_s[mine], measured[mine, axis], model)
            np.testing.assert_allclose(states[mine, :, axis], expected, atol=1e-9)
    gap = np.diff(time_s, prepend=-9.0) > RESTART_S
    assert (count[gap] == 1).all()
    assert count.max() > 2


def test_the_matrices_are_those_of_white_acceleration_and_jerk():
    dt = np.array([0.5])
    cv, ca = FilterModel(2, 2.0, 1.0), FilterModel(3, 1.0, 1.0)
    np.testing.assert_allclose(cv.transition(dt)[0], [[1, 0.5], [0, 1]])
    np.testing.assert_allclose(cv.process_covariance(dt)[0], [[4 * 0.125 / 3, 0.5], [0.5, 2.0]])
    np.testing.assert_allclose(ca.transition(dt)[0, 0], [1, 0.5, 0.125])
    np.testing.assert_allclose(ca.process_covariance(dt)[0][:, 2], [0.125 / 6, 0.125, 0.5])


def test_a_filter_without_rows_is_empty():
    none = np.zeros(0, dtype=np.int64)
    states, count = filter_tracks(none, np.zeros(0), np.zeros((0, 2)), FilterModel(2, 1.0, 0.1))
    assert states.shape == (0, 2, 2)
    assert count.shape == (0,)


def test_noise_has_unit_variance_and_the_correlation_asked_for():
    track = np.repeat(np.arange(400), 60)
    time_s = np.tile(0.1 * np.arange(60), 400)
    noise = correlated_noise(track, time_s, 1.0, np.random.default_rng(0)).reshape(400, 60, 2)
    assert noise.std() == pytest.approx(1.0, abs=0.05)
    assert noise[:, 0].std() == pytest.approx(1.0, abs=0.1)
    for steps in (1, 10, 30):
        product = (noise[:, steps:] * noise[:, :-steps]).mean()
        assert product == pytest.approx(np.exp(-0.1 * steps), abs=0.08)
    assert abs((noise[1:, 0] * noise[:-1, -1]).mean()) < 0.1  # tracks are independent
