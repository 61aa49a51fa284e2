# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Fits the calibration of a model to samples of its predictions (docs/design.md, "Calibration").

Every *site* counts the same, whatever its number of predictions, and within a site every
prediction. Groups with few predictions are drawn towards the factors of all classes, and those
towards the factors of all road users.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import isotonic_regression, minimize_scalar

from mtpgo_core.quality.metrics import EXPECTED_NEES, Array, radius_squared
from mtpgo_core.schema import BoolArray
from mtpgo_core.task.calibration import (
    FACTOR_LIMITS,
    GROUPS,
    MOTIONS,
    TEMPERATURE_LIMITS,
    Calibration,
    CalibrationSite,
    GroupCalibration,
)
from mtpgo_training.calibration.calibration_samples import CalibrationSamples
from mtpgo_training.evaluation.honesty.mode_weights import nearest

LEVEL = 0.9
"""Share of the truths that the ellipse of this level shall hold."""

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
    horizon = samples.distance.shape[1]
    pooled = _fit(samples, all_agents, np.zeros(horizon), 0.0)
    by_motion = {
        motion: _fit(samples, samples.group % len(MOTIONS) == index, *pooled)
        for index, motion in enumerate(MOTIONS)
    }
    groups = []
    for index, name in enumerate(GROUPS):
        motion = MOTIONS[index % len(MOTIONS)]
        rows = samples.group == index
        if name.startswith("any_"):
            rows, (factors, temperature) = samples.group % 2 == index % 2, by_motion[motion]
        else:
            factors, temperature = _fit(samples, rows, *by_motion[motion])
        groups.append(
            GroupCalibration(
                name=name,
                factors=tuple(_rounded(_monotone(factors, samples.distance[rows]))),
                temperature=_rounded(np.clip([np.exp(temperature)], *TEMPERATURE_LIMITS))[0],
                agents=int(np.isfinite(samples.distance[rows]).any(axis=1).sum()),
                sites=len(np.unique(samples.site[rows])),
            )
        )
    counts = np.bincount(samples.site, minlength=len(samples.sites))
    sites = tuple(
        CalibrationSite(name, int(count))
        for name, count in zip(samples.sites, counts, strict=True)
        if count
    )
    return Calibration(groups=tuple(groups), sites=sites, left_out=left_out)


def _fit(
    samples: CalibrationSamples, rows: BoolArray, log_factors: Array, log_temperature: float
) -> tuple[Array, float]:
    """Return [H] log factors and the log temperature of some agents, drawn towards those given."""
    distance, site = samples.distance[rows], samples.site[rows]
    fitted = log_factors.copy()
    for step in range(distance.shape[1]):
        known = np.isfinite(distance[:, step])
        if known.any():
            weight = site_weights(site[known])
            factor = np.clip(best_factor(distance[known, step], weight), *FACTOR_LIMITS)
            own = _own_share(weight)
            fitted[step] = own * np.log(factor) + (1.0 - own) * log_factors[step]
    error = samples.mode_error[rows]
    whole = np.isfinite(error).all(axis=1) & np.isfinite(samples.log_weight[rows]).all(axis=1)
    if error.shape[1] < 2 or not whole.any():
        return fitted, log_temperature
    weight = site_weights(site[whole])
    own = _own_share(weight)
    best = best_temperature(samples.log_weight[rows][whole], error[whole], weight)
    return fitted, float(own * np.log(best) + (1.0 - own) * log_temperature)


def best_factor(distance: Array, weight: Array) -> float:
    """Return the factor at which the ellipse holds its share, but narrow at no cost of likelihood.

    Errors may have heavier tails than a Gaussian: of road users that stand, most stay exactly
    where they are and some start. Ellipses that hold 90 % would then be so small that the others
    cost more likelihood than the narrow ellipses gain. A factor below 1 is therefore no smaller
    than the one of the largest likelihood, the mean squared distance divided by its expectation.

    Args:
        distance: [n] squared Mahalanobis distances.
        weight: [n] of the agents.
    """
    factor = weighted_quantile(distance, weight, LEVEL) / radius_squared(LEVEL)
    if factor >= 1.0:
        return factor
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
    level = isotonic_regression(log_factors, weights=known).x
    return np.clip(np.exp(level), *FACTOR_LIMITS)


def _rounded(values: Array) -> list[float]:
    """Return values with four decimals, as they are stored."""
    return [round(value, 4) for value in np.asarray(values, dtype=np.float64).tolist()]
