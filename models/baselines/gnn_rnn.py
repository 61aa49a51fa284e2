# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""GNN-RNN: a graph network over the encoded histories."""

from torch import Tensor, nn

from models.baselines.baseline_config import GraphConfig
from models.baselines.interaction import Interaction
from models.baselines.recurrent_predictor import RecurrentPredictor
from models.gnn_layers.graph_network import EdgeList, GraphNetwork
from models.gnn_layers.interaction_graph import complete_graph, squared_distances


class GraphInteraction(Interaction):
    """The graph of the present agents, with MTP-GO's layers and distance weights.

    Args:
        config: the network's options.
    """

    def __init__(self, config: GraphConfig):
        super().__init__()
        self.each_step = False
        self.size = config.embedding
        sizes = [config.hidden] * config.gnn_layers + [self.size]
        self.gnn = GraphNetwork(sizes, config.layer, config.heads, True, config.bandwidth_m)

    def prepare(self, position: Tensor, direction: Tensor, present: Tensor) -> EdgeList:
        """Return the edges of each layer."""
        return self.gnn.prepare(squared_distances(position), complete_graph(present))

    def forward(self, h: Tensor, links: EdgeList) -> Tensor:
        """Return [B, N, size] of states [B, N, D] and the edges of :meth:`prepare`."""
        return nn.functional.elu(self.gnn(h, links))


class GraphRNN(RecurrentPredictor):
    """LSTM encoder and decoder with a graph network between them."""

    def __init__(self, config: GraphConfig):
        super().__init__(config, GraphInteraction(config))
