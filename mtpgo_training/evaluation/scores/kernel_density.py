# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Kernel density estimates of the likelihood from samples, as Trajectron++ is scored.

A sampled prediction has no density, so Trajectron++ is scored by Gaussian kernels around its
samples at each step (Salzmann et al., ECCV 2020, Sec. 5). The paper of MTP-GO prints these values
in italics and shows that they cannot be compared with analytic ones: the same mixture gets other
values by samples than by its density. Hence both can be computed here, for every mixture.
"""

from __future__ import annotations

import numpy as np

from mtpgo_core.quality.metrics import Array, Mask, nll, over_steps

SAMPLES = 2000
"""Samples of a prediction (Salzmann et al. draw as many for this score)."""

LEAST_LOG_DENSITY = -20.0
"""A truth that the samples do not reach has no less (nats), as in the published evaluation."""

LEAST_DEVIATION_M = 1e-3
"""Least deviation of the samples along any axis (m; chosen: a millimetre), so that samples on one
line or in one point have a density."""


def mixture_samples(
    mean: Array, weight: Array, covariance: Array, count: int, seed: int = 0
) -> Array:
    """Return [n, count, H, 2] samples of mixtures of trajectories (m).

    A sample keeps its mode over the horizon. Its steps share their standardised deviation: only
    the distribution at each step is meant, not that of differences between steps.

    Args:
        mean: [n, M, H, 2] (m).
        weight: [n, M], a sum of 1.
        covariance: [n, M, H, 2, 2] (m^2).
        count: samples of each agent.
        seed: of the random numbers; the same seed gives the same samples.
    """
    draw = np.random.default_rng(seed)
    n, modes, _, _ = mean.shape
    drawn = draw.random((n, count, 1))
    limits = np.cumsum(weight, axis=1)[:, None, : modes - 1]
    mode = (drawn >= limits).sum(axis=-1)  # [n, count]
    deviation = draw.standard_normal((n, count, 2))
    factor = np.linalg.cholesky(covariance.astype(np.float64))  # [n, M, H, 2, 2]
    agent = np.arange(n)[:, None]
    return mean[agent, mode] + np.einsum("nchij,ncj->nchi", factor[agent, mode], deviation)


def kernel_log_density(samples: Array, truth: Array) -> Array:
    """Return [n, H] the log density of truths under kernel estimates (nats, densities per m^2).

    Gaussian kernels whose covariance is that of the samples times Scott's factor
    count^(-1/6), squared: the default of ``scipy.stats.gaussian_kde`` in two dimensions.

    Args:
        samples: [n, count, H, 2] (m), at least two.
        truth: [n, H, 2] (m).
    """
    count = samples.shape[1]
    offset = samples - samples.mean(axis=1, keepdims=True)
    spread = np.einsum("nchi,nchj->nhij", offset, offset) / (count - 1)
    spread = spread + LEAST_DEVIATION_M**2 * np.eye(2)
    kernel = spread[:, None] * count ** (-2.0 / 6.0)  # [n, 1, H, 2, 2]
    weight = np.full(samples.shape[:2], 1.0 / count)
    return np.asarray(np.maximum(-nll(samples, weight, kernel, truth), LEAST_LOG_DENSITY))


def kernel_nll(
    mean: Array,
    weight: Array,
    covariance: Array,
    truth: Array,
    mask: Mask,
    samples: int = SAMPLES,
) -> tuple[Array, Array]:
    """Return [n] average and final negative log-likelihood by kernels around samples (nats).

    Args:
        mean: [n, M, H, 2] (m).
        weight: [n, M].
        covariance: [n, M, H, 2, 2] (m^2).
        truth: [n, H, 2] (m).
        mask: [n, H] observed; NaN without any step, and in the final one without the last.
        samples: drawn for each agent.
    """
    values = np.full(mask.shape, np.nan)
    for i in np.flatnonzero(mask.any(axis=1)):  # one by one: samples of many would fill memory
        drawn = mixture_samples(
            mean[i : i + 1], weight[i : i + 1], covariance[i : i + 1], samples, seed=int(i)
        )
        values[i] = -kernel_log_density(drawn, np.nan_to_num(truth[i : i + 1]))[0]
    return over_steps(values, mask), np.where(mask[:, -1], values[:, -1], np.nan)
