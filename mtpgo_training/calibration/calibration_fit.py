# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Fits the calibration of a model to samples of its predictions (docs/design.md, "Calibration").

Every *site* counts the same, whatever its number of predictions, and within a site every
prediction. Groups with few predictions are drawn towards the factors of all classes, and those
towards the factors of all road users.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import isotonic_regression, minimize_scalar

from mtpgo_core.quality.metrics import EXPECTED_NEES, Array, radius_squared
from mtpgo_core.schema import BoolArray
from mtpgo_core.task.calibration import (
    FACTOR_LIMITS,
    GROUPS,
    MOTIONS,
    SIGMA_FACTOR_50_LIMITS,
    TEMPERATURE_LIMITS,
    Calibration,
    CalibrationSite,
    GroupCalibration,
)
from mtpgo_training.calibration.calibration_samples import CalibrationSamples
from mtpgo_training.evaluation.honesty.mode_weights import nearest

LEVEL = 0.9
"""Share of the truths that the ellipse of this level shall hold."""

WIDENED_LEVEL = 0.88
"""Share of the truths up to which the 90 % ellipse is widened where it holds less; chosen on
left-out sites by coverage and likelihood (docs/design.md, "Calibration")."""

LEVEL_50 = 0.5
"""The level of the second ellipse, which has a factor of its own: errors have heavier tails than a
Gaussian, so the half of them that is smaller lies closer together."""

FACTOR_50_LIMITS = (FACTOR_LIMITS[0] * SIGMA_FACTOR_50_LIMITS[0] ** 2, FACTOR_LIMITS[1])
"""Smallest and largest factor on a covariance for the 50 % ellipse; most of the road users that
stand have no error at all."""

SITE_AGENTS = 100
"""A site with this many predictions of a group has half the weight of one with very many; chosen:
some ten road users at one prediction a second, whose quantile is hardly known."""

POOLED_AGENTS = 200
"""A group of this effective number of predictions is drawn half of the way to the pooled factor;
chosen: some twenty road users at one prediction a second."""

SITE_LIMIT = 20_000
"""Most predictions of a site that are used, evenly spread; chosen: the quantile of 90 % is then
known to 0.2 %, and a fit takes a second."""

TIE_M = 0.1
"""Modes within this of the nearest one (average over the horizon) count as nearest, too (m);
chosen: the noise of an observed position."""


def fit_calibration(samples: CalibrationSamples, *, left_out: bool = False) -> Calibration:
    """Return the calibration fitted to predictions without one.

    Args:
        samples: of at least one site; groups without any get the pooled factors.
        left_out: whether they are from sites that the training of the models did not see.
    """
    samples = samples.thinned(SITE_LIMIT)
    all_agents = np.ones(len(samples), dtype=bool)
    pooled = _fit(samples, all_agents, _Fit.nothing(samples.distance.shape[1]))
    by_motion = {
        motion: _fit(samples, samples.group % len(MOTIONS) == index, pooled)
        for index, motion in enumerate(MOTIONS)
    }
    groups = []
    for index, name in enumerate(GROUPS):
        motion = MOTIONS[index % len(MOTIONS)]
        rows = samples.group == index
        if name.startswith("any_"):
            rows, fit = samples.group % 2 == index % 2, by_motion[motion]
        else:
            fit = _fit(samples, rows, by_motion[motion])
        factors = np.clip(_monotone(fit.log_factors, samples.distance[rows]), *FACTOR_LIMITS)
        inner = _monotone(fit.log_factors_50, samples.distance[rows])
        sigma_50 = np.clip(np.sqrt(inner / factors), *SIGMA_FACTOR_50_LIMITS)
        groups.append(
            GroupCalibration(
                name=name,
                factors=tuple(_rounded(factors)),
                temperature=_rounded(np.clip([np.exp(fit.log_temperature)], *TEMPERATURE_LIMITS))[
                    0
                ],
                agents=int(np.isfinite(samples.distance[rows]).any(axis=1).sum()),
                sites=len(np.unique(samples.site[rows])),
                sigma_factors_50=tuple(_rounded(sigma_50)),
            )
        )
    counts = np.bincount(samples.site, minlength=len(samples.sites))
    sites = tuple(
        CalibrationSite(name, int(count))
        for name, count in zip(samples.sites, counts, strict=True)
        if count
    )
    return Calibration(groups=tuple(groups), sites=sites, left_out=left_out)


@dataclass(frozen=True)
class _Fit:
    """What is fitted to some agents.

    Attributes:
        log_factors: [H] of the covariances.
        log_factors_50: [H] factors on the covariances for the 50 % ellipses.
        log_temperature: of the mode weights.
    """

    log_factors: Array
    log_factors_50: Array
    log_temperature: float

    @classmethod
    def nothing(cls, horizon: int) -> _Fit:
        """Return what changes nothing."""
        return cls(np.zeros(horizon), np.zeros(horizon), 0.0)


