# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Edges and their weights by hand."""

import torch

from models.gnn_layers.interaction_graph import GaussianKernel, complete_graph, squared_distances


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
