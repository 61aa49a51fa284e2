# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Temporal attention of the decoder over the encoder's states (eq. 14 and 15)."""

import torch
from torch import Tensor, nn

from models.kernels.weighted_sum import weighted_sum


def presence_bias(valid: Tensor) -> Tensor:
    """Return [B, N, T] zero where the agent was seen, minus infinity elsewhere.

    Added to the scores, it gives missing samples no weight (docs/design.md, decision 2). An agent
    that was never seen attends to the last step, so that its unused output is finite.
    """
    never = ~valid.any(dim=-1, keepdim=True)
    last = torch.zeros_like(valid)
    last[..., -1:] = never
    bias = torch.zeros(valid.shape, device=valid.device)
    return bias.masked_fill(~(valid | last), float("-inf"))


class TemporalAttention(nn.Module):
    """Weights of the history steps, from the decoder's state and the embedded agent states.

    Args:
        hidden: D.
        history_steps: T.
    """

    def __init__(self, hidden: int, history_steps: int):
        super().__init__()
        self.score = nn.Linear(2 * hidden, history_steps)  # W_alpha, b_alpha

    def forward(self, h: Tensor, embedded: Tensor, encoded: Tensor, bias: Tensor) -> Tensor:
        """Return the summary s [B, N, D] of the encoded history (eq. 15).

        Args:
            h: [B, N, D] decoder state.
            embedded: [B, N, D] embedded agent states.
            encoded: [B, N, T, D] encoder states.
            bias: [B, N, T] of :func:`presence_bias`.
        """
        score = self.score(torch.cat((h, embedded), dim=-1))  # q, eq. 14a
        weight = torch.softmax(score + bias, dim=-1)  # alpha, eq. 14b
        return weighted_sum(weight, encoded)