def _fit(samples: CalibrationSamples, rows: BoolArray, toward: _Fit) -> _Fit:
    """Return what is fitted to some agents, drawn towards what is given."""
    distance, site = samples.distance[rows], samples.site[rows]
    fitted, fitted_50 = toward.log_factors.copy(), toward.log_factors_50.copy()
    for step in range(distance.shape[1]):
        known = np.isfinite(distance[:, step])
        if known.any():
            values, weight = distance[known, step], site_weights(site[known])
            own = _own_share(weight)
            factor = np.clip(best_factor(values, weight), *FACTOR_LIMITS)
            factor_50 = np.clip(level_factor(values, weight, LEVEL_50), *FACTOR_50_LIMITS)
            fitted[step] += own * (np.log(factor) - fitted[step])
            fitted_50[step] += own * (np.log(factor_50) - fitted_50[step])
    error = samples.mode_error[rows]
    whole = np.isfinite(error).all(axis=1) & np.isfinite(samples.log_weight[rows]).all(axis=1)
    temperature = toward.log_temperature
    if error.shape[1] >= 2 and whole.any():
        weight = site_weights(site[whole])
        best = best_temperature(samples.log_weight[rows][whole], error[whole], weight)
        temperature += _own_share(weight) * (np.log(best) - temperature)
    return _Fit(fitted, fitted_50, float(temperature))


def level_factor(distance: Array, weight: Array, level: float) -> float:
    """Return the factor on the covariance at which the ellipse of a level holds its share.

    Args:
        distance: [n] squared Mahalanobis distances.
        weight: [n] of the agents.
        level: the share.
    """
    return weighted_quantile(distance, weight, level) / radius_squared(level)


def best_factor(distance: Array, weight: Array) -> float:
    """Return the factor at which the ellipse holds its share, if the likelihood allows it.

    Errors may have heavier tails than a Gaussian: of road users that stand, most stay exactly
    where they are and some start. Ellipses that hold 90 % would then be so small that the others
    cost more likelihood than the narrow ellipses gain. A factor below 1 is therefore no smaller
    than the one of the largest likelihood, the mean squared distance divided by its expectation.
    A factor above 1 costs likelihood on sites that need none, so that it is the smallest one that
    brings the share to :data:`WIDENED_LEVEL`.

    Args:
        distance: [n] squared Mahalanobis distances.
        weight: [n] of the agents.
    """
    factor = level_factor(distance, weight, LEVEL)
    if factor >= 1.0:
        enough = weighted_quantile(distance, weight, WIDENED_LEVEL) / radius_squared(LEVEL)
        return max(1.0, enough)
    likeliest = float((weight * distance).sum() / weight.sum()) / EXPECTED_NEES
    return min(1.0, max(factor, likeliest))


def site_weights(site: np.ndarray) -> Array:
    """Return [n] weights of agents such that sites with many agents count the same.

    Args:
        site: [n] position of each agent's site.
    """
    counts = np.bincount(site)
    return np.asarray(1.0 / (counts[site] + SITE_AGENTS))


def weighted_quantile(values: Array, weight: Array, level: float) -> float:
    """Return the smallest value at which values of the share ``level`` of the weight are reached.

    Args:
        values: [n], at least one.
        weight: [n], positive.
        level: between 0 and 1.
    """
    order = np.argsort(values)
    reached = np.cumsum(weight[order])
    place = np.searchsorted(reached, level * reached[-1])
    return float(values[order[min(int(place), len(order) - 1)]])


def best_temperature(log_weight: Array, mode_error: Array, weight: Array) -> float:
    """Return the temperature at which the mode weights best predict the nearest mode.

    It minimises the cross-entropy, which is convex in 1 / T.

    Args:
        log_weight: [n, M].
        mode_error: [n, M] average distance from the truth (m).
        weight: [n] of the agents.
    """
    target = nearest(mode_error, TIE_M)
    logits = log_weight.astype(np.float64)
    logits = logits - logits.max(axis=1, keepdims=True)
    share = weight / weight.sum()

    def cross_entropy(log_temperature: float) -> float:
        scaled = logits * np.exp(-log_temperature)
        total = np.log(np.exp(scaled).sum(axis=1))
        return float((share * (total - (target * scaled).sum(axis=1))).sum())

    low, high = np.log(TEMPERATURE_LIMITS)
    return float(np.exp(minimize_scalar(cross_entropy, bounds=(low, high), method="bounded").x))


def _own_share(weight: Array) -> float:
    """Return how much a group's own value counts, the rest being the pooled one."""
    effective = weight.sum() ** 2 / (weight**2).sum()
    return float(effective / (effective + POOLED_AGENTS))


def _monotone(log_factors: Array, distance: Array) -> Array:
    """Return [H] factors that do not decrease, by isotonic regression of their logarithms."""
    known = np.isfinite(distance).sum(axis=0) + 1.0  # steps that are known more often count more
    return np.exp(isotonic_regression(log_factors, weights=known).x)


def _rounded(values: Array) -> list[float]:
    """Return values with four decimals, as they are stored."""
    return [round(value, 4) for value in np.asarray(values, dtype=np.float64).tolist()]
