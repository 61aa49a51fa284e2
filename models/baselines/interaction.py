# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Neighbour features: the part in which the baselines differ."""

from typing import Any

import torch
from torch import Tensor, nn


class Interaction(nn.Module):
    """Base of all interactions.

    Attributes:
        size: channels of the neighbour features.
        each_step: true: they enter both LSTMs at every step; false: they are computed once, from
            the encoded histories, and enter the decoder alone.
    """

    size: int
    each_step: bool

    def prepare(self, position: Tensor, direction: Tensor, present: Tensor) -> Any:
        """Return who is whose neighbour, in a form for :meth:`forward`.

        Args:
            position: [B, N, 2] in the scene frame (m).
            direction: [B, N, 2] cosine and sine of the agents' headings.
            present: [B, N]; an absent agent is no agent's neighbour and has none.
        """
        raise NotImplementedError

    def forward(self, h: Tensor, links: Any) -> Tensor:
        """Return [B, N, size] the neighbour features, from the states h [B, N, D].

        Args:
            h: state of the encoder, or of the decoder at a step of the horizon.
            links: result of :meth:`prepare`.
        """
        raise NotImplementedError


class NoInteraction(Interaction):
    """No neighbour features: every agent is predicted alone."""

    def __init__(self) -> None:
        super().__init__()
        self.size = 0
        self.each_step = False

    def prepare(self, position: Tensor, direction: Tensor, present: Tensor) -> Tensor:
        """Return the presence, which is not used."""
        return present

    def forward(self, h: Tensor, links: Tensor) -> Tensor:
        """Return [B, N, 0]."""
        return torch.zeros(h.size(0), h.size(1), 0, dtype=h.dtype, device=h.device)
