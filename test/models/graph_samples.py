# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Graphs for the tests of the GNN layers, as edge lists and dense."""

import torch
from torch_geometric.utils import to_dense_batch

from models.gnn_layers.interaction_graph import GaussianKernel, complete_graph, squared_distances

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


def same(got, want):
    torch.testing.assert_close(got, want, rtol=1e-10, atol=1e-10)
