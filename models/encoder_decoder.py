# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Encoder and decoder: the history as states, and the state carried on over the horizon."""

import torch
from torch import Tensor, nn

from models.graph_gru import EdgeList, GraphGRU
from models.interaction_graph import complete_graph, squared_distances
from models.mtp_go_config import ModelConfig
from models.temporal_attention import TemporalAttention


class Encoder(nn.Module):
    """The history as a sequence of states (paper, "Temporal GNN Encoder")."""

    def __init__(self, config: ModelConfig, input_size: int):
        super().__init__()
        self.initial = nn.Parameter(torch.empty(config.hidden).uniform_(-0.01, 0.01))
        layer = config.layer if config.encoder_gnn else "none"
        self.cell = GraphGRU(
            input_size,
            config.hidden,
            layer,
            config.gnn_layers,
            config.heads,
            config.tied,
            config.bandwidth_m,
        )

    def forward(self, inputs: Tensor, position: Tensor, valid: Tensor) -> Tensor:
        """States [B, N, T, D] of inputs [B, N, T, .], positions [B, N, T, 2] and presence.

        A state stays the learned first one until the agent is seen, and keeps its value while the
        agent is absent (design D2).
        """
        present = valid.transpose(1, 2)
        distance = squared_distances(position.transpose(1, 2))  # [B, T, N, N]
        link = complete_graph(present)
        flat = inputs.transpose(1, 2).flatten(0, 1)  # [B T, N, .]: the input's GNN in one go
        edges = self.cell.gnn_f.prepare(distance.flatten(0, 1), link.flatten(0, 1))
        kappas = self.cell.gnn_f(flat, edges).unflatten(0, (present.size(0), present.size(1)))
        h = self.initial.expand(present.size(0), flat.size(1), -1)
        states: list[Tensor] = []
        # Unbound, not indexed: the gradient of an index fills the whole array with zeros.
        distances, links, here = (
            distance.unbind(1),
            link.unbind(1),
            present.unsqueeze(-1).unbind(1),
        )
        for i, kappa in enumerate(kappas.unbind(1)):
            edges = self.cell.gnn_h.prepare(distances[i], links[i])
            h = torch.where(here[i], self.cell(kappa, h, edges), h)
            states.append(h)
        return torch.stack(states, dim=2)


class Decoder(nn.Module):
    """One step of the decoder's graph GRU on attended history (eq. dec_gru_input)."""

    def __init__(self, config: ModelConfig):
        super().__init__()
        hidden = config.hidden
        layer = config.layer if config.decoder_gnn else "none"
        self.initial = nn.Parameter(torch.zeros(hidden))
        self.embed = nn.Linear(config.modes * config.state_size, hidden)  # W_x
        self.attention = TemporalAttention(hidden, config.history_steps)
        self.combine = nn.Linear(2 * hidden, hidden)  # W_f
        self.cell = GraphGRU(
            hidden,
            hidden,
            layer,
            config.gnn_layers,
            config.heads,
            config.tied,
            config.bandwidth_m,
        )

    def prepare(self, position: Tensor, present: Tensor) -> tuple[EdgeList, EdgeList]:
        """The last known graph for both GNNs, from positions [B, N, 2] and presence [B, N] at t.

        It serves at all horizon steps; nothing of the future enters (design D4).
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
    ) -> Tensor:
        """The next state [B, N, D].

        Args:
            h: [B, N, D] the state before.
            states: [B, N, M * S] scaled agent states before.
            encoded: [B, N, T, D] encoder states.
            bias: [B, N, T] presence bias of the attention.
            edges: of :meth:`prepare`.
        """
        embedded = self.embed(states)
        summary = self.attention(h, embedded, encoded, bias)
        f = nn.functional.leaky_relu(self.combine(torch.cat((summary, embedded), dim=-1)), 0.2)
        return self.cell(self.cell.gnn_f(f, edges[0]), h, edges[1])
