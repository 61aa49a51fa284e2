# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Layers by name, and the gradients of all of them."""

import pytest
import torch
from graph_samples import SIZE_IN, Graphs

from models.gnn_layers.graph_network import make_layer


@pytest.mark.parametrize("name", ["graphconv", "gcn", "gat", "gat+"])
def test_gradients_equal_finite_differences(name):
    """For all layers, including the attention's hand-written backward pass."""
    graphs = Graphs(sizes=(3, 2))
    layer = make_layer(name, SIZE_IN, 3, heads=2).double()
    parameters = tuple(layer.parameters()) + tuple(graphs.kernel.parameters())

    def run(x, *_):
        graphs.dense_x = x
        return graphs.run(layer)

    x = graphs.dense_x.clone().requires_grad_()
    assert torch.autograd.gradcheck(run, (x, *parameters), atol=1e-6)


def test_an_unknown_layer_lists_the_known():
    with pytest.raises(ValueError, match=r"'none', 'graphconv', 'gcn', 'gat', 'gat\+'"):
        make_layer("transformer", 3, 3)
