# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The graph GRU against torch's own GRU cell, and what its edges add."""

import pytest
import torch
from graph_samples import torch_cell_of

from models import ModelConfig
from models.gnn_layers.interaction_graph import complete_graph, squared_distances
from models.graph_gru import GraphGRU

SIZE_IN, HIDDEN, B, N = 3, 4, 2, 5


def make_cell(edges, **choices):
    cell = GraphGRU(SIZE_IN, ModelConfig(hidden=HIDDEN, **choices), edges).double()
    torch.nn.init.normal_(cell.bias)
    return cell


def graph():
    position = 10.0 * torch.randn(B, N, 2).double()
    return squared_distances(position), complete_graph(torch.ones(B, N, dtype=torch.bool))


def step(cell, f, h, distance, link):
    kappa = cell.gnn_f(f, cell.gnn_f.prepare(distance, link))
    return cell(kappa, h, cell.gnn_h.prepare(distance, link))


@torch.no_grad()
def test_without_edges_it_is_torchs_gru_cell():
    """GRU intermediate vectors (eq. 5) and update (eq. 6)."""
    cell = make_cell(edges=False)
    oracle = torch_cell_of(cell)
    f, h = torch.randn(B, N, SIZE_IN).double(), torch.randn(B, N, HIDDEN).double()
    expected = oracle(f.flatten(0, 1), h.flatten(0, 1)).view(B, N, HIDDEN)
    torch.testing.assert_close(step(cell, f, h, *graph()), expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(("edges", "changes"), [(True, True), (False, False)])
@torch.no_grad()
def test_a_neighbours_state_enters_over_edges_only(edges, changes):
    cell = make_cell(edges)
    f, h, links = torch.randn(B, N, SIZE_IN).double(), torch.randn(B, N, HIDDEN).double(), graph()
    before = step(cell, f, h, *links)
    h[:, 1] += 1.0
    after = step(cell, f, h, *links)
    assert torch.allclose(after[:, 0], before[:, 0]) is not changes
    assert not torch.allclose(after[:, 1], before[:, 1])


def test_inner_layers_keep_the_size_and_the_last_gives_the_three_gates():
    cell = make_cell(edges=True, layer="gcn", gnn_layers=3)
    for gnn, size_in in ((cell.gnn_f, SIZE_IN), (cell.gnn_h, HIDDEN)):
        shapes = [tuple(layer.linear.weight.shape) for layer in gnn.layers]
        assert shapes == [(HIDDEN, size_in), (HIDDEN, HIDDEN), (3 * HIDDEN, HIDDEN)]
