# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The region-based training of mmTransformer (Liu et al., CVPR 2021, Sec. 3.3)."""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import Tensor
from torch.nn.functional import one_hot

from models.baselines.transformers.mm_transformer import MMTransformer
from mtpgo_training.training.losses.ewta_loss import huber_per_mode, mean_distance
from mtpgo_training.training.losses.huber_terms import NO_TERMS, HuberTerms
from mtpgo_training.training.losses.likelihood_loss import negative_log_likelihood


def region_loss(
    model: MMTransformer,
    fields: Mapping[str, Tensor],
    *,
    progress: float,
    huber: HuberTerms = NO_TERMS,
) -> Tensor:
    """Return the sum of the regression, confidence, area and spread losses, a scalar.

    Regression: the Huber loss of the proposals of the region in which the true path ends, and of
    no others, so that every proposal keeps a region of its own. Confidence: see
    :func:`confidence_loss`. Spread, not in the publication: the likelihood of the truth under
    proposals and scores that are held, which trains the covariances alone.

    Where the end is not observed, the proposal nearest to what is observed stands for the region.

    Args:
        model: the network.
        fields: a batch from :func:`mtpgo_training.scenes.scene_dataset.dense`.
        progress: share of the training that is done; not used.
        huber: added to the objective, by default nothing, as in the publication; its delta is that
            of the regression, too.
    """
    target, mask = fields["target"][..., :2], fields["weight"]
    given = (fields["x"], fields["valid"])
    log_weight, mean, covariance = model.roll_out(
        *given,
        fields["static"],
        initial_covariance=None,
        with_covariance=True,
        teacher=None,
        teacher_valid=None,
    )
    error = huber_per_mode(mean, target, mask, huber.delta)  # [B, N, K]
    distance = mean_distance(mean.detach(), target, mask)
    complete = mask[..., -1:] > 0.0
    nearest = one_hot(distance.argmin(dim=-1), model.modes).bool()
    mine = torch.where(complete, model.in_region(*given, target), nearest)
    regression = (error * mine).sum(dim=-1) / mine.sum(dim=-1)
    weight = mask.amax(dim=-1)
    judged = torch.where(complete, mine, torch.ones_like(mine))
    confidence = (confidence_loss(log_weight, distance, judged) * weight).sum()
    spread = negative_log_likelihood(log_weight.detach(), mean.detach(), covariance, target, mask)
    steps = mask.sum().clamp(min=1e-6)
    added = huber(log_weight, mean, target, mask)
    return regression.sum() / steps + confidence / weight.sum().clamp(min=1e-6) + spread + added


def confidence_loss(log_weight: Tensor, distance: Tensor, mine: Tensor) -> Tensor:
    """Return [B, N] the confidence loss and the area loss of each agent (nats).

    Within the region the scores are drawn to softmax(-distance) by the Kullback-Leibler
    divergence; the scores of the whole region to 1 by the cross-entropy of the regions.

    Args:
        log_weight: [B, N, K] log scores.
        distance: [B, N, K] mean distance of each proposal from the truth (m).
        mine: [B, N, K] proposals of the region of the truth, at least one.
    """
    others = ~mine
    area = torch.logsumexp(log_weight.masked_fill(others, -torch.inf), dim=-1, keepdim=True)
    wanted = torch.log_softmax((-distance).masked_fill(others, -torch.inf), dim=-1)
    wanted = wanted.masked_fill(others, 0.0)
    divergence = wanted.exp() * (wanted - (log_weight - area)) * mine
    return divergence.sum(dim=-1) - area.squeeze(-1)
