# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The two losses of the paper: winner takes all, and the mixture's negative log-likelihood.

Both sum over the horizon in the paper. Here they are averages over the observed agent-steps,
weighted by ``mask``, so that the value does not depend on how many futures a batch knows.
"""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn.functional import huber_loss

from models.mixture_likelihood import mixture_nll


def ewta(
    mean: Tensor, target: Tensor, mask: Tensor, winners: int, huber_delta: float = 1.0
) -> Tensor:
    """Evolving winner takes all with the Huber loss (eq. EWTA), a scalar.

    The K components with the smallest loss over an agent's observed horizon are its winners; only
    they receive a gradient. The mean over the winners is taken, so that shrinking K does not
    change the loss's scale.

    Args:
        mean: [B, N, M, H, S] predicted states.
        target: [B, N, H, S] observed states; anything finite where not observed.
        mask: [B, N, H] weight of each step, 0 where not observed.
        winners: K, 1 to M.
        huber_delta: error at which the loss turns from quadratic to linear (m and m/s).
    """
    error = huber_loss(
        mean, target.unsqueeze(2).expand_as(mean), reduction="none", delta=huber_delta
    ).sum(dim=-1)  # [B, N, M, H]
    per_mode = (error * mask.unsqueeze(2)).sum(dim=-1)  # [B, N, M]
    best = torch.topk(per_mode, winners, dim=-1, largest=False).values
    return best.mean(dim=-1).sum() / mask.sum().clamp(min=1e-6)


def expected_huber(
    log_weight: Tensor, mean: Tensor, target: Tensor, mask: Tensor, huber_delta: float = 1.0
) -> Tensor:
    """The Huber loss of the components averaged with their mixture weights, a scalar.

    Not in the paper. The likelihood's gradient on a mean is divided by the variance, so a likely
    agent teaches much and an uncertain one next to nothing, and nothing in it prefers that the
    heaviest component be near the truth, which is what ADE measures. Beside the likelihood this
    term does.

    Args:
        log_weight: [B, N, M] log mixture weights.
        mean: [B, N, M, H, S] predicted states.
        target: [B, N, H, S] observed states; anything finite where not observed.
        mask: [B, N, H] weight of each step, 0 where not observed.
        huber_delta: error at which the loss turns from quadratic to linear (m and m/s).
    """
    error = huber_loss(
        mean, target.unsqueeze(2).expand_as(mean), reduction="none", delta=huber_delta
    ).sum(dim=-1)
    per_mode = (error * mask.unsqueeze(2)).sum(dim=-1)  # [B, N, M]
    return (log_weight.exp() * per_mode).sum() / mask.sum().clamp(min=1e-6)


def negative_log_likelihood(
    log_weight: Tensor, mean: Tensor, covariance: Tensor, target: Tensor, mask: Tensor
) -> Tensor:
    """NLL of the full state (eq. seq_loss, design D9), a scalar (nats a step).

    Args:
        log_weight: [B, N, M] log mixture weights.
        mean: [B, N, M, H, S].
        covariance: [B, N, M, H, S, S].
        target: [B, N, H, S] observed states; anything finite where not observed.
        mask: [B, N, H] weight of each step, 0 where not observed.
    """
    value = mixture_nll(log_weight, mean, covariance, target, mask > 0.0)  # [B, N, H]
    return (value * mask).sum() / mask.sum().clamp(min=1e-6)
