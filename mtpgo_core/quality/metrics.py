# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The paper's metrics (section Evaluation Metrics) and other usual ones, per agent.

Every function takes arrays with any leading axes ``...`` (agents, scenes) and returns one value
for each agent, ``[...]``, so that the caller decides over which agents to average (docs/design.md,
decision 15: the centre agents or all). Future samples that were not observed are masked: an
average over the horizon is one over the observed steps, and a value that needs a step that was not
observed is NaN. Use :func:`average` to average over agents; it leaves NaN out.

Inputs have the same names throughout: ``mean`` [..., M, H, 2] predicted positions (m), ``weight``
[..., M] mixture weights, ``covariance`` [..., M, H, 2, 2] (m^2), ``truth`` [..., H, 2] observed
positions (m), ``mask`` [..., H] true where they were observed.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating]
Mask = NDArray[np.bool_]

MISS_THRESHOLD_M = 2.0
"""Final displacement beyond which a prediction is a miss (m), as in the paper."""

TIMES_S = (1, 3, 5)
"""Times ahead at which coverages and likelihoods are given (s), as far as the horizon reaches."""

MOVING_COVERAGE_KEY = "coverage_90_moving_{:g}s"
"""Name of the share of moving road users inside the heaviest mode's 90 % ellipse at a time."""

SITES_COVERAGE_KEY = "sites_coverage_90_moving_{:g}s"
"""Name of the mean over the sites of that share of each: a site counts the same whatever its
number of road users."""

EXPECTED_NEES = 2.0
"""Average of the NEES of a position where the covariance is right: its two degrees of freedom."""


def step_at(time_s: float, steps: int, step_s: float) -> int | None:
    """Return the index of the horizon step at a time, None if there is none.

    Args:
        time_s: the time ahead (s).
        steps: H.
        step_s: time between two of them (s).
    """
    step = round(time_s / step_s)
    exact = abs(step * step_s - time_s) < 1e-6
    return step - 1 if exact and 1 <= step <= steps else None


def scored_steps(steps: int, step_s: float) -> dict[float, int]:
    """Return the steps at which coverage is given, by the time ahead (s), ascending.

    They are those of ``TIMES_S`` at which there is a step, else the end of the horizon.

    Args:
        steps: H.
        step_s: time between two of them (s).
    """
    found = {time_s: step_at(time_s, steps, step_s) for time_s in map(float, TIMES_S)}
    reached = {time_s: step for time_s, step in found.items() if step is not None}
    return reached or {round(steps * step_s, 6): steps - 1}


def headline_time_s(steps: int, step_s: float) -> float:
    """Return the time of the share by which a model is judged first (s): 5 s.

    Of a shorter horizon it is the last of :func:`scored_steps`.

    Args:
        steps: H.
        step_s: time between two of them (s).
    """
    return max(scored_steps(steps, step_s))


def average(values: Array) -> float:
    """Mean over the agents for which ``values`` [...] is defined, NaN if there is none."""
    known = np.isfinite(values)
    return float(np.mean(values[known])) if known.any() else float("nan")


def top_mode(mean: Array, weight: Array) -> Array:
    """[..., H, 2] positions of the component with the largest weight, j* in the paper."""
    best = np.argmax(weight, axis=-1)
    return np.take_along_axis(mean, best[..., None, None, None], axis=-3).squeeze(-3)


def ade(mean: Array, weight: Array, truth: Array, mask: Mask) -> Array:
    """[...] ADE (m): displacement of the top mode, averaged over the observed steps."""
    return over_steps(displacement(mean, weight, truth), mask)


def fde(mean: Array, weight: Array, truth: Array, mask: Mask) -> Array:
    """[...] FDE (m): displacement of the top mode at step H; NaN where that is not observed."""
    final = _distance(top_mode(mean, weight)[..., -1, :], truth[..., -1, :])
    return np.where(mask[..., -1], final, np.nan)


def miss_rate(
    mean: Array,
    weight: Array,
    truth: Array,
    mask: Mask,
    miss_threshold_m: float = MISS_THRESHOLD_M,
) -> Array:
    """[...] MR: 1 if the top mode ends farther than the threshold from the truth, else 0.

    Averaged over agents it is the ratio of misses; NaN where step H is not observed.
    """
    final = fde(mean, weight, truth, mask)
    return np.where(np.isnan(final), np.nan, (final > miss_threshold_m).astype(float))


