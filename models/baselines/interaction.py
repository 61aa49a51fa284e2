# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What an agent learns of its neighbours: the part in which the baselines differ."""

from typing import Any

import torch
from torch import Tensor, nn


class Interaction(nn.Module):
    """Base of all interactions.

    Attributes:
        size: channels of what an agent learns.
        each_step: whether both LSTMs are told at every step, else the decoder alone is, once, of
            the encoded histories.
    """

    size: int
    each_step: bool

    def prepare(self, position: Tensor, direction: Tensor, present: Tensor) -> Any:
        """Who are whose neighbours, in a form for :meth:`forward`.

        Args:
            position: [B, N, 2] in the scene frame (m).
            direction: [B, N, 2] cosine and sine of the agents' headings.
            present: [B, N]; an absent agent is nobody's neighbour and has none.
        """
        raise NotImplementedError

    def forward(self, h: Tensor, links: Any) -> Tensor:
        """[B, N, size] what each agent learns of the states h [B, N, D].

        Args:
            h: of the encoder, or of the decoder at a step of the horizon.
            links: of :meth:`prepare`.
        """
        raise NotImplementedError


class NoInteraction(Interaction):
    """Every agent for itself."""

    def __init__(self) -> None:
        super().__init__()
        self.size = 0
        self.each_step = False

    def prepare(self, position: Tensor, direction: Tensor, present: Tensor) -> Tensor:
        """Nothing is needed."""
        return present

    def forward(self, h: Tensor, links: Tensor) -> Tensor:
        """[B, N, 0]."""
        return torch.zeros(h.size(0), h.size(1), 0, dtype=h.dtype, device=h.device)
