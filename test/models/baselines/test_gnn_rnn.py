# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The graph network over the encoded histories: its graph and its edge weights."""

import torch
from baseline_samples import close, crowd

from models.baselines.baseline_config import GraphConfig
from models.baselines.gnn_rnn import GraphInteraction


@torch.no_grad()
def test_the_graph_is_that_of_the_present_agents():
    interaction = GraphInteraction(GraphConfig(hidden=4, embedding=3, bandwidth_m=10.0)).double()
    h, position, direction, present = crowd()
    features = interaction(h, interaction.prepare(position, direction, present))
    for b in range(2):
        here = present[b]
        fewer = (position[b : b + 1, here], direction[b : b + 1, here], present[b : b + 1, here])
        close(
            (features[b, here],),
            (interaction(h[b : b + 1, here], interaction.prepare(*fewer))[0],),
        )


@torch.no_grad()
def test_a_near_neighbour_counts_differently_from_a_far_one():
    """The edge weights reach the graph network."""
    interaction = GraphInteraction(GraphConfig(hidden=4, embedding=3, bandwidth_m=10.0)).double()
    h, position, direction, present = crowd(3, 1)
    near = interaction(h, interaction.prepare(position, direction, present))
    far = interaction(h, interaction.prepare(3.0 * position, direction, present))
    assert not torch.allclose(near, far)
