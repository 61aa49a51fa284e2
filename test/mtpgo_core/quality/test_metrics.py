# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The metrics against numbers worked out by hand and against torch.distributions."""

import math

import numpy as np
import pytest
import torch

from mtpgo_core.quality import metrics

# One agent, two modes, three steps; mode 1 has the larger weight.
TRUTH = np.array([[1.0, 0.0], [2.0, 0.0], [3.0, 0.0]])
MEAN = np.array([[[1.0, 0.0], [2.0, 0.0], [3.0, 1.0]], [[1.0, 3.0], [2.0, 4.0], [7.0, 3.0]]])
WEIGHT = np.array([0.25, 0.75])
ALL = np.array([True, True, True])
FIRST_TWO = np.array([True, True, False])
UNIT = np.broadcast_to(np.eye(2), (2, 3, 2, 2))


def test_ade_takes_the_heaviest_mode_and_averages_over_steps():
    assert metrics.ade(MEAN, WEIGHT, TRUTH, ALL) == pytest.approx((3 + 4 + 5) / 3)


def test_ade_leaves_out_steps_that_were_not_observed():
    assert metrics.ade(MEAN, WEIGHT, TRUTH, FIRST_TWO) == pytest.approx((3 + 4) / 2)


def test_fde_is_the_last_step_or_nan():
    assert metrics.fde(MEAN, WEIGHT, TRUTH, ALL) == pytest.approx(5.0)
    assert np.isnan(metrics.fde(MEAN, WEIGHT, TRUTH, FIRST_TWO))


@pytest.mark.parametrize(("threshold", "missed"), [(2.0, 1.0), (5.5, 0.0)])
def test_miss_rate_counts_final_displacements_beyond_the_threshold(threshold, missed):
    assert metrics.miss_rate(MEAN, WEIGHT, TRUTH, ALL, threshold) == missed


def test_miss_rate_is_unknown_without_the_last_step():
    assert np.isnan(metrics.miss_rate(MEAN, WEIGHT, TRUTH, FIRST_TWO))


def test_apde_measures_to_the_nearest_observed_position():
    # (7, 3) is 5 m from (3, 0); the others have their own step nearest.
    assert metrics.apde(MEAN, WEIGHT, TRUTH, ALL) == pytest.approx(4.0)
    # A prediction right on the path but early costs nothing.
    late = np.array([[[2.0, 0.0], [3.0, 0.0], [3.0, 0.0]]])
    one = np.array([1.0])
    assert metrics.apde(late, one, TRUTH, ALL) == pytest.approx(0.0)
    # With the third position unobserved, (3, 0) is 1 m from the nearest.
    assert metrics.apde(late, one, TRUTH, FIRST_TWO) == pytest.approx(0.5)


def test_min_ade_and_min_fde_take_the_best_mode():
    assert metrics.min_ade(MEAN, TRUTH, ALL) == pytest.approx(1.0 / 3.0)
    assert metrics.min_fde(MEAN, TRUTH, ALL) == pytest.approx(1.0)
    assert metrics.min_ade(MEAN, TRUTH, FIRST_TWO) == pytest.approx(0.0)


def test_nll_by_hand_for_unit_covariance():
    # Step 1: distances 0 and 3.
    expected = -math.log((0.25 + 0.75 * math.exp(-4.5)) / (2 * math.pi))
    assert metrics.nll(MEAN, WEIGHT, UNIT, TRUTH)[0] == pytest.approx(expected)


def test_an_ellipse_of_another_size_for_half_of_the_truths():
    assert metrics.sigma_factor(0.5, 0.6) == pytest.approx(0.6)
    assert metrics.sigma_factor(0.2, 0.6) == pytest.approx(0.6)
    assert metrics.sigma_factor(0.9, 0.6) == pytest.approx(1.0)
    assert 0.6 < metrics.sigma_factor(0.7, 0.6) < 1.0 < metrics.sigma_factor(0.95, 0.6) < 1.2
    assert metrics.sigma_factor(0.999999, 0.6) == pytest.approx(0.6**-0.5)
    radius = np.sqrt(metrics.radius_squared(0.5))
    squared = (radius * np.array([0.59, 0.61])) ** 2
    assert metrics.is_inside(squared, 0.5, np.full(2, 0.6)).tolist() == [True, False]
    assert metrics.is_inside(squared, 0.5).all()


