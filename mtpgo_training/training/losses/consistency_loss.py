# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The loss of modes that move from one instant to the next; not in the paper."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from torch import Tensor
from torch.nn.functional import huber_loss


@dataclass(frozen=True)
class ConsistencyTerm:
    """:func:`consistency_loss` as a term of an objective.

    Attributes:
        weight: of the term; 0 leaves it out.
        steps: steps of the horizon from a scene to the later one.
        delta: distance at which the loss turns from quadratic to linear (m).
    """

    weight: float = 0.0
    steps: int = 1
    delta: float = 1.0

    def __call__(
        self,
        log_weight: Tensor,
        mean: Tensor,
        later_log_weight: Tensor,
        later_mean: Tensor,
        fields: Mapping[str, Tensor],
    ) -> Tensor:
        """Return the weighted loss, a scalar.

        Args:
            log_weight: [B, N, M] log mixture weights of the earlier prediction.
            mean: [B, N, M, H, S] its states.
            later_log_weight: [B, N, M] log mixture weights of the later prediction.
            later_mean: [B, N, M, H, S] its states in the frame of the later scene.
            fields: a batch with those of :func:`mtpgo_training.scenes.pairs.scene_pair.paired`.
        """
        change = fields["later_change"][:, :, None, None]  # [B, N, 1, 1, 2, 3]
        x, y = later_mean[..., 0, None], later_mean[..., 1, None]
        # No matrix product: autocast would narrow it, to where places have a grid of half a metre.
        path = change[..., 0] * x + change[..., 1] * y + change[..., 2]
        loss = consistency_loss(
            0.5 * (log_weight.exp() + later_log_weight.exp()),
            mean[..., :2],
            path,
            fields["weight"],
            fields["later_both"],
            self.steps,
            self.delta,
        )
        return self.weight * loss


NO_CONSISTENCY = ConsistencyTerm()
"""The published objectives alone."""


def consistency_loss(
    weight: Tensor,
    path: Tensor,
    later_path: Tensor,
    mask: Tensor,
    both: Tensor,
    steps: int,
    huber_delta: float = 1.0,
) -> Tensor:
    """Return the Huber loss of the distance of two predictions of the same times, a scalar.

    Each mode is compared with itself, and the modes are averaged with their weights. The weights
    get no gradient: they would shift to the modes that move least, instead of to those that are
    likely.

    Args:
        weight: [B, N, M] mixture weights.
        path: [B, N, M, H, 2] predicted positions (m).
        later_path: [B, N, M, H, 2] those predicted later, in the same frame (m).
        mask: [B, N, H] weight of each step, 0 where not observed; like the other losses, this one
            is a sum over the observed steps, divided by the sum of ``mask``.
        both: [B, N] 1 for agents that have both predictions, else 0.
        steps: steps of the horizon between the two.
        huber_delta: distance at which the loss turns from quadratic to linear (m).
    """
    same_times = later_path[..., : later_path.shape[3] - steps, :]
    error = huber_loss(path[..., steps:, :], same_times, reduction="none", delta=huber_delta)
    seen = mask[..., steps:] * both[..., None]
    loss = (error.sum(dim=-1) * seen.unsqueeze(2)).sum(dim=-1)  # [B, N, M]
    return (weight.detach() * loss).sum() / mask.sum().clamp(min=1e-6)
