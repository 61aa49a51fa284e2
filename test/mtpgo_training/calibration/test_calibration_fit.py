# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The fit of a calibration to samples whose right factors and temperatures are known."""

import numpy as np
import pytest
from calibration_sets import PEDESTRIAN, VEHICLE, random_samples, with_distance

from mtpgo_core.quality.metrics import is_inside, radius_squared
from mtpgo_core.task.calibration import FACTOR_LIMITS, GROUPS, SIGMA_FACTOR_50_LIMITS
from mtpgo_training.calibration.calibration_fit import (
    LEVEL,
    TIE_M,
    WIDENED_LEVEL,
    best_factor,
    best_temperature,
    fit_calibration,
    weighted_quantile,
)
from mtpgo_training.calibration.calibration_samples import merge_samples
from mtpgo_training.evaluation.honesty.mode_weights import nearest

RADIUS_90 = radius_squared(LEVEL)
WIDENED = radius_squared(WIDENED_LEVEL) / RADIUS_90
"""What widening needs of the factor at which the ellipse would hold 90 % of a Gaussian."""


def factors(calibration, group):
    return np.array(calibration.groups[group].factors)


def test_factors_follow_the_error_over_the_horizon():
    calibration = fit_calibration(random_samples(1, n=20_000, growth=6.0))
    expected = np.maximum(1.0, WIDENED * np.linspace(1.0, 6.0, 25))
    np.testing.assert_allclose(factors(calibration, VEHICLE), expected, rtol=0.06)
    assert calibration.groups[VEHICLE].agents == 20_000
    assert calibration.groups[VEHICLE].sites == 1


def test_the_fitted_ellipse_holds_the_share_of_its_level():
    samples = random_samples(2, n=20_000, growth=6.0)
    after = samples.calibrated(fit_calibration(samples))
    inside = (after.distance <= RADIUS_90).mean(axis=0)
    np.testing.assert_allclose(inside[1:], WIDENED_LEVEL, atol=0.01)
    assert inside[0] == pytest.approx(LEVEL, abs=0.01)  # right as it was


def test_ellipses_that_hold_nearly_their_share_are_not_widened():
    samples = random_samples(2, n=20_000, steps=1)
    for scale in (1.0, 1.05, 1.08):  # they hold 90, 88.8 and 88.1 %
        found = factors(fit_calibration(with_distance(samples, scale * samples.distance)), VEHICLE)
        assert found[0] == pytest.approx(1.0, abs=0.015), scale


def test_the_50_percent_ellipse_holds_half_of_errors_with_heavy_tails():
    samples = random_samples(2, n=20_000, growth=6.0)
    tail = np.random.default_rng(5).chisquare(3, (20_000, 1)) / 3.0  # Student's t
    samples = with_distance(samples, samples.distance / tail)
    after = samples.calibrated(fit_calibration(samples))
    plain = is_inside(after.distance, 0.5).mean(axis=0)
    np.testing.assert_array_less(0.6, plain)
    inside = is_inside(after.distance, 0.5, after.sigma_factor_50).mean(axis=0)
    np.testing.assert_allclose(inside, 0.5, atol=0.02)
    most = is_inside(after.distance, 0.9).mean(axis=0)
    np.testing.assert_allclose(most, WIDENED_LEVEL, atol=0.01)


def test_the_50_percent_ellipse_of_a_gaussian_needs_no_factor():
    calibration = fit_calibration(random_samples(2, n=20_000))
    found = np.array(calibration.groups[VEHICLE].sigma_factors_50)
    np.testing.assert_allclose(found, 1.0, atol=0.03)


def test_the_50_percent_ellipse_of_those_without_an_error_is_limited():
    samples = random_samples(1, n=20_000, steps=2)
    samples = with_distance(samples, np.where(np.arange(20_000)[:, None] % 5, 0.0, [[4.6, 4.6]]))
    groups = fit_calibration(samples).groups
    assert groups[VEHICLE].sigma_factors_50 == (SIGMA_FACTOR_50_LIMITS[0],) * 2


def test_every_site_counts_the_same():
    # Alone, a asks for a factor of 1, and b for 4; b has a twentieth of the agents.
    sites = [
        random_samples(1, sites=("a",), n=40_000, steps=1),
        random_samples(2, sites=("b",), n=2_000, steps=1),
    ]
    sites[1] = with_distance(sites[1], 4.0 * sites[1].distance)
    factor = fit_calibration(merge_samples(sites)).groups[VEHICLE].factors[0]
    # Of both with equal weight: 0.5 exp(-r / 2) + 0.5 exp(-r / 8) = 0.12 at r = 11.52.
    assert factor == pytest.approx(11.52 / RADIUS_90, rel=0.1)


def test_factors_do_not_decrease_over_the_horizon():
    samples = random_samples(3, n=5_000, steps=3)
    samples = with_distance(samples, samples.distance * [2.0, 1.0, 4.0])
    found = factors(fit_calibration(samples), VEHICLE)
    assert found[0] == found[1] == pytest.approx(np.sqrt(2.0 * WIDENED), rel=0.05)
    assert found[2] == pytest.approx(4.0 * WIDENED, rel=0.05)


