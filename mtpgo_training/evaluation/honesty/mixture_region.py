# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Highest-density regions of Gaussian mixtures in the plane.

The highest-density region of probability p is the smallest area that holds p. A point lies in it
if the probability of all denser points is at most p, so one number for each truth, the level of
the region on whose edge it lies, answers the question for every p. If the mixture is the true
distribution, the levels are uniform over [0, 1].

Names are those of :mod:`mtpgo_core.quality.metrics`, without the horizon: ``mean``
[n, M, 2] (m), ``weight`` [n, M], ``covariance`` [n, M, 2, 2] (m^2), ``truth`` [n, 2] (m).
"""

from __future__ import annotations

import numpy as np

from mtpgo_core.quality.metrics import Array, mahalanobis

POINTS = 512
"""Points of equal probability by which a mixture is represented; chosen so that levels are
accurate to 1 % (see the test, against random draws)."""

_GOLDEN_RAD = np.pi * (3.0 - np.sqrt(5.0))
"""Angle from point to point of a spiral that fills a disc evenly (rad): the golden angle."""

_AGENTS_AT_ONCE = 128
"""Agents computed together; chosen, bounds the memory (10 MB with eight modes)."""


def region_level(mean: Array, weight: Array, covariance: Array, truth: Array) -> Array:
    """[n] probability that the mixture gives to the points denser than the truth.

    A single Gaussian has the closed form 1 - exp(-d^2 / 2) with the Mahalanobis distance d.
    Otherwise the mixture is represented by points of equal probability, of which the share that
    is denser than the truth is the level. There is no randomness.
    """
    if weight.shape[1] == 1:
        squared, _ = mahalanobis(truth - mean[:, 0], covariance[:, 0])
        return -np.expm1(-0.5 * squared)
    parts = [
        _levels(*(part[i : i + _AGENTS_AT_ONCE] for part in (mean, weight, covariance, truth)))
        for i in range(0, len(weight), _AGENTS_AT_ONCE)
    ]
    return np.concatenate([np.empty(0), *parts])


def _levels(mean: Array, weight: Array, covariance: Array, truth: Array) -> Array:
    middle = np.einsum("nm,nmi->ni", weight, mean) / weight.sum(axis=1, keepdims=True)
    offset = mean - middle[:, None]  # small numbers, so that expanded squares are exact enough
    terms = _log_densities(offset, weight, covariance)  # [n, 6, M]
    density = np.exp(_basis(_points(offset, weight, covariance)) @ terms).sum(axis=-1)  # [n, K]
    squared, log_determinant = mahalanobis(truth[:, None] - mean, covariance)
    # A truth so far out that its density underflows to zero lies outside of every region.
    own = (weight * np.exp(-0.5 * (squared + log_determinant))).sum(axis=1)
    return np.asarray((density >= own[:, None]).mean(axis=1))


def _basis(at: Array) -> Array:
    """[n, K, 6] x^2, x y, y^2, x, y and 1 of points [n, K, 2]."""
    x, y = at[..., 0], at[..., 1]
    return np.stack([x * x, x * y, y * y, x, y, np.ones_like(x)], axis=-1)


def _points(mean: Array, weight: Array, covariance: Array) -> Array:
    """[n, K, 2] points of equal probability of the mixtures.

    Probability is cut into K slices, one mode after the other. Each mode spreads its slices over
    rings of equal probability of its ellipse, the points of which are a golden angle apart.
    """
    n = len(weight)
    ends = np.cumsum(weight, axis=1)
    ends /= ends[:, -1:]
    slices = (np.arange(POINTS) + 0.5) / POINTS
    mode = (slices[None, :, None] > ends[:, None, :-1]).sum(axis=-1)  # [n, K]
    row = np.arange(n)[:, None]
    begin = np.concatenate([np.zeros((n, 1)), ends], axis=1)[row, mode]
    share = np.clip((slices - begin) / (ends[row, mode] - begin), 0.0, 1.0 - 1e-9)
    radius = np.sqrt(-2.0 * np.log1p(-share))
    angle = _GOLDEN_RAD * np.arange(POINTS)
    u, v = radius * np.cos(angle), radius * np.sin(angle)
    a, b, e = covariance[..., 0, 0], covariance[..., 0, 1], covariance[..., 1, 1]
    first = np.sqrt(a)  # the Cholesky factor, written out
    low, last = b / first, np.sqrt(np.maximum(e - b * b / a, 0.0))
    x = mean[..., 0][row, mode] + first[row, mode] * u
    y = mean[..., 1][row, mode] + low[row, mode] * u + last[row, mode] * v
    return np.stack([x, y], axis=-1)


def _log_densities(mean: Array, weight: Array, covariance: Array) -> Array:
    """[n, 6, M] each mode's log-density as coefficients of x^2, x y, y^2, x, y and 1.

    Without the constant log(2 pi). A weight of zero counts as the smallest normal number, so that
    products are defined; the constant itself may be any number, as of a mode that is far away and
    thin.
    """
    a, b, e = covariance[..., 0, 0], covariance[..., 0, 1], covariance[..., 1, 1]
    determinant = a * e - b * b
    xx, xy, yy = e / determinant, -b / determinant, a / determinant
    u, v = mean[..., 0], mean[..., 1]
    along, across = xx * u + xy * v, xy * u + yy * v
    log_weight = np.log(np.maximum(weight, np.finfo(np.float64).tiny))
    constant = log_weight - 0.5 * np.log(determinant) - 0.5 * (u * along + v * across)
    return np.stack([-0.5 * xx, -xy, -0.5 * yy, along, across, constant], axis=1)
