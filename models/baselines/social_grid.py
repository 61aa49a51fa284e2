# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The grid of the social poolings: in which cell around an agent each neighbour is."""

import torch
from torch import Tensor, nn

from models.baselines.baseline_config import GridConfig
from models.own_frame.agent_frames import to_own


class Grid(nn.Module):
    """Cells around each agent, rows along its heading, the agent itself in the middle.

    Args:
        config: the network's options.

    Attributes:
        cells: rows times columns.
    """

    def __init__(self, config: GridConfig):
        super().__init__()
        self.rows = config.rows
        self.columns = config.columns
        self.cells = config.rows * config.columns
        self.length_m = config.cell_length_m
        self.width_m = config.cell_width_m

    def forward(self, position: Tensor, direction: Tensor, present: Tensor) -> Tensor:
        """Return [B, N, N] the cell of agent j (last) around agent i, ``cells`` if it is in none.

        Cell (row, column) has the number row * columns + column; row 0 is the rearmost, column 0
        the rightmost. No agent is in a cell of its own grid, and absent ones are in none.

        Args:
            position: [B, N, 2] in the scene frame (m).
            direction: [B, N, 2] cosine and sine of the agents' headings.
            present: [B, N].
        """
        offset = position.unsqueeze(1) - position.unsqueeze(2)  # from i to j
        along, across = to_own(offset, direction.unsqueeze(2).expand_as(offset)).unbind(-1)
        row = torch.floor(along / self.length_m + 0.5 * self.rows)
        column = torch.floor(across / self.width_m + 0.5 * self.columns)
        inside = (row >= 0) & (row < self.rows) & (column >= 0) & (column < self.columns)
        other = ~torch.eye(present.size(1), dtype=torch.bool, device=present.device)
        inside = inside & present.unsqueeze(1) & present.unsqueeze(2) & other
        cell = row * self.columns + column
        return torch.where(inside, cell, torch.full_like(cell, float(self.cells))).long()

    def rows_of(self, cell: Tensor, owner: bool) -> Tensor:
        """Return [B, N, N] the row of (agent, cell) in a table of B N agents times ``cells`` rows.

        An agent in no cell gets the number after the last row.

        Args:
            cell: [B, N, N] of :meth:`forward`.
            owner: the agent is the grid's owner i, else its neighbour j.
        """
        count = cell.size(0) * cell.size(1)
        agent = torch.arange(count, device=cell.device).view(cell.size(0), cell.size(1))
        agent = agent.unsqueeze(2) if owner else agent.unsqueeze(1)
        none = torch.full_like(cell, count * self.cells)
        return torch.where(cell < self.cells, agent * self.cells + cell, none)
