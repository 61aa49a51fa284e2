# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""GNN layers on small complete graphs, dense and masked (paper, "GNN Layers").

Every layer has two methods, so that what depends on the graph alone is computed once per graph:
``prepare(weight, link)`` takes edge weights [L, N, N] and links [L, N, N] (bool, own loops
included) of L graphs, ``forward(x, edges)`` takes node values [L, N, in] and what ``prepare``
gave, and returns [L, N, out]. Row i of an [N, N] array is the receiving agent. On the same weights
they agree with torch_geometric's layers of the same definition.
"""

import torch
from torch import Tensor, nn

from models.kernels.attention_energy import AbsoluteSum, absolute_sum

Edges = tuple[Tensor, Tensor]


class NodeOnly(nn.Module):
    """A graph without edges: W h + b. Makes a graph GRU an ordinary GRU (the GNN ablations)."""

    def __init__(self, size_in: int, size_out: int):
        super().__init__()
        self.linear = nn.Linear(size_in, size_out)

    def prepare(self, weight: Tensor, link: Tensor) -> tuple[Tensor, Tensor]:
        """Nothing of the graph is used."""
        return weight, weight

    def forward(self, x: Tensor, edges: tuple[Tensor, Tensor]) -> Tensor:
        """[L, N, out] of [L, N, in]."""
        return self.linear(x)


class GraphConv(nn.Module):
    """b + W_1 h_i + mean over neighbours of e_ij W_2 h_j (eq. graphconv_layer).

    The mean runs over the others, not over the agent itself; an agent alone has none.
    """

    def __init__(self, size_in: int, size_out: int):
        super().__init__()
        self.centre = nn.Linear(size_in, size_out)
        self.neighbour = nn.Linear(size_in, size_out, bias=False)

    def prepare(self, weight: Tensor, link: Tensor) -> tuple[Tensor, Tensor]:
        """The averaging matrix [L, N, N], twice."""
        own = torch.eye(link.size(-1), dtype=torch.bool, device=link.device)
        other = link & ~own
        mean = weight * other / other.sum(-1, keepdim=True).clamp(min=1)
        return mean, mean

    def forward(self, x: Tensor, edges: tuple[Tensor, Tensor]) -> Tensor:
        """[L, N, out] of [L, N, in]."""
        return self.centre(x) + self.neighbour(torch.matmul(edges[0], x))


class GCN(nn.Module):
    """b + sum over neighbours and self of e_ij / sqrt(d_i d_j) W_2 h_j (eq. gcn_layer)."""

    def __init__(self, size_in: int, size_out: int):
        super().__init__()
        self.linear = nn.Linear(size_in, size_out)

    def prepare(self, weight: Tensor, link: Tensor) -> tuple[Tensor, Tensor]:
        """The normalised adjacency [L, N, N], twice. The own loop weighs 1, its kernel value."""
        adjacency = weight * link
        scale = adjacency.sum(-1).rsqrt()
        normalised = adjacency * scale.unsqueeze(-1) * scale.unsqueeze(-2)
        return normalised, normalised

    def forward(self, x: Tensor, edges: tuple[Tensor, Tensor]) -> Tensor:
        """[L, N, out] of [L, N, in]."""
        return self.linear(torch.matmul(edges[0], x))


class GAT(nn.Module):
    """GATv2 with the edge weight as a feature, heads averaged (eq. gat_attention, gat_layer).

    The score of neighbour j for agent i is a . leaky_relu(W_q h_i + W_k h_j + e_ij w). All node
    products come from one packed matrix; its blocks of ``heads * out`` rows are, in this order:
    neighbour (value and, if tied, key), target (query), key (if not tied).

    Args:
        size_in: input channels.
        size_out: output channels, and channels of each head.
        heads: independent attentions, averaged.
        tied: the value takes the key's matrix, as torch_geometric's GATv2Conv has it; the
            paper's equation leaves them apart.
    """

    def __init__(self, size_in: int, size_out: int, heads: int = 1, tied: bool = True):
        super().__init__()
        self.size_out = size_out
        self.heads = heads
        self.tied = tied
        self.packed = nn.Linear(size_in, (2 if tied else 3) * heads * size_out)
        self.edge = nn.Parameter(torch.empty(heads, size_out))
        self.score = nn.Parameter(torch.empty(heads, size_out))
        self.bias = nn.Parameter(torch.zeros(size_out))
        bound = (6.0 / (1 + size_out)) ** 0.5
        nn.init.uniform_(self.edge, -bound, bound)
        nn.init.uniform_(self.score, -bound, bound)

    def prepare(self, weight: Tensor, link: Tensor) -> tuple[Tensor, Tensor]:
        """The edge weights and the part of the scores that depends on the graph alone.

        The latter is [L, N, N, heads]: 0.6 e_ij a . w, and minus infinity where no edge is.
        """
        along = 0.6 * (self.edge * self.score).sum(-1)
        fixed = weight.unsqueeze(-1) * along
        return weight, fixed.masked_fill(~link.unsqueeze(-1), float("-inf"))

    def attend(self, query: Tensor, key: Tensor, value: Tensor, edges: Edges) -> Tensor:
        """[L, N, out] weighted sum of values; arguments [L, N, heads * out]."""
        weight, fixed = edges
        # a . q_i is the same for all j and cancels in the softmax.
        score = self.score.t()
        if self.heads > 1:
            own = torch.eye(self.heads, dtype=key.dtype, device=key.device).unsqueeze(1)
            score = (self.score.unsqueeze(-1) * own).flatten(0, 1)  # [heads * out, heads]
        linear = 0.6 * torch.matmul(key, score)
        slope = self.edge.view(-1)
        if torch.jit.is_scripting():
            rest = absolute_sum(query, key, weight, slope, score)
        else:
            # Autocast narrows products of nodes and not the edge weights; the gradient, which runs
            # outside of it, needs one type.
            one = [x.to(weight.dtype) for x in (query, key, weight, slope, score)]
            rest = AbsoluteSum.apply(*one)
        energy = torch.add(fixed + linear.unsqueeze(1), rest, alpha=0.4)
        if self.heads == 1:
            return torch.matmul(torch.softmax(energy.squeeze(-1), dim=2), value)
        attention = torch.softmax(energy, dim=2)
        split = value.view(value.size(0), value.size(1), self.heads, self.size_out)
        return torch.einsum("lijh,ljhc->lic", attention, split) / self.heads

    def forward(self, x: Tensor, edges: tuple[Tensor, Tensor]) -> Tensor:
        """[L, N, out] of [L, N, in]."""
        parts = self.packed(x).split(self.heads * self.size_out, dim=-1)
        key = parts[0] if self.tied else parts[2]
        return self.attend(parts[1], key, parts[0], edges) + self.bias


class GATPlus(GAT):
    """GAT and a matrix for the agent itself: b + W_1 h_i + attention (eq. gat_plus_layer)."""

    def __init__(self, size_in: int, size_out: int, heads: int = 1, tied: bool = True):
        super().__init__(size_in, size_out, heads, tied)
        self.centre = nn.Linear(size_in, size_out, bias=False)

    def forward(self, x: Tensor, edges: tuple[Tensor, Tensor]) -> Tensor:
        """[L, N, out] of [L, N, in]."""
        parts = self.packed(x).split(self.heads * self.size_out, dim=-1)
        key = parts[0] if self.tied else parts[2]
        attended = self.attend(parts[1], key, parts[0], edges)
        return attended + nn.functional.linear(x, self.centre.weight, self.bias)


def make_layer(
    name: str, size_in: int, size_out: int, heads: int = 1, tied: bool = True
) -> nn.Module:
    """The layer called ``name``; ``none`` is the graph without edges.

    Raises:
        ValueError: no layer has this name.
    """
    if name in _PLAIN:
        return _PLAIN[name](size_in, size_out)
    if name in _ATTENTION:
        return _ATTENTION[name](size_in, size_out, heads, tied)
    valid = ", ".join(repr(n) for n in (*_PLAIN, *_ATTENTION))
    raise ValueError(f"layer is {name!r}, expected one of {valid}")


_PLAIN: dict[str, type[NodeOnly] | type[GraphConv] | type[GCN]] = {
    "none": NodeOnly,
    "graphconv": GraphConv,
    "gcn": GCN,
}
_ATTENTION: dict[str, type[GAT]] = {"gat": GAT, "gat+": GATPlus}
