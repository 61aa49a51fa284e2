# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""GAT+, attention and a separate matrix for the receiving agent (eq. 12)."""

from torch import Tensor, nn

from models.gnn_layers.gat import GAT


class GATPlus(GAT):
    """b + W_1 h_i + sum over neighbours and self of alpha_ij W_2 h_j (GAT+, eq. 12).

    Args:
        size_in: see :class:`GAT`, also for the others.
        size_out: output channels.
        heads: independent attentions.
        tied: whether value and key share a matrix.
    """

    def __init__(self, size_in: int, size_out: int, heads: int = 1, tied: bool = True):
        super().__init__(size_in, size_out, heads, tied)
        self.centre = nn.Linear(size_in, size_out, bias=False)  # W_1

    def forward(self, x: Tensor, edges: tuple[Tensor, Tensor]) -> Tensor:
        """See :meth:`GNNLayer.forward`."""
        return self.attend(x, edges) + nn.functional.linear(x, self.centre.weight, self.bias)
