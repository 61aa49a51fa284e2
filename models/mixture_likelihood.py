# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Likelihood of the Gaussian mixture (eq. 26 and 27), in closed form."""

import math

import torch
from torch import Tensor

PIVOT = 1e-7
"""Least share of a variance that is left after conditioning on the components before it.

Chosen: float32's rounding, below which a Cholesky pivot could become negative.
"""


def gaussian_log_prob(mean: Tensor, covariance: Tensor, target: Tensor) -> Tensor:
    """Return [...] the log density of Gaussians, by a Cholesky factorisation over the batch.

    Args:
        mean: [..., S].
        covariance: [..., S, S]; only the lower triangle is read.
        target: [..., S], broadcast against the mean.
    """
    size = mean.size(-1)
    offset = (target - mean).unbind(-1)
    # Unbound, not indexed: the gradient of an index fills the whole array with zeros.
    entries = covariance.flatten(-2).unbind(-1)
    whitened: list[Tensor] = []
    factor: list[list[Tensor]] = []
    result = torch.full((), -0.5 * size * math.log(2.0 * math.pi), device=mean.device)
    for i in range(size):
        row: list[Tensor] = []
        rest = offset[i]
        variance = entries[i * size + i]
        left = variance
        for j in range(i):
            entry = entries[i * size + j]
            for k in range(j):
                entry = entry - row[k] * factor[j][k]
            entry = entry / factor[j][j]
            row.append(entry)
            rest = rest - entry * whitened[j]
            left = left - entry * entry
        pivot = torch.sqrt(torch.maximum(left, PIVOT * variance))
        row.append(pivot)
        factor.append(row)
        whitened.append(rest / pivot)
        result = result - torch.log(pivot) - 0.5 * whitened[i] * whitened[i]
    return result


def mode_log_prob(mean: Tensor, covariance: Tensor, target: Tensor, mask: Tensor) -> Tensor:
    """Return [B, N, M, H] the log density that each mode gives to each future state.

    Args:
        mean: [B, N, M, H, S].
        covariance: [B, N, M, H, S, S].
        target: [B, N, H, S] (or more columns, the first S count); any value where masked.
        mask: [B, N, H] true where the target is known; elsewhere a value without meaning, of
            which no gradient can overflow.
    """
    target = target[..., : mean.size(-1)].unsqueeze(2)
    # Where the truth is unknown the mean replaces it, so that no gradient can overflow.
    target = torch.where(mask[:, :, None, :, None], target, mean.detach())
    return gaussian_log_prob(mean, covariance, target)


def mixture_nll(
    log_weight: Tensor, mean: Tensor, covariance: Tensor, target: Tensor, mask: Tensor
) -> Tensor:
    """Return [B, N, H] the negative log-likelihood of each future state, zero where masked.

    The summands of the NLL loss, eq. 27: -log sum_j pi_j N(x_k | x_k^j, P_k^j).

    Args:
        log_weight: [B, N, M] log mixture weights.
        mean: [B, N, M, H, S].
        covariance: [B, N, M, H, S, S].
        target: [B, N, H, S] (or more columns, the first S count); any value where masked.
        mask: [B, N, H] true where the target is known.
    """
    log_prob = log_weight.unsqueeze(-1) + mode_log_prob(mean, covariance, target, mask)
    nll = -torch.logsumexp(log_prob, dim=2)
    return torch.where(mask, nll, torch.zeros_like(nll))


def position_nll(
    log_weight: Tensor, mean: Tensor, covariance: Tensor, target: Tensor, mask: Tensor
) -> Tensor:
    """Return [B, N, H] :func:`mixture_nll` of the position alone (nats, densities per m^2)."""
    return mixture_nll(log_weight, mean[..., :2], covariance[..., :2, :2], target[..., :2], mask)
