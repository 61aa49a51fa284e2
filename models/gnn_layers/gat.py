# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""GAT, attention over the neighbours in the form of GATv2 (eq. 10 and 11)."""

import torch
from torch import Tensor, nn

from models.gnn_layers.gnn_layer import Edges, GNNLayer
from models.kernels.attention_energy import absolute_sum


class GAT(GNNLayer):
    """b + sum over neighbours and self of alpha_ij W_2 h_j, heads averaged (GAT, eq. 11).

    alpha_ij is the softmax over j of a . leaky_relu(W_q h_i + W_k h_j + e_ij w) (attention,
    eq. 10). All node products come from one packed matrix; its blocks of ``heads * out`` rows are,
    in this order: W_2 (value and, if tied, key), W_q (query), W_k (key, if not tied).

    Args:
        size_in: input channels.
        size_out: output channels, and channels of each head.
        heads: independent attentions, averaged.
        tied: the value takes the key's matrix, as in torch_geometric's GATv2Conv; the paper's
            equations have W_2 and W_k apart.
    """

    def __init__(self, size_in: int, size_out: int, heads: int = 1, tied: bool = True):
        super().__init__()
        self.size_out = size_out
        self.heads = heads
        self.tied = tied
        self.packed = nn.Linear(size_in, (2 if tied else 3) * heads * size_out)
        self.edge = nn.Parameter(torch.empty(heads, size_out))  # w
        self.score = nn.Parameter(torch.empty(heads, size_out))  # a
        self.bias = nn.Parameter(torch.zeros(size_out))  # b
        bound = (6.0 / (1 + size_out)) ** 0.5
        nn.init.uniform_(self.edge, -bound, bound)
        nn.init.uniform_(self.score, -bound, bound)

    def prepare(self, weight: Tensor, link: Tensor) -> tuple[Tensor, Tensor]:
        """Return the edge weights and the part of the energy that depends on the graph alone.

        The latter is [L, N, N, heads]: 0.6 e_ij a . w, and minus infinity where there is no edge.
        """
        along = 0.6 * (self.edge * self.score).sum(-1)
        fixed = weight.unsqueeze(-1) * along
        return weight, fixed.masked_fill(~link.unsqueeze(-1), float("-inf"))

    def energy(self, query: Tensor, key: Tensor, edges: Edges) -> Tensor:
        """Return [L, N, N, heads] a . leaky_relu(q_i + k_j + e_ij w) without 0.6 a . q_i.

        leaky_relu(z) = 0.6 z + 0.4 |z|; what is equal for all j cancels in the softmax.
        """
        weight, fixed = edges
        score = self.score.t()
        if self.heads > 1:
            own = torch.eye(self.heads, dtype=key.dtype, device=key.device).unsqueeze(1)
            score = (self.score.unsqueeze(-1) * own).flatten(0, 1)  # [heads * out, heads]
        linear = 0.6 * torch.matmul(key, score)
        rest = absolute_sum(query, key, weight, self.edge.view(-1), score)
        return torch.add(fixed + linear.unsqueeze(1), rest, alpha=0.4)

    def attend(self, x: Tensor, edges: Edges) -> Tensor:
        """Return [L, N, out] the attention-weighted sum of values (eq. 11 without b)."""
        parts = self.packed(x).split(self.heads * self.size_out, dim=-1)
        value, query = parts[0], parts[1]
        key = value if self.tied else parts[2]
        energy = self.energy(query, key, edges)
        if self.heads == 1:
            return torch.matmul(torch.softmax(energy.squeeze(-1), dim=2), value)
        attention = torch.softmax(energy, dim=2)
        split = value.view(value.size(0), value.size(1), self.heads, self.size_out)
        return torch.einsum("lijh,ljhc->lic", attention, split) / self.heads

    def forward(self, x: Tensor, edges: tuple[Tensor, Tensor]) -> Tensor:
        """See :meth:`GNNLayer.forward`."""
        return self.attend(x, edges) + self.bias
