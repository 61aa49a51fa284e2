# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""S-LSTM: the neighbours' states, summed in a grid, enter the LSTMs at every step."""

import torch
from torch import Tensor, nn

from models.baselines.baseline_config import GridConfig
from models.baselines.interaction import Interaction
from models.baselines.recurrent_predictor import RecurrentPredictor
from models.baselines.social_grid import Grid


class SocialPooling(Interaction):
    """A fully connected layer with ReLU on the social tensor.

    The tensor [cells, D] of an agent holds in each cell the sum of the states of the neighbours
    in it. It is never formed: sum and layer are linear, so every agent's contribution from each
    cell is computed first, and an agent adds up its neighbours' contributions.

    Args:
        config: the network's options.
    """

    def __init__(self, config: GridConfig):
        super().__init__()
        self.each_step = True
        self.size = config.embedding
        self.grid = Grid(config)
        self.contribution = nn.Linear(config.hidden, self.grid.cells * self.size, bias=False)
        self.bias = nn.Parameter(torch.zeros(self.size))

    def prepare(self, position: Tensor, direction: Tensor, present: Tensor) -> Tensor:
        """Return [B N, N] rows of the contributions to be added up; the last row is zero."""
        cell = self.grid(position, direction, present)
        return self.grid.rows_of(cell, owner=False).flatten(0, 1)

    def forward(self, h: Tensor, links: Tensor) -> Tensor:
        """Return [B, N, size] of states [B, N, D] and the rows of :meth:`prepare`."""
        rows = self.contribution(h).view(-1, self.size)
        rows = torch.cat((rows, torch.zeros_like(rows[:1])))
        gathered = rows.index_select(0, links.flatten()).view(h.size(0), h.size(1), -1, self.size)
        return torch.relu(gathered.sum(dim=2) + self.bias)


class SocialLSTM(RecurrentPredictor):
    """LSTM encoder and decoder with social pooling.

    Over the horizon the cells are those of the last known positions, because the modes would put a
    neighbour into several (as decision 4 in docs/design.md for MTP-GO's graph).
    """

    def __init__(self, config: GridConfig):
        super().__init__(config, SocialPooling(config))
