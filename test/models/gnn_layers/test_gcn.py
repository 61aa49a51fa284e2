# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""GCN against torch_geometric's layer on the same weights."""

from graph_samples import SIZE_IN, SIZE_OUT, Graphs, same
from torch_geometric.nn import GCNConv

from models.gnn_layers.gcn import GCN


def test_gcn():
    graphs = Graphs()
    dense = GCN(SIZE_IN, SIZE_OUT).double()
    oracle = GCNConv(SIZE_IN, SIZE_OUT).double()
    oracle.lin.weight.data = dense.linear.weight.data
    oracle.bias.data = dense.linear.bias.data
    same(graphs.run(dense), oracle(graphs.x, *graphs.edges(loops=False)))
