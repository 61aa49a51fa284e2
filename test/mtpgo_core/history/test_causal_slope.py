# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The recursive slope against the fit that it computes, and its properties."""

import numpy as np
import pytest

from mtpgo_core.history.causal_slope import CausalSlope

TAU_S = 0.3


def fitted_slope(times, values, now, tau_s, prior_s2=0.0):
    """Slope at ``now`` of the weighted line fit, straight from its definition."""
    times, values = np.asarray(times), np.asarray(values)
    weight = np.exp(-2.0 * (now - times) / tau_s)
    mean_t = (weight * times).sum() / weight.sum()
    mean_x = (weight[:, None] * values).sum(axis=0) / weight.sum()
    spread = (weight * (times - mean_t) ** 2).sum()
    product = (weight[:, None] * (times - mean_t)[:, None] * (values - mean_x)).sum(axis=0)
    return product / (spread + prior_s2)


def run(slope, times, values):
    """All slopes of one signal in slot 0."""
    steps = np.diff(times, prepend=times[0])
    slot = np.array([0])
    return np.array(
        [
            slope.step(slot, np.array([dt]), np.asarray(value)[None])[0]
            for dt, value in zip(steps, values, strict=True)
        ]
    )


@pytest.mark.parametrize("prior_s2", [0.0, 0.002])
def test_equals_the_weighted_fit_at_every_sample(prior_s2):
    draw = np.random.default_rng(1)
    times = np.cumsum(draw.uniform(0.02, 0.4, 60))
    values = np.cumsum(draw.normal(size=(60, 2)), axis=0) + 5e5  # map coordinates
    given = run(CausalSlope(1, TAU_S, prior_s2), times, values)
    for i in range(3, 60):
        expected = fitted_slope(times[: i + 1], values[: i + 1], times[i], TAU_S, prior_s2)
        np.testing.assert_allclose(given[i], expected, rtol=1e-7, atol=1e-7)


def test_is_exact_on_a_straight_line_whatever_the_jitter():
    draw = np.random.default_rng(2)
    times = np.cumsum(draw.uniform(0.005, 0.2, 100))
    values = 1e6 + times[:, None] * np.array([31.25, -7.5])
    given = run(CausalSlope(1, TAU_S), times, values)
    known = times - times[0] >= 0.03
    assert np.isnan(given[~known]).all()
    np.testing.assert_allclose(given[known], np.tile([31.25, -7.5], (known.sum(), 1)), atol=1e-6)


def test_samples_too_close_together_give_no_slope_yet():
    times = 0.01 * np.arange(6)
    given = run(CausalSlope(1, TAU_S), times, times[:, None] * [2.0, 3.0])
    assert np.isnan(given).all(axis=1).tolist() == [True, True, True, False, False, False]
    slope = CausalSlope(1, TAU_S)
    run(slope, times, times[:, None] * [2.0, 3.0])
    slope.reset(np.array([0]))
    again = run(slope, times, 7.0 + times[:, None] * [2.0, 3.0])
    np.testing.assert_array_equal(np.isnan(again), np.isnan(given))


def test_lags_behind_a_steady_change_by_tau():
    times = np.arange(0.0, 6.0, 0.01)
    values = np.stack([0.5 * 2.0 * times**2, np.zeros_like(times)], axis=1)
    given = run(CausalSlope(1, TAU_S), times, values)
    assert given[-1, 0] == pytest.approx(2.0 * (times[-1] - TAU_S), abs=0.02)


def test_tau_zero_is_the_difference_of_the_last_two():
    times, values = [0.0, 0.1, 0.3], [[0.0, 0.0], [1.0, 2.0], [5.0, 2.0]]
    given = run(CausalSlope(1, 0.0), times, values)
    np.testing.assert_allclose(given[1:], [[10.0, 20.0], [20.0, 0.0]], atol=1e-9)


def test_tau_zero_with_missing_values_is_the_difference_of_the_last_two_known():
    times = [0.0, 0.1, 0.2, 0.4, 0.5]
    values = [[0.0, 0.0], [1.0, 2.0], [np.nan, np.nan], [np.nan, np.nan], [5.0, 2.0]]
    given = run(CausalSlope(1, 0.0), times, values)
    np.testing.assert_allclose(given[[1, 4]], [[10.0, 20.0], [10.0, 0.0]], atol=1e-9)


def test_a_missing_value_only_lets_time_pass():
    times, values = np.arange(6) * 0.1, np.arange(6)[:, None] * np.array([[0.5, 1.0]])
    holes = values.copy()
    holes[[2, 4]] = np.nan
    given = run(CausalSlope(1, TAU_S), times, holes)
    np.testing.assert_allclose(given[[1, 3, 5]], np.tile([5.0, 10.0], (3, 1)), atol=1e-9)
    np.testing.assert_allclose(given[4], [5.0, 10.0], atol=1e-9)  # what was known stays known


def test_with_a_prior_the_first_sample_has_slope_zero_and_without_none():
    assert run(CausalSlope(1, TAU_S, 0.01), [0.0], [[3.0, 4.0]]).tolist() == [[0.0, 0.0]]
    assert np.isnan(run(CausalSlope(1, TAU_S), [0.0], [[3.0, 4.0]])).all()
    assert np.isnan(run(CausalSlope(1, TAU_S, 0.01), [0.0], [[np.nan, 4.0]])).all()


def test_signals_do_not_touch_each_other_and_reset_forgets():
    draw = np.random.default_rng(3)
    values = draw.normal(size=(20, 3, 2))
    together, alone = CausalSlope(2, TAU_S), CausalSlope(1, TAU_S)
    together.grow(3)
    dt = np.full(3, 0.1)
    for i in range(20):
        both = together.step(np.array([2, 0, 1]), dt, values[i])
        single = alone.step(np.array([0]), dt[:1], values[i, 1:2])
    np.testing.assert_array_equal(both[1], single[0])
    together.reset(np.array([0]))
    fresh = together.step(np.array([0, 1]), dt[:2], values[0, :2])
    assert np.isnan(fresh[0]).all()
    assert np.isfinite(fresh[1]).all()


def test_noise_falls_as_samples_come_faster():
    draw = np.random.default_rng(4)

    def error(rate_hz):
        times = np.arange(0.0, 20.0, 1.0 / rate_hz)
        noisy = times[:, None] * [10.0, 0.0] + draw.normal(scale=0.05, size=(len(times), 2))
        return np.std(run(CausalSlope(1, TAU_S), times, noisy)[len(times) // 4 :] - [10.0, 0.0])

    assert error(100.0) < 0.6 * error(10.0)
