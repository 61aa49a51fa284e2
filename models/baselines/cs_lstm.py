# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""CS-LSTM: convolutions over the grid of the neighbours' encoded histories."""

import torch
from torch import Tensor, nn
from torch.nn.functional import leaky_relu

from models.baselines.baseline_config import GridConfig
from models.baselines.interaction import Interaction
from models.baselines.recurrent_predictor import RecurrentPredictor
from models.baselines.social_grid import Grid

CHANNELS = 16
"""Channels of the second convolution, as published; the first has D."""


class ConvolutionalPooling(Interaction):
    """Two convolutions and max-pooling on the social tensor.

    A 3 x 3 convolution, a 3 x 1 convolution (three rows), and max-pooling over pairs of rows.
    Agents in the same cell are summed.

    Args:
        config: the network's options.
    """

    def __init__(self, config: GridConfig):
        super().__init__()
        self.each_step = False
        self.grid = Grid(config)
        self.size = CHANNELS * ((config.rows - 3) // 2) * (config.columns - 2)
        self.wide = nn.Conv2d(config.hidden, config.hidden, 3)
        self.tall = nn.Conv2d(config.hidden, CHANNELS, (3, 1))
        self.pool = nn.MaxPool2d((2, 1), ceil_mode=True)

    def prepare(self, position: Tensor, direction: Tensor, present: Tensor) -> Tensor:
        """Return [B, N, N] the row of all tensors to which agent j adds; the last is unused."""
        cell = self.grid(position, direction, present)
        return self.grid.rows_of(cell, owner=True)

    def tensor(self, h: Tensor, links: Tensor) -> Tensor:
        """Return [B N, D, rows, columns] the social tensor of each agent."""
        agents, hidden = links.size(0) * links.size(1), h.size(2)
        states = h.unsqueeze(1).expand(-1, h.size(1), -1, -1).flatten(0, 2)  # [B N N, D]
        rows = torch.zeros(agents * self.grid.cells + 1, hidden, dtype=h.dtype, device=h.device)
        rows = rows.index_add(0, links.flatten(), states)[:-1]
        grid = rows.view(agents, self.grid.rows, self.grid.columns, hidden)
        return grid.permute(0, 3, 1, 2)

    def forward(self, h: Tensor, links: Tensor) -> Tensor:
        """Return [B, N, size] of states [B, N, D] and the rows of :meth:`prepare`."""
        seen = leaky_relu(self.wide(self.tensor(h, links)), 0.1)
        seen = self.pool(leaky_relu(self.tall(seen), 0.1))
        return seen.flatten(1).view(h.size(0), h.size(1), -1)


class ConvolutionalSocialLSTM(RecurrentPredictor):
    """LSTM encoder and decoder with convolutional social pooling."""

    def __init__(self, config: GridConfig):
        super().__init__(config, ConvolutionalPooling(config))
