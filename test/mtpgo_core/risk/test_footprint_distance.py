# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Distances between boxes and quantiles of the smallest one."""

import numpy as np
import pytest

from mtpgo_core.frames import rotate, rotate_covariance
from mtpgo_core.risk.footprint_distance import (
    STANDARD_ERRORS,
    footprint_distance,
    smallest_distances,
    weighted_quantiles,
)

EGO = np.array([4.8, 1.9])


def corners(center, yaw, size):
    half = 0.5 * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * size
    return center + rotate(half, yaw)


def slow_distance(offset, ego_yaw, yaw, ego_size, size):
    """Return the least distance from corners of one box to sides of the other, 0 if one is in."""
    boxes = corners(np.zeros(2), ego_yaw, ego_size), corners(offset, yaw, size)
    best = np.inf
    for one, two in (boxes, boxes[::-1]):
        for point in one:
            side = np.roll(two, -1, axis=0) - two
            share = ((point - two) * side).sum(axis=1) / (side * side).sum(axis=1)
            nearest = two + np.clip(share, 0.0, 1.0)[:, None] * side
            best = min(best, np.hypot(*(point - nearest).T).min())
    return best


def test_the_distance_is_that_of_corners_and_sides():
    rng = np.random.default_rng(0)
    n = 300
    yaw, ego_yaw = rng.uniform(-4.0, 4.0, (2, n))
    yaw[:60] = ego_yaw[:60] + rng.choice([0.0, 0.5 * np.pi, np.pi], 60)
    offset = rng.uniform(-15.0, 15.0, (n, 2))
    size = rng.uniform(0.4, 8.0, (n, 2))
    ego_size = np.tile(EGO, (n, 1))
    found = footprint_distance(offset[:, None], ego_yaw, yaw, ego_size, size)[:, 0]
    apart = found > 0.0
    assert 0.5 < apart.mean() < 1.0
    for i in np.flatnonzero(apart):
        wanted = slow_distance(offset[i], ego_yaw[i], yaw[i], EGO, size[i])
        assert found[i] == pytest.approx(wanted, abs=1e-9)


def test_boxes_that_touch_or_overlap_have_distance_zero():
    offset = np.array([[[0.0, 0.0], [4.65, 0.0], [4.75, 0.0], [3.0, 1.0]]])
    found = footprint_distance(offset, np.zeros(1), np.zeros(1), EGO[None], np.array([[4.5, 1.8]]))
    np.testing.assert_allclose(found, [[0.0, 0.0, 0.1, 0.0]], atol=1e-12)


def paths(seed, yaw_spread):
    """Return 20 paths of 15 steps that pass the ego."""
    rng = np.random.default_rng(seed)
    time_s = 0.2 * np.arange(1, 16)
    yaw = np.repeat(rng.uniform(-1.0, 1.0, (20, 1)) * yaw_spread, 15, axis=1)
    speed = rng.uniform(-15.0, 15.0, (20, 1))
    start = np.stack([rng.uniform(-30.0, 30.0, 20), rng.uniform(-12.0, 12.0, 20)], -1)
    offset = start[:, None] + (speed * time_s)[..., None] * np.stack(
        [np.cos(yaw), np.sin(yaw)], -1
    )
    along, across = (0.2 + 0.3 * time_s) ** 2, (0.1 + 0.1 * time_s) ** 2
    covariance = np.zeros((20, 15, 2, 2))
    c, s = np.cos(yaw), np.sin(yaw)
    covariance[..., 0, 0] = along * c * c + across * s * s
    covariance[..., 1, 1] = along * s * s + across * c * c
    covariance[..., 0, 1] = covariance[..., 1, 0] = (along - across) * c * s
    return offset, covariance, np.zeros(15), yaw, EGO, np.tile([4.5, 1.8], (20, 1))


