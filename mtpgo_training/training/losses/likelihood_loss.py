# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The negative log-likelihood, eq. (27) of the paper, and likelihoods to use in its place.

The paper sums over the horizon. Here the losses are averages over the observed agent-steps,
weighted by ``mask``, so that their value does not depend on how many futures of a batch are known;
:func:`summed_negative_log_likelihood` is the paper's sum, averaged over the agents.
"""

from __future__ import annotations

import torch
from torch import Tensor

from models.gaussian_mixture import mixture_nll, mode_log_prob
from mtpgo_training.training.losses.ewta_loss import mean_distance, observed_agents

NEAREST_SCALE_M = 0.2
"""Difference of two modes' mean errors at which the nearer one is e times as likely to be taken
for the nearest (m); chosen: nearer modes cannot be told apart by a tracker."""


def negative_log_likelihood(
    log_weight: Tensor, mean: Tensor, covariance: Tensor, target: Tensor, mask: Tensor
) -> Tensor:
    """Return the negative log-likelihood of the full state, a scalar (nats per step).

    Args:
        log_weight: [B, N, M] log mixture weights.
        mean: [B, N, M, H, S].
        covariance: [B, N, M, H, S, S].
        target: [B, N, H, S] observed states; any finite value where not observed.
        mask: [B, N, H] weight of each step, 0 where not observed.
    """
    value = mixture_nll(log_weight, mean, covariance, target, mask > 0.0)  # [B, N, H]
    return (value * mask).sum() / mask.sum().clamp(min=1e-6)


def summed_negative_log_likelihood(
    log_weight: Tensor, mean: Tensor, covariance: Tensor, target: Tensor, mask: Tensor
) -> Tensor:
    """Return the negative log-likelihood summed over the steps (eq. 27), averaged over the agents.

    Args:
        log_weight: see :func:`negative_log_likelihood`, like the others.
        mean: [B, N, M, H, S].
        covariance: [B, N, M, H, S, S].
        target: [B, N, H, S].
        mask: [B, N, H].
    """
    value = mixture_nll(log_weight, mean, covariance, target, mask > 0.0)
    return (value * mask).sum() / observed_agents(mask).clamp(min=1.0)


def trajectory_likelihood_loss(
    log_weight: Tensor,
    mean: Tensor,
    covariance: Tensor,
    target: Tensor,
    mask: Tensor,
    correlated_steps: float = 1.0,
) -> Tensor:
    """Return the negative log-likelihood of whole trajectories, a scalar (nats per step).

    Not in the paper, whose mixture (eq. 27) may choose another mode at every step. Here one mode
    has to explain the whole trajectory: -log sum_j pi_j prod_k N(x_k | x_k^j, P_k^j), so that
    modes become distinct futures and weights their probabilities. Errors of consecutive steps are
    correlated: n steps count as n / ``correlated_steps`` independent ones, without which the
    nearest mode would take all of the responsibility.

    Args:
        log_weight: [B, N, M] log mixture weights.
        mean: [B, N, M, H, S].
        covariance: [B, N, M, H, S, S].
        target: [B, N, H, S] observed states; any finite value where not observed.
        mask: [B, N, H] weight of each step, 0 where not observed.
        correlated_steps: steps that count as one.
    """
    of_mode = trajectory_log_prob(mean, covariance, target, mask) / correlated_steps
    of_agent = -correlated_steps * torch.logsumexp(log_weight + of_mode, dim=-1)
    return _mean_of_steps(of_agent, mask)


def mode_likelihood_loss(
    log_weight: Tensor, mean: Tensor, covariance: Tensor, target: Tensor, mask: Tensor
) -> Tensor:
    """Return what makes each mode's ellipse and the weights honest on their own, a scalar.

    Not in the paper, and meant for a last stage that trains only the covariances and the weights
    (``optimisation.train_only``). In a mixture's likelihood a mode's covariance has to explain
    only the truths that this mode is responsible for, so the ellipse of the heaviest mode is far
    too small for all others. Here every mode is scored as if it were the prediction: the Gaussian
    negative log-likelihood of the position, averaged with the mixture weights. The weights
    themselves get the cross-entropy against the mode that was nearest, softened by
    ``NEAREST_SCALE_M``, so that they are probabilities of it.

    Args:
        log_weight: [B, N, M] log mixture weights.
        mean: [B, N, M, H, S].
        covariance: [B, N, M, H, S, S].
        target: [B, N, H, S] observed states; any finite value where not observed.
        mask: [B, N, H] weight of each step, 0 where not observed.
    """
    place = mean[..., :2]
    nll = -trajectory_log_prob(place, covariance[..., :2, :2], target, mask)
    distance = mean_distance(place.detach(), target[..., :2], mask)
    nearest = torch.softmax(-distance / NEAREST_SCALE_M, dim=-1)
    entropy = -(nearest * log_weight).sum(dim=-1) * (mask > 0.0).sum(dim=-1)
    return _mean_of_steps((log_weight.detach().exp() * nll).sum(dim=-1) + entropy, mask)


def trajectory_log_prob(mean: Tensor, covariance: Tensor, target: Tensor, mask: Tensor) -> Tensor:
    """Return [B, N, M] the log density of the observed steps of a trajectory under each mode.

    Args:
        mean: [B, N, M, H, S].
        covariance: [B, N, M, H, S, S].
        target: [B, N, H, S] or more columns, of which the first S count.
        mask: [B, N, H] weight of each step, 0 where not observed.
    """
    known = mask > 0.0
    log_prob = mode_log_prob(mean, covariance, target, known)
    return torch.where(known.unsqueeze(2), log_prob, 0.0).sum(dim=-1)


def _mean_of_steps(of_agent: Tensor, mask: Tensor) -> Tensor:
    """Return a loss [B, N], summed over the steps of each agent, as an average over the steps."""
    weight = mask.amax(dim=-1)  # all observed steps of an agent have the same
    return (of_agent * weight).sum() / mask.sum().clamp(min=1e-6)
