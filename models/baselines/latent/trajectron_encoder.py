# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Encoders of Trajectron++: an agent's history, and its neighbours by kind with attention."""

import torch
from torch import Tensor, nn

from models.baselines.agent_headings import yaw_vectors
from models.baselines.latent.trajectron_config import TrajectronConfig
from models.baselines.neighbour_relations import RELATIONS, neighbour_relations
from models.baselines.recurrent_predictor import AgentLSTM
from models.gnn_layers.interaction_graph import GaussianKernel, squared_distances

EDGE_INPUTS = RELATIONS + 2
"""An edge encoder's inputs: the summed weight and relations to the neighbours, and
whether the agent itself has wheels."""


class AdditiveAttention(nn.Module):
    """Weights softmax(v^T tanh(W q + U k)) over a few keys (Bahdanau et al., ICLR 2015).

    Args:
        query: channels of the query.
        key: channels of the keys.
    """

    def __init__(self, query: int, key: int):
        super().__init__()
        self.of_query = nn.Linear(query, key)
        self.of_key = nn.Linear(key, key, bias=False)
        self.energy = nn.Linear(key, 1, bias=False)

    def forward(self, query: Tensor, keys: Tensor) -> Tensor:
        """Return [..., key] the weighted sum of keys [..., n, key] for queries [..., query]."""
        energy = self.energy(torch.tanh(self.of_query(query).unsqueeze(-2) + self.of_key(keys)))
        return (torch.softmax(energy, dim=-2) * keys).sum(dim=-2)


class TrajectronEncoder(nn.Module):
    """History and neighbours of every agent (Sec. 4, "Modeling Agent History" and "Interactions").

    The neighbours of one kind, with wheels or without, are summed, so that any number of them has
    one size, and go through an LSTM of that kind; attention with the agent's history as the query
    joins the kinds. In the sums every neighbour has the edge weight of its distance, as in MTP-GO
    (eq. 13).

    Args:
        config: the network's options.
        inputs: channels of the scaled inputs.
    """

    def __init__(self, config: TrajectronConfig, inputs: int):
        super().__init__()
        hidden, edge = config.hidden, config.edge_hidden
        self.size = hidden + edge
        self.edge = edge
        self.yaw_as_angle = config.has_angle
        self.history = AgentLSTM(inputs, hidden)
        self.vehicles = AgentLSTM(EDGE_INPUTS, edge)
        self.walkers = AgentLSTM(EDGE_INPUTS, edge)
        self.attention = AdditiveAttention(hidden, edge)
        self.kernel = GaussianKernel(config.bandwidth_m)
        self.initial = nn.Parameter(torch.empty(2, hidden).uniform_(-0.01, 0.01))

    def forward(
        self, inputs: Tensor, features: Tensor, valid: Tensor, wheeled: Tensor, direction: Tensor
    ) -> Tensor:
        """Return [B, N, size] the encoded history and influence of the neighbours.

        Both keep their values while the agent itself is absent (docs/design.md, decision 2).

        Args:
            inputs: [B, N, T, .] scaled.
            features: [B, N, T, F], zero where not valid.
            valid: [B, N, T].
            wheeled: [B, N] whether the agent is a vehicle.
            direction: [B, N, 2] cosine and sine of the agents' frames.
        """
        shape = [valid.size(0), valid.size(1), -1]
        h, c = self.initial[0].expand(shape), self.initial[1].expand(shape)
        zero = torch.zeros(
            valid.size(0), valid.size(1), self.edge, dtype=inputs.dtype, device=inputs.device
        )
        states = [zero, zero, zero, zero]  # h and c of the vehicles, then of the walkers
        for t in range(valid.size(2)):
            present = valid[:, :, t].unsqueeze(-1)
            seen = self.edges(features[:, :, t], valid[:, :, t], wheeled, direction)
            next_h, next_c = self.history(inputs[:, :, t], h, c)
            h, c = torch.where(present, next_h, h), torch.where(present, next_c, c)
            others = self.vehicles(seen[0], states[0], states[1])
            walking = self.walkers(seen[1], states[2], states[3])
            after = [others[0], others[1], walking[0], walking[1]]
            states = [torch.where(present, n, s) for n, s in zip(after, states)]  # noqa: B905
        influence = self.attention(h, torch.stack((states[0], states[2]), dim=2))
        return torch.cat((h, influence), dim=-1)

    def edges(
        self, features: Tensor, present: Tensor, wheeled: Tensor, direction: Tensor
    ) -> tuple[Tensor, Tensor]:
        """Return [B, N, EDGE_INPUTS] of the neighbours with wheels, and of those without.

        Args:
            features: [B, N, F] at one step.
            present: [B, N] at this step.
            wheeled: [B, N].
            direction: [B, N, 2].
        """
        yaw = yaw_vectors(features, self.yaw_as_angle)
        relation = neighbour_relations(features, yaw, direction)
        edge = torch.cat((torch.ones_like(relation[..., :1]), relation), dim=-1)  # [B, N, N, 7]
        own = torch.eye(present.size(1), dtype=torch.bool, device=present.device)
        link = present.unsqueeze(2) & present.unsqueeze(1) & ~own
        weight = self.kernel(squared_distances(features[..., :2])) * link
        vehicle = wheeled.unsqueeze(1).to(weight.dtype)
        flag = wheeled.unsqueeze(-1).to(edge.dtype)
        vehicles = torch.matmul((weight * vehicle).unsqueeze(2), edge).squeeze(2)
        walkers = torch.matmul((weight * (1.0 - vehicle)).unsqueeze(2), edge).squeeze(2)
        return torch.cat((vehicles, flag), dim=-1), torch.cat((walkers, flag), dim=-1)
