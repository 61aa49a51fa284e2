# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""GCN, the graph convolution of Kipf and Welling (eq. 9)."""

import torch
from torch import Tensor, nn

from models.gnn_layers.gnn_layer import GNNLayer


class GCN(GNNLayer):
    """b + sum over neighbours and self of e_ij / sqrt(d_i d_j) W_2 h_j (GCN, eq. 9).

    The degree is d_i = 1 + sum of e_ij over the neighbours; the own loop weighs 1, as its kernel
    gives.
    """

    def __init__(self, size_in: int, size_out: int):
        super().__init__()
        self.linear = nn.Linear(size_in, size_out)  # W_2, b

    def prepare(self, weight: Tensor, link: Tensor) -> tuple[Tensor, Tensor]:
        """Return the normalised adjacency [L, N, N], twice."""
        adjacency = weight * link
        scale = adjacency.sum(-1).rsqrt()
        normalised = adjacency * scale.unsqueeze(-1) * scale.unsqueeze(-2)
        return normalised, normalised

    def forward(self, x: Tensor, edges: tuple[Tensor, Tensor]) -> Tensor:
        """See :meth:`GNNLayer.forward`."""
        return self.linear(torch.matmul(edges[0], x))