@pytest.mark.parametrize(("yaw_spread", "tolerance_m"), [(0.0, 1e-5), (1.5, 0.4)])
def test_the_smallest_distance_over_the_steps_is_found(yaw_spread, tolerance_m):
    """Exactly for parallel boxes; with turned ones a neighbouring step may be taken instead."""
    offset, covariance, ego_yaw, yaw, ego_size, size = paths(1, yaw_spread)
    found = smallest_distances(offset, covariance, ego_yaw, yaw, ego_size, size)
    root = np.linalg.cholesky(
        np.einsum("psij,psjk,pslk->psil", turn(-yaw), covariance, turn(-yaw))
    )
    error = np.einsum("psij,psjk,ke->psei", turn(yaw), root, STANDARD_ERRORS)
    places = (offset[:, :, None] + error).reshape(-1, STANDARD_ERRORS.shape[1], 2)
    steps = footprint_distance(
        places,
        np.tile(ego_yaw, len(offset)),
        yaw.reshape(-1),
        np.tile(EGO, (yaw.size, 1)),
        np.repeat(size, yaw.shape[1], axis=0),
    )
    wanted = steps.reshape(*yaw.shape, -1).min(axis=1)
    assert (found >= wanted - 1e-5).all()
    assert (found - wanted).max() <= tolerance_m


def turn(yaw):
    c, s = np.cos(yaw), np.sin(yaw)
    return np.stack([np.stack([c, -s], -1), np.stack([s, c], -1)], -2)


@pytest.mark.parametrize("angle", [0.4, -2.0])
def test_a_turned_scene_has_the_same_smallest_distances(angle):
    offset, covariance, ego_yaw, yaw, ego_size, size = paths(3, 1.5)
    ego_yaw = np.linspace(0.0, 0.6, len(ego_yaw))  # the ego drives a bend
    wanted = smallest_distances(offset, covariance, ego_yaw, yaw, ego_size, size)
    found = smallest_distances(
        rotate(offset, angle),
        rotate_covariance(covariance, np.full(yaw.shape, angle)),
        ego_yaw + angle,
        yaw + angle,
        ego_size,
        size,
    )
    assert (wanted > 0.0).mean() > 0.5
    np.testing.assert_allclose(found, wanted, atol=1e-3)


def test_steps_that_are_not_known_do_not_count_and_a_path_without_any_is_infinite():
    offset, covariance, ego_yaw, yaw, ego_size, size = paths(2, 1.0)
    offset[3, 5:] = np.nan
    offset[4] = np.nan
    found = smallest_distances(offset, covariance, ego_yaw, yaw, ego_size, size)
    wanted = smallest_distances(
        offset[3:4, :5], covariance[3:4, :5], ego_yaw[:5], yaw[3:4, :5], ego_size, size[3:4]
    )
    np.testing.assert_allclose(found[3:4], wanted, atol=1e-5)
    assert np.isinf(found[4]).all()
    assert np.isfinite(np.delete(found, 4, axis=0)).all()


def test_the_errors_are_those_of_a_standard_normal():
    np.testing.assert_allclose(STANDARD_ERRORS.mean(axis=1), 0.0, atol=1e-12)
    np.testing.assert_allclose(np.cov(STANDARD_ERRORS, ddof=0), np.eye(2), atol=1e-12)
    # In every direction, about as many are beyond 1 as of a Gaussian.
    angle = np.linspace(0.0, np.pi, 12)
    aside = np.stack([np.cos(angle), np.sin(angle)], -1) @ STANDARD_ERRORS
    beyond = (np.abs(aside) > 1.0).mean(axis=1)
    np.testing.assert_allclose(beyond, 0.317, atol=0.2)
    assert abs(beyond.mean() - 0.317) < 0.05


def test_weighted_quantiles():
    value = np.array([[3.0, 1.0, 2.0, 100.0], [5.0, np.inf, 5.0, 5.0], [1.0, 1.0, 1.0, 1.0]])
    weight = np.array([[0.25, 0.5, 0.25, 0.0], [0.5, 0.5, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0]])
    found = weighted_quantiles(value, weight, (0.05, 0.25, 0.625, 0.95))
    # Middles of the weights: 1.0 at 0.25, 2.0 at 0.625, 3.0 at 0.875.
    np.testing.assert_allclose(found[0], [1.0, 1.0, 2.0, 3.0])
    assert np.isnan(found[1]).all()  # a path with weight is not known
    assert np.isnan(found[2]).all()  # nothing has a weight
