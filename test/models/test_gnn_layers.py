# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""GNN layers against torch_geometric's on the same weights, and against sums done by hand."""

import pytest
import torch
from torch.nn.functional import leaky_relu
from torch_geometric.nn import GATv2Conv, GCNConv, GraphConv
from torch_geometric.utils import to_dense_batch

from models.gnn_layers import GAT, GCN, GATPlus, NodeOnly, make_layer
from models.gnn_layers import GraphConv as DenseGraphConv
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


@pytest.fixture
def graphs():
    return Graphs()


def same(got, want):
    torch.testing.assert_close(got, want, rtol=1e-10, atol=1e-10)


def test_graphconv(graphs):
    dense = DenseGraphConv(SIZE_IN, SIZE_OUT).double()
    oracle = GraphConv(SIZE_IN, SIZE_OUT, aggr="mean").double()
    oracle.lin_rel.weight.data = dense.neighbour.weight.data
    oracle.lin_rel.bias.data = dense.centre.bias.data
    oracle.lin_root.weight.data = dense.centre.weight.data
    same(graphs.run(dense), oracle(graphs.x, *graphs.edges(loops=False)))


def test_gcn(graphs):
    dense = GCN(SIZE_IN, SIZE_OUT).double()
    oracle = GCNConv(SIZE_IN, SIZE_OUT).double()
    oracle.lin.weight.data = dense.linear.weight.data
    oracle.bias.data = dense.linear.bias.data
    same(graphs.run(dense), oracle(graphs.x, *graphs.edges(loops=False)))


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
def test_gat(graphs, kind, heads):
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


def test_without_edges_nobody_hears_of_others(graphs):
    dense = NodeOnly(SIZE_IN, SIZE_OUT).double()
    same(graphs.run(dense), dense.linear(graphs.x))


@pytest.mark.parametrize("name", ["graphconv", "gcn", "gat", "gat+"])
def test_gradients_equal_autograd_through_pyg_shaped_loops(name):
    """The layers' gradients, the attention's own backward among them, by finite differences."""
    graphs = Graphs(sizes=(3, 2))
    layer = make_layer(name, SIZE_IN, 3, heads=2).double()
    parameters = tuple(layer.parameters()) + tuple(graphs.kernel.parameters())

    def run(x, *_):
        graphs.dense_x = x
        return graphs.run(layer)

    x = graphs.dense_x.clone().requires_grad_()
    assert torch.autograd.gradcheck(run, (x, *parameters), atol=1e-6)


def test_an_unknown_layer_is_answered_with_the_known_ones():
    with pytest.raises(ValueError, match=r"'none', 'graphconv', 'gcn', 'gat', 'gat\+'"):
        make_layer("transformer", 3, 3)


def test_kernel_and_graph_by_hand():
    position = torch.tensor([[0.0, 0.0], [3.0, 4.0], [0.0, 10.0]])
    distance = squared_distances(position)
    assert distance[0, 1] == 25.0
    assert distance[0, 2] == 100.0
    weight = GaussianKernel(5.0)(distance)
    torch.testing.assert_close(weight[0, 1], torch.tensor(-1.0).exp())
    torch.testing.assert_close(weight.diagonal(), torch.ones(3))
    link = complete_graph(torch.tensor([True, False, True]))
    assert link.tolist() == [[True, False, True], [False, True, False], [True, False, True]]