def test_anll_and_fnll_agree_with_torch_distributions():
    rng = np.random.default_rng(3)
    mean, weight = rng.normal(size=(5, 4, 6, 2)), rng.dirichlet(np.ones(4), size=5)
    root = rng.normal(size=(5, 4, 6, 2, 2))
    covariance = root @ root.swapaxes(-1, -2) + 0.1 * np.eye(2)
    truth, mask = rng.normal(size=(5, 6, 2)), rng.random((5, 6)) < 0.7
    mask[:, -1] = [True, True, True, False, True]
    mixture = torch.distributions.MultivariateNormal(
        torch.tensor(mean), covariance_matrix=torch.tensor(covariance)
    )
    log = mixture.log_prob(torch.tensor(truth)[:, None]) + torch.tensor(weight).log()[..., None]
    expected = -torch.logsumexp(log, dim=1).numpy()
    for i in range(5):
        value = metrics.anll(mean, weight, covariance, truth, mask)[i]
        assert value == pytest.approx(expected[i][mask[i]].mean())
    final = metrics.fnll(mean, weight, covariance, truth, mask)
    np.testing.assert_allclose(final[[0, 1, 2, 4]], expected[[0, 1, 2, 4], -1])
    assert np.isnan(final[3])


def test_a_zero_weight_mode_does_not_break_the_likelihood():
    value = metrics.nll(MEAN, np.array([1.0, 0.0]), UNIT, TRUTH)
    assert value[0] == pytest.approx(math.log(2 * math.pi))


def test_coverage_counts_truths_inside_the_ellipse():
    # Top-mode distances 3, 4, 5; with sigma 2.2 the 90 % radius is 2.2 * 2.146 = 4.72.
    inside = metrics.coverage(MEAN, WEIGHT, UNIT * 2.2**2, TRUTH, ALL, 0.9)
    assert inside == pytest.approx(2.0 / 3.0)


def test_coverage_of_a_calibrated_gaussian_is_its_level():
    rng = np.random.default_rng(0)
    root = np.array([[2.0, 0.0], [1.5, 0.3]])
    truth = rng.normal(size=(40000, 1, 2)) @ root.T
    mean, weight = np.zeros((40000, 1, 1, 2)), np.ones((40000, 1))
    covariance = np.broadcast_to(root @ root.T, (40000, 1, 1, 2, 2))
    mask = np.ones((40000, 1), dtype=bool)
    for level in (0.5, 0.9, 0.95):
        hit = metrics.average(metrics.coverage(mean, weight, covariance, truth, mask, level))
        assert hit == pytest.approx(level, abs=0.01)


def test_average_leaves_out_the_undefined():
    assert metrics.average(np.array([1.0, np.nan, 3.0])) == 2.0
    assert np.isnan(metrics.average(np.array([np.nan])))


def test_nees_of_a_hand_worked_case():
    mean = np.array([[[0.0, 0.0]], [[3.0, 4.0]]])  # [M, H, 2]
    covariance = np.array([[np.diag([4.0, 1.0])], [np.diag([9.0, 16.0])]])
    truth = np.array([[2.0, 2.0]])
    assert metrics.nees(mean, np.array([0.7, 0.3]), covariance, truth) == pytest.approx(5.0)
    assert metrics.nees(mean, np.array([0.3, 0.7]), covariance, truth) == pytest.approx(
        1 / 9 + 4 / 16
    )


def test_the_nees_of_a_true_mixture_is_two_whatever_its_shape():
    rng = np.random.default_rng(0)
    weight = np.array([0.5, 0.3, 0.2])
    mean = np.array([[[0.0, 0.0]], [[9.0, 1.0]], [[-2.0, 6.0]]])
    covariance = np.array([[np.diag([1.0, 2.0])], [[[3.0, 1.0], [1.0, 1.0]]], [np.eye(2)]])
    mode = rng.choice(3, size=20_000, p=weight)
    truth = np.stack([rng.multivariate_normal(mean[m, 0], covariance[m, 0]) for m in mode])
    n = len(truth)
    tiled = (np.tile(a, (n, *[1] * a.ndim)) for a in (mean, weight, covariance))
    values = metrics.mixture_nees(*tiled, truth[:, None])
    assert values.mean() == pytest.approx(2.0, rel=0.02)
    # One mode alone: both are the same.
    alone = (np.tile(a[:1], (n, *[1] * a.ndim)) for a in (mean, weight / weight[0], covariance))
    one = list(alone)
    np.testing.assert_allclose(
        metrics.mixture_nees(*one, truth[:, None]), metrics.nees(*one, truth[:, None])
    )


@pytest.mark.parametrize(
    ("time_s", "step_s", "step"),
    [(1, 0.2, 4), (3, 0.2, 14), (5, 0.2, 24), (5.2, 0.2, None), (1, 0.4, None), (2, 0.4, 4)],
)
def test_a_time_between_two_steps_or_beyond_the_horizon_has_none(time_s, step_s, step):
    assert metrics.step_at(time_s, 25, step_s) == step


@pytest.mark.parametrize(
    ("steps", "step_s", "time_s"),
    [(25, 0.2, 5.0), (40, 0.2, 5.0), (20, 0.2, 3.0), (5, 0.2, 1.0), (4, 0.2, 0.8), (4, 0.3, 1.2)],
)
def test_the_headline_is_of_five_seconds_or_of_a_shorter_horizon(steps, step_s, time_s):
    assert metrics.headline_time_s(steps, step_s) == time_s
