# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Graphs for the tests of the GNN layers, as edge lists and dense."""

import torch
from torch_geometric.utils import to_dense_batch

from models.gnn_layers.interaction_graph import GaussianKernel, complete_graph, squared_distances
from models.graph_gru import GraphGRU

SIZE_IN, SIZE_OUT = 5, 7


class Graphs:
    """Graphs of several sizes, once as edge lists and once padded and dense."""

    def __init__(self, sizes=(1, 4, 6)):
        self.x = torch.randn(sum(sizes), SIZE_IN).double()
        self.position = 10.0 * torch.randn(sum(sizes), 2).double()
        self.batch = torch.repeat_interleave(torch.arange(len(sizes)), torch.tensor(sizes))
        self.dense_x, self.present = to_dense_batch(self.x, self.batch)
        self.dense_position, _ = to_dense_batch(self.position, self.batch)
        self.kernel = GaussianKernel(8.0).double()

    def edges(self, loops):
        same = self.batch.unsqueeze(0) == self.batch.unsqueeze(1)
        if not loops:
            same &= ~torch.eye(len(self.batch), dtype=torch.bool)
        edge_index = same.nonzero().t()
        distance = (self.position[edge_index[0]] - self.position[edge_index[1]]).norm(dim=1)
        return edge_index, self.kernel(distance.square()).detach()

    def run(self, layer):
        """Results of a dense layer in the edge lists' order."""
        weight = self.kernel(squared_distances(self.dense_position))
        edges = layer.prepare(weight, complete_graph(self.present))
        return layer(self.dense_x, edges)[self.present]


@torch.no_grad()
def torch_cell_of(cell: GraphGRU) -> torch.nn.GRUCell:
    """Return torch's GRU cell with the weights of a graph GRU of one layer without edges.

    Torch orders the gates r, z, candidate as well, and has a bias vector for either matrix.
    """
    of_f, of_h = cell.gnn_f.layers[0].linear, cell.gnn_h.layers[0].linear
    oracle = torch.nn.GRUCell(of_f.in_features, of_h.in_features).double()
    oracle.weight_ih.copy_(of_f.weight)
    oracle.bias_ih.copy_(of_f.bias + cell.bias)
    oracle.weight_hh.copy_(of_h.weight)
    oracle.bias_hh.copy_(of_h.bias)
    return oracle


def same(got, want):
    torch.testing.assert_close(got, want, rtol=1e-10, atol=1e-10)
