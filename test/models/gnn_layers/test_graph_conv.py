# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""GraphConv against torch_geometric's layer on the same weights."""

from graph_samples import SIZE_IN, SIZE_OUT, Graphs, same
from torch_geometric.nn import GraphConv

from models.gnn_layers.graph_conv import GraphConv as DenseGraphConv


def test_graphconv():
    graphs = Graphs()
    dense = DenseGraphConv(SIZE_IN, SIZE_OUT).double()
    oracle = GraphConv(SIZE_IN, SIZE_OUT, aggr="mean").double()
    oracle.lin_rel.weight.data = dense.neighbour.weight.data
    oracle.lin_rel.bias.data = dense.centre.bias.data
    oracle.lin_root.weight.data = dense.centre.weight.data
    same(graphs.run(dense), oracle(graphs.x, *graphs.edges(loops=False)))
