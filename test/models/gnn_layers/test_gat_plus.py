# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""GAT+ (eq. 12) by hand and next to GAT (eq. 11)."""

import torch
from graph_samples import SIZE_IN, SIZE_OUT, Graphs, same

from models.gnn_layers.gat import GAT
from models.gnn_layers.gat_plus import GATPlus


@torch.no_grad()
def test_equal_scores_average_the_neighbours_and_add_the_agents_own_part():
    """Without scores alpha is 1/2: b + W_1 h_i + (W_2 h_1 + W_2 h_2) / 2, with scalars."""
    layer = GATPlus(1, 1).double()
    layer.packed.weight.copy_(torch.tensor([[3.0], [0.7]]))  # W_2 as value and key, the query
    layer.packed.bias.zero_()
    layer.score.zero_()
    layer.centre.weight.fill_(10.0)  # W_1
    layer.bias.fill_(0.5)
    graph = torch.ones(1, 2, 2).double()
    x = torch.tensor([[[1.0], [5.0]]]).double()
    expected = torch.tensor([[[0.5 + 10.0 + 9.0], [0.5 + 50.0 + 9.0]]]).double()
    same(layer(x, layer.prepare(graph, graph > 0)), expected)


@torch.no_grad()
def test_with_w_1_at_zero_it_is_gat():
    graphs = Graphs()
    plus, gat = GATPlus(SIZE_IN, SIZE_OUT, 2).double(), GAT(SIZE_IN, SIZE_OUT, 2).double()
    plus.centre.weight.zero_()
    gat.load_state_dict({k: v for k, v in plus.state_dict().items() if "centre" not in k})
    same(graphs.run(plus), graphs.run(gat))


@torch.no_grad()
def test_the_own_part_of_an_agent_does_not_depend_on_its_neighbours():
    """What GAT+ adds to GAT is W_1 h_i: it is the same in a graph of one agent and of six."""
    graphs = Graphs(sizes=(1, 6))
    graphs.x[1] = graphs.x[0]  # the first agent of the second graph
    graphs.dense_x[1, 0] = graphs.x[0]
    layer = GATPlus(SIZE_IN, SIZE_OUT).double()
    with_own = graphs.run(layer)
    layer.centre.weight.zero_()
    own = with_own - graphs.run(layer)
    same(own[0], own[1])