def test_few_agents_are_drawn_towards_the_factors_of_all_classes():
    many = random_samples(1, n=20_000, steps=1)
    for n, low, high in ((3, 0.95, 1.1), (200, 1.7, 2.5), (20_000, 3.8, 4.2)):
        few = random_samples(2, n=n, steps=1, group=PEDESTRIAN)
        few = with_distance(few, 4.0 * few.distance)
        calibration = fit_calibration(merge_samples([many, few]))
        if n < 1000:
            assert low < factors(calibration, PEDESTRIAN)[0] < high
        else:
            assert factors(calibration, PEDESTRIAN)[0] == pytest.approx(4.0 * WIDENED, rel=0.05)


def test_groups_without_agents_get_the_pooled_factors():
    calibration = fit_calibration(random_samples(1, n=20_000, growth=3.0))
    pooled = calibration.groups[GROUPS.index("any_moving")]
    assert calibration.groups[PEDESTRIAN].factors == pooled.factors
    assert calibration.groups[PEDESTRIAN].agents == 0
    # Nobody stands, so that there is only what moves to go by.
    standing = calibration.groups[GROUPS.index("vehicle_standing")]
    np.testing.assert_allclose(standing.factors, pooled.factors, rtol=0.02)


def test_steps_that_nobody_reaches_have_the_factor_before():
    samples = random_samples(1, n=20_000, growth=3.0)
    distance = samples.distance.copy()
    distance[:, 10:] = np.nan
    found = factors(fit_calibration(with_distance(samples, distance)), VEHICLE)
    np.testing.assert_allclose(found[10:], found[9], rtol=1e-3)


@pytest.mark.parametrize(("distance", "limit"), [(1e-6, 0), (1e6, 1)])
def test_factors_are_limited(distance, limit):
    samples = random_samples(1, n=50_000, steps=2)
    calibration = fit_calibration(with_distance(samples, np.full((50_000, 2), distance)))
    np.testing.assert_allclose(factors(calibration, VEHICLE), FACTOR_LIMITS[limit], rtol=0.05)


@pytest.mark.parametrize("temperature", [0.5, 2.0])
def test_the_temperature_is_that_at_which_weights_are_probabilities(temperature):
    samples = random_samples(4, n=20_000, steps=1, temperature=temperature)
    calibration = fit_calibration(samples)
    assert calibration.groups[VEHICLE].temperature == pytest.approx(temperature, rel=0.05)


def test_the_temperature_is_the_minimum_of_the_cross_entropy():
    samples = random_samples(5, n=500, steps=1, temperature=1.7)
    weight = np.ones(500)
    found = best_temperature(samples.log_weight, samples.mode_error, weight)
    tried = np.linspace(0.5, 4.0, 200)
    target = nearest(samples.mode_error, TIE_M)
    scaled = samples.log_weight[None] / tried[:, None, None]
    scaled = scaled - np.logaddexp.reduce(scaled, axis=2, keepdims=True)
    entropy = -(target * scaled).sum(axis=2).mean(axis=1)
    assert found == pytest.approx(tried[entropy.argmin()], abs=0.02)


def test_modes_as_near_as_the_nearest_share_it():
    shares = nearest(np.array([[1.0, 1.05, 3.0], [2.0, 1.0, 1.5]]), TIE_M)
    np.testing.assert_array_equal(shares, [[0.5, 0.5, 0.0], [0.0, 1.0, 0.0]])


def test_a_single_mode_has_no_temperature():
    samples = random_samples(1, n=500, modes=1)
    assert fit_calibration(samples).groups[VEHICLE].temperature == 1.0


def test_weights_move_the_quantile():
    values = np.array([3.0, 1.0, 2.0])
    assert weighted_quantile(values, np.ones(3), 0.5) == 2.0
    assert weighted_quantile(values, np.array([8.0, 1.0, 1.0]), 0.5) == 3.0
    assert weighted_quantile(values, np.array([1.0, 8.0, 1.0]), 0.5) == 1.0


def test_the_calibration_says_where_it_was_fitted():
    calibration = fit_calibration(random_samples(1, sites=("a", "b"), n=(30, 20)), left_out=True)
    assert [(site.name, site.agents) for site in calibration.sites] == [("a", 30), ("b", 20)]
    assert calibration.left_out


def test_ellipses_are_not_narrowed_at_the_cost_of_the_likelihood():
    weight = np.ones(100)
    # Nearly all at the centre, some far away: their mean squared distance is 0.95, or 4.75.
    for far, expected in ((19.0, 0.475), (95.0, 1.0)):
        distance = np.where(np.arange(100) < 95, 0.0, far)
        assert best_factor(distance, weight) == pytest.approx(expected)
    assert best_factor(np.full(100, 2.0), weight) == pytest.approx(1.0)
    assert best_factor(np.full(100, 0.5), weight) == pytest.approx(0.25)
    assert best_factor(np.full(100, 9.0), weight) == pytest.approx(9.0 / RADIUS_90)
