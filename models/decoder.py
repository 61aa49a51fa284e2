# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The decoder: one step of the state over the horizon."""

import torch
from torch import Tensor, nn

from models.gnn_layers.graph_network import EdgeList
from models.gnn_layers.interaction_graph import complete_graph, squared_distances
from models.graph_gru import GraphGRU
from models.mtp_go_config import ModelConfig
from models.temporal_attention import TemporalAttention


class Decoder(nn.Module):
    """A graph GRU on the attended history (paper, "Decoder with Temporal Attention Mechanism")."""

    def __init__(self, config: ModelConfig):
        super().__init__()
        hidden = config.hidden
        # Not in the paper, where the decoder continues from the encoder's last state.
        self.initial = nn.Parameter(torch.zeros(hidden), requires_grad=config.conditioned)
        self.embed = nn.Linear(config.modes * config.state_size, hidden)  # W_x, b_x
        self.attention = TemporalAttention(hidden, config.history_steps)
        self.combine = nn.Linear(2 * hidden, hidden)  # W_f, b_f
        self.cell = GraphGRU(hidden, config, config.decoder_gnn)

    def prepare(self, position: Tensor, present: Tensor) -> tuple[EdgeList, EdgeList]:
        """Return the last known graph for both GNNs, from positions [B, N, 2] and presence at t.

        It is used at all horizon steps; nothing of the future enters (docs/design.md, decision 4).
        """
        distance = squared_distances(position)
        link = complete_graph(present)
        return (
            self.cell.gnn_f.prepare(distance, link),
            self.cell.gnn_h.prepare(distance, link),
        )

    def forward(
        self,
        h: Tensor,
        states: Tensor,
        encoded: Tensor,
        bias: Tensor,
        edges: tuple[EdgeList, EdgeList],
        trail: Tensor | None = None,
    ) -> Tensor:
        """Return the next state [B, N, D].

        Args:
            h: [B, N, D] the state before.
            states: [B, N, M * S] scaled agent states before.
            encoded: [B, N, T, D] encoder states.
            bias: [B, N, T] presence bias of the attention.
            edges: result of :meth:`prepare`.
            trail: [B, N, D] embedded trails of this step.
        """
        embedded = self.embed(states)
        if trail is not None:
            embedded = embedded + trail
        summary = self.attention(h, embedded, encoded, bias)  # eq. 14, 15
        f = nn.functional.leaky_relu(self.combine(torch.cat((summary, embedded), dim=-1)), 0.2)
        kappa = self.cell.gnn_f(f, edges[0])  # eq. 16
        return self.cell(kappa, h, edges[1])  # eq. 6, 7b