def displacement(mean: Array, weight: Array, truth: Array) -> Array:
    """[..., H] distance of the top mode from the truth (m), unmasked; averaged it is ADE."""
    return _distance(top_mode(mean, weight), truth)


def apde(mean: Array, weight: Array, truth: Array, mask: Mask) -> Array:
    """[...] APDE (m): distance of each predicted position to the nearest observed one.

    Averaged over those steps of the top mode whose own truth was observed, so ADE and APDE are
    over the same steps; the nearest position is sought among all observed steps.
    """
    path = top_mode(mean, weight)
    pairs = _distance(path[..., :, None, :], truth[..., None, :, :])  # [..., H, H]
    nearest = np.min(np.where(mask[..., None, :], pairs, np.inf), axis=-1)
    return over_steps(nearest, mask)


def anll(mean: Array, weight: Array, covariance: Array, truth: Array, mask: Mask) -> Array:
    """[...] ANLL (nats): negative log-likelihood of the position, averaged over observed steps."""
    return over_steps(nll(mean, weight, covariance, truth), mask)


def fnll(mean: Array, weight: Array, covariance: Array, truth: Array, mask: Mask) -> Array:
    """[...] FNLL (nats): negative log-likelihood at step H; NaN where that is not observed."""
    final = nll(mean, weight, covariance, truth)[..., -1]
    return np.where(mask[..., -1], final, np.nan)


def min_ade(mean: Array, truth: Array, mask: Mask) -> Array:
    """[...] minADE (m): the smallest over the M modes of the mode's ADE."""
    distance = _distance(mean, truth[..., None, :, :])  # [..., M, H]
    known = np.broadcast_to(mask[..., None, :], distance.shape)
    return np.min(over_steps(distance, known), axis=-1)


def min_fde(mean: Array, truth: Array, mask: Mask) -> Array:
    """[...] minFDE (m): the smallest final displacement; NaN where step H is not observed."""
    final = np.min(_distance(mean[..., -1, :], truth[..., None, -1, :]), axis=-1)
    return np.where(mask[..., -1], final, np.nan)


def coverage(
    mean: Array, weight: Array, covariance: Array, truth: Array, mask: Mask, level: float
) -> Array:
    """[...] share of the observed steps at which the top mode's ``level`` ellipse holds the truth.

    The ellipse of a two-dimensional Gaussian that holds the share ``level`` has the squared
    Mahalanobis radius -2 ln(1 - level). A calibrated prediction averages to ``level``.
    """
    return share_inside(nees(mean, weight, covariance, truth), mask, level)


def share_inside(
    squared: Array, mask: Mask, level: float, sigma_factor_50: Array | float = 1.0
) -> Array:
    """[...] share of the observed steps with a NEES ``squared`` [..., H] inside of ``level``."""
    return over_steps(is_inside(squared, level, sigma_factor_50).astype(float), mask)


def is_inside(squared: Array, level: float, sigma_factor_50: Array | float = 1.0) -> Mask:
    """[..., H] whether a NEES ``squared`` [..., H] is inside the ellipse of ``level``.

    Args:
        squared: see :func:`nees`.
        level: share of the truths that the ellipse shall hold.
        sigma_factor_50: [..., H] or one for all, see :class:`~mtpgo_core.schema.Prediction`.
    """
    return np.asarray(squared <= radius_squared(level) * sigma_factor(level, sigma_factor_50) ** 2)


def sigma_factor(level: float, sigma_factor_50: Array | float) -> Array:
    """[...] factor on the standard deviations for the ellipse of a level.

    Its logarithm is linear in the Mahalanobis radius through the factor at 50 % and 1 at 90 %;
    below 50 % it is that of 50 %, and above 90 % it goes on by half of the distance at most.
    """
    radius, inner, outer = (float(np.sqrt(radius_squared(p))) for p in (level, 0.5, 0.9))
    share = min(1.0, max(-0.5, (outer - radius) / (outer - inner)))
    return np.asarray(np.asarray(sigma_factor_50, dtype=np.float64) ** share)


