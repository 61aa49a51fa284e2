# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The packed attention against the layers it is built from, with any block size."""

import pytest
import torch
from graph_samples import Graphs
from torch.nn.functional import leaky_relu

from models.gnn_layers.graph_network import GraphNetwork
from models.gnn_layers.interaction_graph import complete_graph, squared_distances
from models.inference.packed_attention import PackedAttention, add_energy, make_scratch

SIZE_IN, SIZE_OUT = 5, 6


@pytest.mark.parametrize("tied", [True, False])
@pytest.mark.parametrize("layer", ["gat", "gat+"])
@torch.no_grad()
def test_two_networks_as_one(layer, tied):
    """Each on its own inputs and bandwidth; the extra bias goes to the first alone."""
    networks = [GraphNetwork([SIZE_IN, SIZE_OUT], layer, 1, tied, m).double() for m in (8.0, 20.0)]
    for network in networks:
        torch.nn.init.normal_(network.layers[0].bias)
    extra, graphs = torch.randn(SIZE_OUT).double(), Graphs()
    scenes, agents = graphs.present.shape
    distance, link = squared_distances(graphs.dense_position), complete_graph(graphs.present)
    x = torch.randn(2, scenes, agents, SIZE_IN).double()
    want = [net(x[i], net.prepare(distance, link)) for i, net in enumerate(networks)]
    want[0] = want[0] + extra
    packed = PackedAttention(networks, extra).double()
    edge, fixed = packed.prepare(distance, ~link)
    got = packed(x.flatten(1, 2), edge, fixed, make_scratch(x, agents, SIZE_OUT))
    torch.testing.assert_close(got, torch.stack(want), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("block", [1, 90, 400, 10**6])
def test_energy_in_blocks(block):
    kinds, scenes, agents, channels = 2, 3, 5, 7
    query, key = torch.randn(2, kinds, scenes, agents, channels).double()
    edge = torch.rand(kinds, scenes, agents, agents).double()
    slope, a = torch.randn(2, kinds, channels).double()
    before = torch.randn(kinds, scenes, agents, agents).double()
    score = before.clone()
    add_energy(score, -query, key, edge, slope, 0.8 * a, make_scratch(a, agents, channels, block))
    z = query.unsqueeze(3) + key.unsqueeze(2)
    z = z + edge.unsqueeze(-1) * slope[:, None, None, None]
    of_keys = (key @ a.view(kinds, 1, channels, 1)).squeeze(-1).unsqueeze(2)
    of_edges = edge * (slope * a).sum(-1)[:, None, None, None]
    got = score + 0.2 * (of_keys + of_edges)
    want = before + (leaky_relu(z, 0.2) * a[:, None, None, None]).sum(-1)
    torch.testing.assert_close(got.softmax(-1), want.softmax(-1), rtol=1e-12, atol=1e-12)


def test_the_scratch_memory_holds_one_agents_row_at_least():
    x = torch.zeros(1).double()
    assert make_scratch(x, agents=5, channels=7, block=10).numel() == 35
    assert make_scratch(x, agents=5, channels=7, block=100).numel() == 100
    assert make_scratch(x, agents=5, channels=7).dtype == torch.float64
