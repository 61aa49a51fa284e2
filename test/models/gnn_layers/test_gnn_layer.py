# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The layer without edges, and the interface that every layer has to implement."""

import pytest
import torch
from graph_samples import SIZE_IN, SIZE_OUT, Graphs, same

from models.gnn_layers.gnn_layer import GNNLayer, NodeOnly


def test_without_edges_no_agent_depends_on_others():
    graphs = Graphs()
    dense = NodeOnly(SIZE_IN, SIZE_OUT).double()
    same(graphs.run(dense), dense.linear(graphs.x))


def test_the_interface_computes_nothing_itself():
    layer, graph = GNNLayer(), torch.zeros(1, 2, 2)
    with pytest.raises(NotImplementedError):
        layer.prepare(graph, graph > 0)
    with pytest.raises(NotImplementedError):
        layer(torch.zeros(1, 2, 3), (graph, graph))
