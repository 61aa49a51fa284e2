# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The evolving winner-takes-all (EWTA) loss, eqs. (28) and (29) of the paper.

The paper sums over the horizon. Here the loss is by default an average over the observed
agent-steps, weighted by ``mask``, so that its value does not depend on how many futures of a batch
are known; ``summed`` is the paper's sum, averaged over the agents.
"""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn.functional import huber_loss


def ewta_loss(
    mean: Tensor,
    target: Tensor,
    mask: Tensor,
    winners: int,
    huber_delta: float = 1.0,
    *,
    summed: bool = False,
) -> Tensor:
    """Return the EWTA loss with the Huber loss as distance, a scalar.

    The K components with the smallest loss over an agent's observed horizon are its winners; only
    they receive a gradient. The mean over the winners is taken, so that shrinking K does not
    change the scale of the loss; ``summed`` is the sum over winners and steps, eq. (28) itself.

    Args:
        mean: [B, N, M, H, S] predicted states.
        target: [B, N, H, S] observed states; any finite value where not observed.
        mask: [B, N, H] weight of each step, 0 where not observed.
        winners: K, 1 to M.
        huber_delta: error at which the loss turns from quadratic to linear (m and m/s).
        summed: sum over winners and steps, averaged over the observed agents.
    """
    loss = huber_per_mode(mean, target, mask, huber_delta)
    best = torch.topk(loss, winners, dim=-1, largest=False).values
    if summed:
        return best.sum() / observed_agents(mask).clamp(min=1.0)
    return best.mean(dim=-1).sum() / mask.sum().clamp(min=1e-6)


def observed_agents(mask: Tensor) -> Tensor:
    """Return the number of agents with an observed step, of weights [B, N, H]."""
    return (mask > 0.0).any(dim=-1).sum().to(mask.dtype)


def mean_distance(mean: Tensor, target: Tensor, mask: Tensor) -> Tensor:
    """Return [B, N, M] mean distances of modes from the observed truth (m).

    Args:
        mean: [B, N, M, H, 2] predicted positions.
        target: [B, N, H, 2] observed positions; any finite value where not observed.
        mask: [B, N, H] weight of each step, 0 where not observed.
    """
    known = (mask > 0.0).unsqueeze(2)
    offset = torch.where(known.unsqueeze(-1), target.unsqueeze(2) - mean, 0.0)
    distance = torch.linalg.vector_norm(offset, dim=-1).sum(dim=-1)
    return distance / known.sum(dim=-1).clamp(min=1)


def huber_per_mode(mean: Tensor, target: Tensor, mask: Tensor, huber_delta: float) -> Tensor:
    """Return [B, N, M] the Huber loss of each mode, summed over steps and states.

    Args:
        mean: [B, N, M, H, S] predicted states.
        target: [B, N, H, S] observed states; any finite value where not observed.
        mask: [B, N, H] weight of each step, 0 where not observed.
        huber_delta: error at which the loss turns from quadratic to linear (m and m/s).
    """
    error = huber_loss(
        mean, target.unsqueeze(2).expand_as(mean), reduction="none", delta=huber_delta
    ).sum(dim=-1)  # [B, N, M, H]
    return (error * mask.unsqueeze(2)).sum(dim=-1)