def radius_squared(level: float) -> float:
    """Squared Mahalanobis radius of the ellipse that holds the share ``level`` of a Gaussian."""
    return float(-2.0 * np.log(1.0 - level))


def nees(mean: Array, weight: Array, covariance: Array, truth: Array) -> Array:
    """[..., H] normalised estimation error squared of the top mode, unmasked.

    The error weighted by the inverse covariance, e' C^-1 e. Of a Gaussian with the right
    covariance it has a chi-square distribution of two degrees of freedom, so its average is 2:
    a larger one means that the ellipses are too small, a smaller one that they are too large.
    Where the heaviest mode is not the one that happens, its average is more than 2 although the
    mixture is right.
    """
    best = np.argmax(weight, axis=-1)[..., None, None, None]
    chosen = np.take_along_axis(covariance, best[..., None], axis=-4).squeeze(-4)
    squared, _ = mahalanobis(truth - top_mode(mean, weight), chosen)
    return squared


def mixture_nees(mean: Array, weight: Array, covariance: Array, truth: Array) -> Array:
    """[..., H] NEES of the whole mixture, by its overall mean and covariance, unmasked.

    The covariance of a mixture is the average of the modes' covariances and of the spread of
    their means. A mixture that is the true distribution has an average of 2, whatever its shape.
    """
    w = weight[..., None, None].astype(np.float64)
    middle = (w * mean).sum(axis=-3)
    apart = mean - middle[..., None, :, :]
    spread = covariance + apart[..., :, None] * apart[..., None, :]
    squared, _ = mahalanobis(truth - middle, (w[..., None] * spread).sum(axis=-4))
    return squared


def nll(mean: Array, weight: Array, covariance: Array, truth: Array) -> Array:
    """[..., H] negative log-likelihood of the position under the mixture (nats), unmasked."""
    squared, log_determinant = mahalanobis(truth[..., None, :, :] - mean, covariance)
    with np.errstate(divide="ignore"):
        log_weight = np.log(weight)
    return mixture_nll(log_weight, squared, log_determinant)


def mixture_nll(log_weight: Array, squared: Array, log_determinant: Array) -> Array:
    """[..., H] negative log-likelihood under a mixture (nats).

    Args:
        log_weight: [..., M] logarithms of the weights.
        squared: [..., M, H] squared Mahalanobis distances of the truth from the modes.
        log_determinant: [..., M, H] of the covariances.
    """
    log_component = -0.5 * (squared + log_determinant) - np.log(2.0 * np.pi)
    total = log_weight[..., None] + log_component  # [..., M, H]
    largest = np.max(total, axis=-2, keepdims=True)
    summed = np.log(np.sum(np.exp(total - largest), axis=-2))
    return -(largest.squeeze(-2) + summed)


def mahalanobis(difference: Array, covariance: Array) -> tuple[Array, Array]:
    """Squared Mahalanobis distance and log-determinant of 2x2 covariances, in float64."""
    d = difference.astype(np.float64)
    c = covariance.astype(np.float64)
    a, b, e = c[..., 0, 0], c[..., 0, 1], c[..., 1, 1]
    determinant = a * e - b * b
    x, y = d[..., 0], d[..., 1]
    with np.errstate(invalid="ignore", divide="ignore"):
        squared = (e * x * x - 2.0 * b * x * y + a * y * y) / determinant
        return squared, np.log(determinant)


def _distance(a: Array, b: Array) -> Array:
    return np.linalg.norm(a - b, axis=-1)


def over_steps(values: Array, mask: Mask) -> Array:
    """[...] mean of ``values`` [..., H] where ``mask``, NaN where no step is observed."""
    count = mask.sum(axis=-1)
    total = np.where(mask, values, 0.0).sum(axis=-1)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def running_mean(values: Array, mask: Mask) -> Array:
    """[..., H] mean of ``values`` [..., H] where ``mask`` up to each step, NaN before any."""
    count = mask.cumsum(axis=-1)
    total = np.where(mask, values, 0.0).cumsum(axis=-1)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)
