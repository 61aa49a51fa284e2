# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""GraphConv, the layer of weighted means (eq. 8)."""

import torch
from torch import Tensor, nn

from models.gnn_layers.gnn_layer import GNNLayer


class GraphConv(GNNLayer):
    """b + W_1 h_i + mean over neighbours j of e_ij W_2 h_j (GraphConv, eq. 8).

    The mean is over the others, not over the agent itself; an agent alone has none.
    """

    def __init__(self, size_in: int, size_out: int):
        super().__init__()
        self.centre = nn.Linear(size_in, size_out)  # W_1, b
        self.neighbour = nn.Linear(size_in, size_out, bias=False)  # W_2

    def prepare(self, weight: Tensor, link: Tensor) -> tuple[Tensor, Tensor]:
        """Return the averaging matrix [L, N, N], twice."""
        own = torch.eye(link.size(-1), dtype=torch.bool, device=link.device)
        other = link & ~own
        mean = weight * other / other.sum(-1, keepdim=True).clamp(min=1)
        return mean, mean

    def forward(self, x: Tensor, edges: tuple[Tensor, Tensor]) -> Tensor:
        """See :meth:`GNNLayer.forward`."""
        return self.centre(x) + self.neighbour(torch.matmul(edges[0], x))
