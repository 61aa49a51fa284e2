# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The gated recurrent unit whose linear maps are GNNs (paper, "Graph-Gated Recurrent Unit")."""

import torch
from torch import Tensor, nn

from models.gnn_layers.graph_network import EdgeList, GraphNetwork
from models.kernels.gru_update import gru_update
from models.mtp_go_config import ModelConfig


class GraphGRU(nn.Module):
    """One step of the graph GRU (eq. 6 and 7).

    The input's GNN is applied by the caller, because its results do not depend on the recurrent
    state: the encoder computes them for all steps in one call.

    Args:
        size_in: channels of the input f.
        config: the model's options.
        edges: false makes it an ordinary GRU.
    """

    def __init__(self, size_in: int, config: ModelConfig, edges: bool) -> None:
        super().__init__()
        self.hidden = config.hidden
        layer = config.layer if edges else "none"
        sizes = [config.hidden] * (config.gnn_layers - 1) + [3 * config.hidden]
        options = layer, config.heads, config.tied, config.bandwidth_m
        self.gnn_f = GraphNetwork([size_in, *sizes], *options)
        self.gnn_h = GraphNetwork([config.hidden, *sizes], *options)
        self.bias = nn.Parameter(torch.zeros(3 * config.hidden))  # b_r, b_z, b_h

    def forward(self, kappa: Tensor, h: Tensor, edges: EdgeList) -> Tensor:
        """Return the next state [B, N, D].

        Args:
            kappa: [B, N, 3D] ``gnn_f`` of the input (eq. 7a).
            h: [B, N, D] the state before.
            edges: the graphs, prepared by ``gnn_h``.
        """
        xi = self.gnn_h(h, edges)  # eq. 7b
        return gru_update(kappa, xi, self.bias, h)
