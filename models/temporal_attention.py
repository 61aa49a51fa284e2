# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Temporal attention of the decoder over the encoder's states."""

from typing import Any

import torch
from torch import Tensor, nn


def presence_bias(valid: Tensor) -> Tensor:
    """[B, N, T] zero where the agent was seen, minus infinity elsewhere (design D2).

    An agent that was never seen may look at the last step, so that its (unused) output is finite.
    """
    never = ~valid.any(dim=-1, keepdim=True)
    last = torch.zeros_like(valid)
    last[..., -1:] = never
    bias = torch.zeros(valid.shape, device=valid.device)
    return bias.masked_fill(~(valid | last), float("-inf"))


def weighted_sum(weight: Tensor, encoded: Tensor) -> Tensor:
    """[B, N, D] of weights [B, N, T] and values [B, N, T, D]."""
    return torch.matmul(weight.unsqueeze(-2), encoded).squeeze(-2)


class WeightedSum(torch.autograd.Function):
    """:func:`weighted_sum`; autograd's many tiny outer products are ten times slower."""

    @staticmethod
    def forward(ctx: Any, weight: Tensor, encoded: Tensor) -> Tensor:
        """See :func:`weighted_sum`."""
        ctx.save_for_backward(weight, encoded)
        return weighted_sum(weight, encoded)

    @staticmethod
    def backward(ctx: Any, *grads: Tensor) -> tuple[Tensor, Tensor]:
        """Gradients of both."""
        weight, encoded = ctx.saved_tensors
        grad = grads[0].to(encoded.dtype)  # autocast narrows the product's result
        of_weight = torch.matmul(encoded, grad.unsqueeze(-1)).squeeze(-1)
        return of_weight, weight.unsqueeze(-1) * grad.unsqueeze(-2)


class TemporalAttention(nn.Module):
    """Weights of the history steps from the decoder's state and the embedded states.

    Args:
        hidden: D.
        history_steps: T.
    """

    def __init__(self, hidden: int, history_steps: int):
        super().__init__()
        self.score = nn.Linear(2 * hidden, history_steps)  # W_alpha, b_alpha

    def forward(self, h: Tensor, embedded: Tensor, encoded: Tensor, bias: Tensor) -> Tensor:
        """The summary s [B, N, D] of what was encoded (eq. att_sum).

        Args:
            h: [B, N, D] decoder state.
            embedded: [B, N, D] embedded agent states.
            encoded: [B, N, T, D] encoder states.
            bias: [B, N, T] of :func:`presence_bias`.
        """
        weight = torch.softmax(self.score(torch.cat((h, embedded), dim=-1)) + bias, dim=-1)
        if torch.jit.is_scripting() or weight.dtype != encoded.dtype:
            return weighted_sum(weight, encoded)
        return WeightedSum.apply(weight, encoded)
