# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Covariance ellipses as polygons, by hand."""

import numpy as np
import pytest

from msg_adapters.outputs.ellipses import ellipse_sides, ellipse_steps


def sides(covariance, mean=(0.0, 0.0), sigma=2.0, corners=4):
    mean, covariance = np.reshape(mean, (1, 1, 1, 2)), np.reshape(covariance, (1, 1, 1, 2, 2))
    found = ellipse_sides(mean, covariance, sigma=sigma, corners=corners)
    return found.reshape(corners, 2, 2)


def test_an_axis_aligned_ellipse_by_hand():
    """Deviations 3 m and 1 m around (10, 20) at two sigma: half axes of 6 m and 2 m."""
    found = sides(np.diag([9.0, 1.0]), (10.0, 20.0))
    corners = [[16.0, 20.0], [10.0, 22.0], [4.0, 20.0], [10.0, 18.0]]
    np.testing.assert_allclose(found[:, 0], corners, atol=1e-9)
    np.testing.assert_array_equal(found[:, 1], np.roll(found[:, 0], -1, axis=0))


@pytest.mark.parametrize("rho", [-0.9, 0.0, 0.999])
def test_each_corner_has_the_same_mahalanobis_distance(rho):
    covariance = np.array([[4.0, 2.0 * rho], [2.0 * rho, 1.0]])
    corner = sides(covariance, sigma=1.5, corners=16)[:, 0]
    distance = np.einsum("ki,ij,kj->k", corner, np.linalg.inv(covariance), corner)
    np.testing.assert_allclose(distance, 1.5**2)


def test_a_covariance_without_any_extent_stays_finite():
    assert np.abs(sides(np.zeros((2, 2)))).max() < 1e-5
    assert np.isfinite(sides([[1.0, 1.0], [1.0, 1.0 - 1e-12]])).all()


def test_several_ellipses_of_an_agent_follow_each_other():
    mean = np.arange(2 * 3 * 4 * 2, dtype=np.float64).reshape(2, 3, 4, 2)
    covariance = np.broadcast_to(np.eye(2), (2, 3, 4, 2, 2))
    found = ellipse_sides(mean, covariance, sigma=1.0, corners=5)
    assert found.shape == (2, 3, 4 * 5 * 2, 2)
    centres = found.reshape(2, 3, 4, 5, 2, 2)[..., 0, :].mean(axis=3)
    np.testing.assert_allclose(centres, mean, atol=1e-9)


@pytest.mark.parametrize(
    ("count", "every_s", "steps"),
    [
        (25, 1.0, [4, 9, 14, 19, 24]),  # 1 s to 5 s
        (5, 0.4, [1, 3]),  # 0.4 s and 0.8 s of 1 s
        (3, 0.1, [0, 1, 2]),  # finer than the steps: none twice
        (3, 1.0, []),  # beyond the horizon
        (0, 1.0, []),
    ],
)
def test_steps_nearest_to_the_multiples(count, every_s, steps):
    time_s = 0.2 * np.arange(1, count + 1)
    assert ellipse_steps(time_s, every_s).tolist() == steps
