# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Highest-density regions, against the closed form and against random draws."""

import numpy as np
import pytest

from mtpgo_training.evaluation.honesty import mixture_region
from mtpgo_training.evaluation.honesty.mixture_region import region_level

CIRCLE = np.eye(2)


def levels_at(truth, mean, weight, covariance):
    """Levels of n truths [n, 2] under one mixture."""
    n = len(truth)
    parts = (np.tile(np.asarray(p, dtype=float), (n, *[1] * np.ndim(p))) for p in (mean, weight))
    return region_level(*parts, np.tile(covariance, (n, 1, 1, 1)), np.asarray(truth, dtype=float))


def test_a_single_gaussian_has_the_closed_form():
    level = levels_at([[0.0, 0.0], [2.0, 0.0]], [[0.0, 0.0]], [1.0], [CIRCLE])
    np.testing.assert_allclose(level, [0.0, 1.0 - np.exp(-2.0)])


@pytest.mark.parametrize("weight", [[0.5, 0.5], [0.97, 0.03], [1.0, 0.0]])
def test_modes_that_coincide_have_the_closed_form_of_one(weight):
    covariance = np.array([[4.0, 1.5], [1.5, 1.0]])
    truth = np.array([[0.3, 0.1], [1.0, -0.5], [4.0, 2.0], [9.0, 0.0]])
    squared = np.einsum("ni,ij,nj->n", truth, np.linalg.inv(covariance), truth)
    level = levels_at(truth, [[0.0, 0.0]] * 2, weight, [covariance] * 2)
    np.testing.assert_allclose(level, 1.0 - np.exp(-0.5 * squared), atol=0.01)


def test_two_modes_far_apart_each_have_their_own_ellipse():
    # Equally dense modes: half of each ellipse's probability is denser than its point.
    mean, truth = [[0.0, 0.0], [100.0, 0.0]], [[1.0, 0.0], [100.0, 1.5], [50.0, 0.0]]
    level = levels_at(truth, mean, [0.5, 0.5], [CIRCLE, CIRCLE])
    expected = [1.0 - np.exp(-0.5), 1.0 - np.exp(-0.5 * 1.5**2), 1.0]
    np.testing.assert_allclose(level, expected, atol=0.01)
    # A light mode's peak, 0.2, is as dense as the heavy one's at exp(-d^2 / 2) = 0.25.
    level = levels_at([[100.0, 0.0]], mean, [0.8, 0.2], [CIRCLE, CIRCLE])
    np.testing.assert_allclose(level, 0.8 * 0.75, atol=0.01)


def random_mixtures(n, modes, rng):
    mean = 2.0 * rng.normal(size=(n, modes, 2))
    root = rng.normal(size=(n, modes, 2, 2))
    covariance = root @ root.swapaxes(-1, -2) + 0.05 * np.eye(2)
    return mean, rng.dirichlet(np.full(modes, 0.5), size=n), covariance


def draw(mean, weight, covariance, count, rng):
    """Draw [count, 2] from one mixture."""
    mode = rng.choice(len(weight), p=weight, size=count)
    root = np.linalg.cholesky(covariance)[mode]
    return mean[mode] + (root @ rng.normal(size=(count, 2, 1)))[..., 0]


def density(at, mean, weight, covariance):
    offset = at[:, None] - mean
    squared = np.einsum("nmi,mij,nmj->nm", offset, np.linalg.inv(covariance), offset)
    return (weight * np.exp(-0.5 * squared) / np.sqrt(np.linalg.det(covariance))).sum(axis=1)


@pytest.mark.parametrize("modes", [2, 8])
def test_levels_agree_with_random_draws(modes):
    rng = np.random.default_rng(modes)
    mixtures = random_mixtures(15, modes, rng)
    truth = np.stack([draw(*one, 1, rng)[0] for one in zip(*mixtures, strict=True)])
    level = region_level(*mixtures, truth)
    for i, one in enumerate(zip(*mixtures, strict=True)):
        denser = density(draw(*one, 20_000, rng), *one) >= density(truth[i : i + 1], *one)
        assert level[i] == pytest.approx(denser.mean(), abs=0.02)
    assert np.abs(level - level.mean()).max() > 0.2


def test_the_region_of_the_true_distribution_holds_its_probability():
    rng = np.random.default_rng(0)
    mean, weight, covariance = (part[0] for part in random_mixtures(1, 3, rng))
    truth = draw(mean, weight, covariance, 3000, rng)
    level = levels_at(truth, mean, weight, covariance)
    for share in (0.5, 0.9, 0.95):
        assert (level <= share).mean() == pytest.approx(share, abs=0.03)


def test_far_and_repeated_truths_and_blocks(monkeypatch):
    rng = np.random.default_rng(1)
    mixtures = random_mixtures(7, 3, rng)
    truth = np.concatenate([rng.normal(size=(6, 2)), [[1e6, -1e6]]])
    level = region_level(*mixtures, truth)
    assert level[-1] == 1.0
    monkeypatch.setattr(mixture_region, "_AGENTS_AT_ONCE", 3)
    np.testing.assert_array_equal(region_level(*mixtures, truth), level)
    assert region_level(*(part[:0] for part in mixtures), truth[:0]).shape == (0,)


@pytest.mark.parametrize("sigma", [0.3, 0.03])
def test_thin_modes_far_apart_each_have_their_own_ellipse(sigma):
    """Two lanes or ways 40 m apart: the middle of the mixture is 670 sigma from either mode."""
    covariance = np.array([[[4.0, 0.0], [0.0, sigma**2]]] * 2)
    truth = np.array([[1.0, 1.2 * sigma], [-3.0, 40.0 - 0.5 * sigma]])
    squared = np.array([0.25 + 1.44, 2.25 + 0.25])
    level = levels_at(truth, [[0.0, 0.0], [0.0, 40.0]], [0.5, 0.5], covariance)
    np.testing.assert_allclose(level, 1.0 - np.exp(-0.5 * squared), atol=0.01)
