# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The probability of overlap: closed forms, Monte Carlo, invariances and unknown values."""

import math

import numpy as np
import pytest

from mtpgo_core.frames import rotate, rotate_covariance
from mtpgo_core.risk.footprint_overlap import NEGLIGIBLE, half_extent, overlap_probability

EGO = np.array([4.8, 1.9])
SIZES = np.array([[4.5, 1.8], [12.0, 2.5], [0.5, 0.5], [1.8, 0.6], [1.9, 4.8]])


def cases(number, seed=0):
    """Return random arguments in which the probability is neither 0 nor 1 for many."""
    rng = np.random.default_rng(seed)
    sigma = np.exp(rng.uniform(np.log(0.05), np.log(8.0), (number, 2)))
    covariance = rotate_covariance(
        np.eye(2) * sigma[:, None] ** 2, rng.uniform(0.0, np.pi, number)
    )
    reach = np.array([7.0, 4.0]) + 1.5 * sigma.max(axis=1)[:, None]
    offset = rotate(rng.uniform(-1.0, 1.0, (number, 2)) * reach, rng.uniform(-3.0, 3.0, number))
    size = SIZES[rng.integers(0, len(SIZES), number)]
    ego_yaw, yaw = rng.uniform(-4.0, 4.0, (2, number))
    some = rng.random(number) < 0.3  # parallel and perpendicular, or nearly so
    yaw[some] = ego_yaw[some] + rng.choice([0.0, 0.5 * np.pi, 1e-9, 1e-3], some.sum())
    return offset, covariance, ego_yaw, yaw, np.tile(EGO, (number, 1)), size


def hits(offset, ego_yaw, yaw, ego_size, size):
    """Return whether boxes overlap, by the separating axes: an independent implementation."""
    out = np.ones(offset.shape[:-1], dtype=bool)
    for angle in (ego_yaw, ego_yaw + 0.5 * np.pi, yaw, yaw + 0.5 * np.pi):
        axis = np.array([np.cos(angle), np.sin(angle)])
        reach = sum(
            0.5 * s[0] * abs(axis @ (np.cos(h), np.sin(h)))
            + 0.5 * s[1] * abs(axis @ (-np.sin(h), np.cos(h)))
            for s, h in ((ego_size, ego_yaw), (size, yaw))
        )
        out &= np.abs(offset @ axis) <= reach
    return out


def test_monte_carlo_agrees_to_one_percent():
    """1 % absolute, and 1 % of the probability where that is above 0.05."""
    number, samples = 40, 200_000
    arguments = cases(number)
    found = overlap_probability(*arguments)
    error = np.random.default_rng(1).normal(size=(samples, 2))
    for i, (offset, covariance, ego_yaw, yaw, ego_size, size) in enumerate(
        zip(*arguments, strict=True)
    ):
        places = offset + error @ np.linalg.cholesky(covariance).T
        wanted = hits(places, ego_yaw, yaw, ego_size, size).mean()
        noise = 4.0 * math.sqrt(max(wanted * (1.0 - wanted), 1e-6) / samples)
        assert abs(found[i] - wanted) <= 0.01
        if wanted > 0.05:
            assert abs(found[i] - wanted) <= 0.01 * wanted + noise
        assert abs(found[i] - wanted) <= 1e-4 + noise  # what the quadrature keeps to


def test_parallel_boxes_with_a_diagonal_covariance_are_a_product_of_error_functions():
    def between(mean, sigma, half):
        upper, lower = (half - mean) / sigma, (-half - mean) / sigma
        return 0.5 * (math.erf(upper / math.sqrt(2.0)) - math.erf(lower / math.sqrt(2.0)))

    x, y, sigma_x, sigma_y, yaw = 3.0, 1.0, 1.5, 0.6, 0.7
    for quarter, size in ((0.0, (4.5, 1.8)), (0.5 * math.pi, (1.8, 4.5)), (math.pi, (4.5, 1.8))):
        found = overlap_probability(
            rotate(np.array([[x, y]]), yaw),
            rotate_covariance(np.diag([sigma_x**2, sigma_y**2])[None], np.array([yaw])),
            np.array([yaw]),
            np.array([yaw + quarter]),
            EGO[None],
            np.array([size]),
        )
        wanted = between(x, sigma_x, 0.5 * (4.8 + 4.5)) * between(y, sigma_y, 0.5 * (1.9 + 1.8))
        assert found[0] == pytest.approx(wanted, abs=1e-8)


def test_a_sharp_position_overlaps_or_not():
    offset = np.array([[0.0, 0.0], [4.6, 1.8], [4.7, 0.0], [0.0, 1.9]])
    n = len(offset)
    found = overlap_probability(
        offset,
        np.zeros((n, 2, 2)),
        np.zeros(n),
        np.zeros(n),
        np.tile(EGO, (n, 1)),
        np.tile([4.5, 1.8], (n, 1)),
    )
    np.testing.assert_allclose(found, [1.0, 1.0, 0.0, 0.0], atol=1e-6)


def test_a_turned_scene_and_exchanged_boxes_have_the_same_probability():
    offset, covariance, ego_yaw, yaw, ego_size, size = cases(2000, seed=2)
    wanted = overlap_probability(offset, covariance, ego_yaw, yaw, ego_size, size)
    turn = np.random.default_rng(0).uniform(-3.0, 3.0, len(offset))
    turned = overlap_probability(
        rotate(offset, turn),
        rotate_covariance(covariance, turn),
        ego_yaw + turn,
        yaw + turn,
        ego_size,
        size,
    )
    np.testing.assert_allclose(turned, wanted, atol=1e-5)
    exchanged = overlap_probability(-offset, covariance, yaw, ego_yaw, size, ego_size)
    np.testing.assert_allclose(exchanged, wanted, atol=1e-4)


def test_what_is_left_out_as_far_is_negligible():
    """Without the bound the same pairs have probabilities below it."""
    offset, covariance, ego_yaw, yaw, ego_size, size = cases(3000, seed=3)
    far = offset * 2.5
    found = overlap_probability(far, covariance, ego_yaw, yaw, ego_size, size)
    direction = far / np.hypot(*far.T)[:, None]
    reach = half_extent(direction, ego_yaw, ego_size) + half_extent(direction, yaw, size)
    sigma = np.sqrt(np.einsum("ki,kij,kj->k", direction, covariance, direction))
    bound = np.array(
        [0.5 * math.erfc(g / math.sqrt(2.0)) for g in (np.hypot(*far.T) - reach) / sigma]
    )
    assert (found == 0.0).sum() > 100
    assert (bound[found == 0.0] < 2.0 * NEGLIGIBLE).mean() > 0.9
    assert (found <= bound + 1e-5).all()


@pytest.mark.parametrize("argument", range(6))
def test_what_is_not_finite_is_unknown_and_spoils_nothing_else(argument):
    arguments = cases(3)
    wanted = overlap_probability(*arguments)
    arguments[argument][1] = np.nan
    found = overlap_probability(*arguments)
    assert np.isnan(found[1])
    np.testing.assert_array_equal(found[[0, 2]], wanted[[0, 2]])


@pytest.mark.parametrize(
    "matrix", [[[1.0, 2.0], [2.0, 1.0]], [[-1.0, 0.0], [0.0, 1.0]], [[np.inf, 0.0], [0.0, 1.0]]]
)
def test_what_is_no_covariance_is_unknown(matrix):
    arguments = list(cases(1))
    arguments[1] = np.array([matrix])
    assert np.isnan(overlap_probability(*arguments)[0])


def test_no_pairs():
    assert overlap_probability(*cases(0)).shape == (0,)
