# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Huber losses of the mixture that are added to the objective of any network; not in the paper."""

from __future__ import annotations

from dataclasses import dataclass

from torch import Tensor

from mtpgo_training.training.losses.ewta_loss import huber_per_mode


@dataclass(frozen=True)
class HuberTerms:
    """The sum of the Huber losses that are added to an objective.

    Attributes:
        delta: error at which they turn from quadratic to linear (m and m/s).
        mean_weight: weight of :func:`expected_huber_loss`; 0 leaves it out.
        heaviest_weight: weight of :func:`heaviest_huber_loss`; 0 leaves it out.
    """

    delta: float = 1.0
    mean_weight: float = 0.0
    heaviest_weight: float = 0.0

    def __call__(self, log_weight: Tensor, mean: Tensor, target: Tensor, mask: Tensor) -> Tensor:
        """Return the sum, a scalar; arguments as in :func:`expected_huber_loss`."""
        loss = mean.new_zeros(())
        given = (log_weight, mean, target, mask, self.delta)
        if self.mean_weight > 0.0:
            loss = loss + self.mean_weight * expected_huber_loss(*given)
        if self.heaviest_weight > 0.0:
            loss = loss + self.heaviest_weight * heaviest_huber_loss(*given)
        return loss


NO_TERMS = HuberTerms()
"""The published objectives alone."""


def expected_huber_loss(
    log_weight: Tensor, mean: Tensor, target: Tensor, mask: Tensor, huber_delta: float = 1.0
) -> Tensor:
    """Return the Huber loss of the components averaged with their mixture weights, a scalar.

    Not in the paper. The likelihood's gradient with respect to a mean is divided by the variance,
    so agents with a certain future dominate it and uncertain ones hardly count, and nothing in it
    prefers that the heaviest component is near the truth, which is what ADE measures. This term
    does.

    Args:
        log_weight: [B, N, M] log mixture weights.
        mean: [B, N, M, H, S] predicted states.
        target: [B, N, H, S] observed states; any finite value where not observed.
        mask: [B, N, H] weight of each step, 0 where not observed.
        huber_delta: error at which the loss turns from quadratic to linear (m and m/s).
    """
    loss = huber_per_mode(mean, target, mask, huber_delta)
    return (log_weight.exp() * loss).sum() / mask.sum().clamp(min=1e-6)


def heaviest_huber_loss(
    log_weight: Tensor, mean: Tensor, target: Tensor, mask: Tensor, huber_delta: float = 1.0
) -> Tensor:
    """Return the Huber loss of the component with the largest weight, a scalar.

    Not in the paper. The heaviest component is what most consumers take for the prediction.
    :func:`expected_huber_loss` draws all components to the middle in proportion to their weights;
    this term draws the heaviest alone, and the others may be distinct futures.

    Args:
        log_weight: [B, N, M] log mixture weights; only their order matters.
        mean: [B, N, M, H, S] predicted states.
        target: [B, N, H, S] observed states; any finite value where not observed.
        mask: [B, N, H] weight of each step, 0 where not observed.
        huber_delta: error at which the loss turns from quadratic to linear (m and m/s).
    """
    heaviest = log_weight.detach().argmax(dim=-1)[..., None, None, None]
    path = mean.gather(2, heaviest.expand(-1, -1, 1, *mean.shape[3:]))
    loss = huber_per_mode(path, target, mask, huber_delta)
    return loss.sum() / mask.sum().clamp(min=1e-6)
