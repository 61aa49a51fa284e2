# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Kernel density estimates against scipy, and samples against the mixture they come from."""

import numpy as np
import pytest
from scipy.stats import gaussian_kde

from mtpgo_training.evaluation.scores.agent_scores import score_agents
from mtpgo_training.evaluation.scores.kernel_density import (
    LEAST_LOG_DENSITY,
    kernel_log_density,
    kernel_nll,
    mixture_samples,
)

DRAW = np.random.default_rng(3)


def mixture(n=1, horizon=2):
    mean = DRAW.normal(0.0, 5.0, (n, 3, horizon, 2))
    factor = DRAW.normal(0.0, 1.0, (n, 3, horizon, 2, 2))
    covariance = factor @ np.swapaxes(factor, -1, -2) + 0.2 * np.eye(2)
    return mean, np.tile([0.5, 0.3, 0.2], (n, 1)), covariance


def test_the_density_is_that_of_scipy():
    samples = DRAW.normal(0.0, 1.0, (4, 300, 3, 2)) @ np.array([[2.0, 0.3], [0.0, 0.5]])
    truth = DRAW.normal(0.0, 1.0, (4, 3, 2))
    value = kernel_log_density(samples, truth)
    for i in range(4):
        for k in range(3):
            expected = gaussian_kde(samples[i, :, k].T).logpdf(truth[i, k])
            assert value[i, k] == pytest.approx(expected[0], abs=1e-4)


def test_samples_have_the_mean_and_the_covariance_of_the_mixture():
    mean, weight, covariance = mixture()
    samples = mixture_samples(mean, weight, covariance, 100_000)[0, :, 1]
    expected = np.einsum("m,mi->i", weight[0], mean[0, :, 1])
    offset = mean[0, :, 1] - expected
    spread = np.einsum("m,mij->ij", weight[0], covariance[0, :, 1])
    spread += np.einsum("m,mi,mj->ij", weight[0], offset, offset)
    np.testing.assert_allclose(samples.mean(axis=0), expected, atol=0.1)
    np.testing.assert_allclose(np.cov(samples.T), spread, rtol=0.03, atol=0.2)


def test_a_gaussian_has_nearly_its_analytic_likelihood():
    mean, weight = np.zeros((1, 1, 1, 2)), np.ones((1, 1))
    covariance = np.eye(2)[None, None, None]
    truth, mask = np.array([[[0.5, -0.5]]]), np.ones((1, 1), dtype=bool)
    average, final = kernel_nll(mean, weight, covariance, truth, mask, 20_000)
    assert average[0] == final[0]
    assert final[0] == pytest.approx(np.log(2.0 * np.pi) + 0.25, abs=0.06)


def test_a_truth_out_of_reach_has_the_least_density():
    samples = DRAW.normal(0.0, 0.1, (1, 50, 1, 2))
    assert kernel_log_density(samples, np.full((1, 1, 2), 1e3)) == LEAST_LOG_DENSITY


def test_samples_in_one_point_have_a_density():
    value = kernel_log_density(np.zeros((1, 50, 1, 2)), np.zeros((1, 1, 2)))
    assert np.isfinite(value).all()


def test_what_is_not_observed_does_not_count():
    mean, weight, covariance = mixture(n=3, horizon=4)
    truth = DRAW.normal(size=(3, 4, 2))
    mask = np.array([[True, True, False, False], [False] * 4, [True] * 4])
    truth[~mask] = np.nan
    average, final = kernel_nll(mean, weight, covariance, truth, mask, 50)
    assert np.isfinite(average[[0, 2]]).all()
    assert np.isnan(average[1])
    assert np.isnan(final[:2]).all()
    assert np.isfinite(final[2])


def test_the_estimate_stands_beside_the_analytic_value_if_it_is_asked_for():
    mean, weight, covariance = mixture(n=2)
    truth, mask = mean[:, 0], np.ones((2, 2), dtype=bool)
    scores = score_agents(mean, weight, covariance, truth, mask, kde_samples=500)
    without = score_agents(mean, weight, covariance, truth, mask)
    np.testing.assert_array_equal(scores.values["anll"], without.values["anll"])
    np.testing.assert_allclose(scores.values["anll_kde"], scores.values["anll"], atol=1.5)
    assert np.isnan(without.values["anll_kde"]).all()
