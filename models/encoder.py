# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The encoder: the history of every agent as a sequence of states."""

import torch
from torch import Tensor, nn

from models.gnn_layers.interaction_graph import complete_graph, squared_distances
from models.graph_gru import GraphGRU
from models.mtp_go_config import ModelConfig


class Encoder(nn.Module):
    """A graph GRU over the history steps (paper, "Temporal GNN Encoder")."""

    def __init__(self, config: ModelConfig, input_size: int):
        super().__init__()
        self.initial = nn.Parameter(torch.empty(config.hidden).uniform_(-0.01, 0.01))
        self.cell = GraphGRU(input_size, config, config.encoder_gnn)

    def forward(self, inputs: Tensor, position: Tensor, valid: Tensor) -> Tensor:
        """Return states [B, N, T, D] of inputs [B, N, T, .], positions [B, N, T, 2] and presence.

        A state is the learned initial one until the agent is first seen, and keeps its value while
        the agent is absent (docs/design.md, decision 2).
        """
        present = valid.transpose(1, 2)
        distance = squared_distances(position.transpose(1, 2))  # [B, T, N, N]
        link = complete_graph(present)
        flat = inputs.transpose(1, 2).flatten(0, 1)  # [B T, N, .]: all steps in one call
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
