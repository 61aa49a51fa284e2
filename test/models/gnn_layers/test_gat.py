# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""GAT and GAT+ against torch_geometric's GATv2 on the same weights, and by hand."""

import pytest
import torch
from graph_samples import SIZE_IN, SIZE_OUT, Graphs, same
from torch.nn.functional import leaky_relu
from torch_geometric.nn import GATv2Conv

from models.gnn_layers.gat import GAT
from models.gnn_layers.gat_plus import GATPlus
from models.gnn_layers.interaction_graph import squared_distances


def gatv2_of(dense):
    heads, size = dense.score.shape
    oracle = GATv2Conv(
        SIZE_IN, size, heads, concat=False, edge_dim=1, add_self_loops=False
    ).double()
    oracle.lin_l.weight.data, oracle.lin_r.weight.data = dense.packed.weight.data.chunk(2)
    oracle.lin_l.bias.data, oracle.lin_r.bias.data = dense.packed.bias.data.chunk(2)
    oracle.lin_edge.weight.data = dense.edge.data.reshape(-1, 1)
    oracle.att.data = dense.score.data.unsqueeze(0)
    oracle.bias.data = dense.bias.data
    return oracle


@pytest.mark.parametrize("heads", [1, 2, 3])
@pytest.mark.parametrize("kind", [GAT, GATPlus])
def test_gat(kind, heads):
    graphs = Graphs()
    dense = kind(SIZE_IN, SIZE_OUT, heads).double()
    torch.nn.init.normal_(dense.bias)
    edge_index, weight = graphs.edges(loops=True)
    want = gatv2_of(dense)(graphs.x, edge_index, weight.unsqueeze(1))
    if kind is GATPlus:
        want = want + dense.centre(graphs.x)
    same(graphs.run(dense), want)


@pytest.mark.parametrize("heads", [1, 2])
def test_untied_gat_by_hand(heads):
    graphs = Graphs(sizes=(4,))
    dense = GAT(SIZE_IN, SIZE_OUT, heads, tied=False).double()
    value, query, key = (
        part.reshape(4, heads, SIZE_OUT) for part in dense.packed(graphs.x).chunk(3, dim=1)
    )
    weight = graphs.kernel(squared_distances(graphs.position))
    want = torch.zeros(4, SIZE_OUT).double()
    for i in range(4):
        for h in range(heads):
            z = [query[i, h] + key[j, h] + weight[i, j] * dense.edge[h] for j in range(4)]
            score = torch.stack([dense.score[h] @ leaky_relu(row, 0.2) for row in z])
            want[i] += score.softmax(0) @ value[:, h] / heads
    same(graphs.run(dense), want + dense.bias)
