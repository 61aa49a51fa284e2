# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The interface of all GNN layers, and the layer without edges."""

from torch import Tensor, nn

Edges = tuple[Tensor, Tensor]
"""What a layer's ``prepare`` computes of a graph and its ``forward`` needs."""


class GNNLayer(nn.Module):
    """Base of all layers: what depends on the graph alone is computed once per graph.

    Row i of an [N, N] array is the receiving agent, column j the neighbour.
    """

    def prepare(self, weight: Tensor, link: Tensor) -> tuple[Tensor, Tensor]:
        """Return what :meth:`forward` needs of L graphs.

        Args:
            weight: [L, N, N] edge weights e (eq. 13).
            link: [L, N, N] true where there is an edge, the agents' own loops included.
        """
        raise NotImplementedError

    def forward(self, x: Tensor, edges: tuple[Tensor, Tensor]) -> Tensor:
        """Return [L, N, out] of node values [L, N, in] and the result of :meth:`prepare`."""
        raise NotImplementedError


class NodeOnly(GNNLayer):
    """W h_i + b, without edges: makes a graph GRU an ordinary GRU (GRU, eq. 5; GNN ablations)."""

    def __init__(self, size_in: int, size_out: int):
        super().__init__()
        self.linear = nn.Linear(size_in, size_out)

    def prepare(self, weight: Tensor, link: Tensor) -> tuple[Tensor, Tensor]:
        """Return the weights, which are not used."""
        return weight, weight

    def forward(self, x: Tensor, edges: tuple[Tensor, Tensor]) -> Tensor:
        """See :meth:`GNNLayer.forward`."""
        return self.linear(x)
