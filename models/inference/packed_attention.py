# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""GATv2 attention with one head on K kinds of graphs together, for inference."""

from typing import cast

import torch
from torch import Tensor, nn

from models.gnn_layers.gat import GAT
from models.gnn_layers.gat_plus import GATPlus
from models.gnn_layers.graph_network import GraphNetwork
from models.gnn_layers.interaction_graph import GaussianKernel

BLOCK = 196608
"""Elements of the [N, N, C] intermediate processed at a time: 0.8 MB (chosen: fits the cache)."""


def make_scratch(x: Tensor, agents: int, channels: int, block: int = BLOCK) -> Tensor:
    """Return memory for :func:`add_energy`, of the type and device of ``x``."""
    return torch.empty(max(block, agents * channels), dtype=x.dtype, device=x.device)


def add_energy(
    score: Tensor,
    query: Tensor,
    key: Tensor,
    edge: Tensor,
    slope: Tensor,
    weight: Tensor,
    scratch: Tensor,
) -> None:
    """Add sum_c weight_c max(k_jc + e_ij w_c, -q_ic) to the scores [K, B, N, N], in place.

    With z = q_i + k_j + e_ij w, leaky_relu(z) = 0.2 z + 0.8 max(z, 0), and max(z, 0) is
    max(k_j + e_ij w, -q_i) + q_i. What is linear is cheap, and what depends on i alone cancels in
    the softmax over j. So with weights 0.8 a_c three passes over the N x N x C numbers remain:
    the product and sum, the maximum, and the sum over c as a matrix-vector product.

    Args:
        score: [K, B, N, N] contiguous.
        query: [K, B, N, C] minus the query.
        key: [K, B, N, C].
        edge: [K, B, N, N] weights.
        slope: [K, C] how the edge weight enters each channel.
        weight: [K, C].
        scratch: [at least N C] memory for the intermediate, see :func:`make_scratch`: reused
            memory is in the cache, newly allocated memory is not.
    """
    kinds, scenes, agents, channels = query.size(0), query.size(1), query.size(2), query.size(3)
    pairs = agents * agents
    least, keys, edges = query.unsqueeze(3), key.unsqueeze(2), edge.unsqueeze(-1)
    block, total = scratch.numel(), kinds * scenes * pairs * channels
    if total <= block:
        z = scratch[:total].view(kinds, scenes, agents, agents, channels)
        torch.addcmul(keys, edges, slope[:, None, None, None], out=z)
        torch.maximum(z, least, out=z)
        flat, sums = z.view(kinds, scenes * pairs, channels), score.view(kinds, scenes * pairs)
        for kind in range(kinds):  # a batched product with one column is ten times slower
            sums[kind].addmv_(flat[kind], weight[kind])
        return
    rows = max(1, min(agents, block // (agents * channels)))
    some = max(1, block // (pairs * channels)) if rows == agents else 1
    for kind in range(kinds):
        w, a = slope[kind], weight[kind]
        some_edges, some_least = edges[kind].split(some), least[kind].split(some)
        some_sums = score[kind].view(-1).split(some * pairs)
        for i, k in enumerate(keys[kind].split(some)):
            parts, bounds = some_edges[i].split(rows, dim=1), some_least[i].split(rows, dim=1)
            sums_of = some_sums[i].split(k.size(0) * rows * agents)
            for j, e in enumerate(parts):
                flat = scratch[: e.size(0) * e.size(1) * agents * channels].view(-1, channels)
                z = flat.view(e.size(0), e.size(1), agents, channels)
                torch.addcmul(k, e, w, out=z)
                torch.maximum(z, bounds[j], out=z)
                sums_of[j].addmv_(flat, a)


class PackedAttention(nn.Module):
    """K layers of GAT or GAT+ with the same sizes, each on its own inputs.

    One product gives, for each node, the columns value, minus the query, key (if not tied), what
    the node adds by itself (bias and, in GAT+, W_1 h), and the linear part of the energy as
    sender, 0.2 a . k. The receiver's part of it cancels in the softmax.

    Args:
        networks: one of a single layer per kind.
        extra: added to the outputs of the first layer, [C]: the graph GRU's bias.
    """

    product: Tensor
    bias: Tensor
    slope: Tensor
    weight: Tensor
    along: Tensor
    sharpness: Tensor

    @torch.no_grad()
    def __init__(self, networks: list[GraphNetwork], extra: Tensor):
        super().__init__()
        layers = [cast(GAT, network.layers[0]) for network in networks]
        kernels = [cast(GaussianKernel, network.kernels[0]) for network in networks]
        size = layers[0].size_out
        self.kinds = len(layers)
        self.tied = layers[0].tied
        self.size = size
        columns = (3 if self.tied else 4) * size
        self.columns = columns + (-columns % 16 or 16)
        products, biases, slopes, weights, alongs = [], [], [], [], []
        for i, layer in enumerate(layers):
            parts = layer.packed.weight.double().split(size)
            shifts = layer.packed.bias.double().split(size)
            score, edge = layer.score[0].double(), layer.edge[0].double()
            key, key_shift = (parts[0], shifts[0]) if self.tied else (parts[2], shifts[2])
            centre = torch.zeros_like(parts[0])
            if isinstance(layer, GATPlus):
                centre = layer.centre.weight.double()
            own = layer.bias.double() + (extra.double() if i == 0 else 0.0)
            rows = [parts[0], -parts[1], centre, (0.2 * score @ key).unsqueeze(0)]
            shift = [shifts[0], -shifts[1], own, (0.2 * score @ key_shift).unsqueeze(0)]
            if not self.tied:
                rows.insert(2, key)
                shift.insert(2, key_shift)
            product = torch.cat(rows).t()
            pad = self.columns - product.size(1)
            products.append(nn.functional.pad(product, (0, pad)))
            biases.append(nn.functional.pad(torch.cat(shift), (0, pad)))
            slopes.append(edge)
            weights.append(0.8 * score)
            alongs.append(0.2 * edge @ score)
        sharp = torch.stack([torch.exp(-2.0 * k.log_bandwidth.double()) for k in kernels])
        self.register_buffer("product", torch.stack(products))  # [K, in, columns]
        self.register_buffer("bias", torch.stack(biases).unsqueeze(1))  # [K, 1, columns]
        self.register_buffer("slope", torch.stack(slopes))  # [K, C]
        self.register_buffer("weight", torch.stack(weights))  # [K, C]
        self.register_buffer("along", torch.stack(alongs).view(-1, 1, 1, 1))  # [K, 1, 1, 1]
        self.register_buffer("sharpness", -sharp.view(-1, 1, 1, 1))

    def prepare(self, squared_distance: Tensor, absent: Tensor) -> tuple[Tensor, Tensor]:
        """Return [K, B, N, N] edge weights, and what the graph alone adds to the scores.

        Args:
            squared_distance: [B, N, N] (m^2).
            absent: [B, N, N] true where there is no edge.
        """
        edge = torch.exp(squared_distance * self.sharpness)
        return edge, (edge * self.along).masked_fill_(absent, float("-inf"))

    def forward(self, x: Tensor, edge: Tensor, fixed: Tensor, scratch: Tensor) -> Tensor:
        """Return [K, B, N, C] of inputs [K, B * N, in], prepared graphs and scratch memory."""
        scenes, agents, size = edge.size(1), edge.size(2), self.size
        if self.kinds == 1:
            packed = torch.addmm(self.bias[0], x[0], self.product[0])
        else:
            packed = torch.baddbmm(self.bias, x, self.product)
        y = packed.view(self.kinds, scenes, agents, self.columns)
        if self.tied:
            parts = y.split([size, size, size, self.columns - 3 * size], dim=-1)
            value, query, key, own, rest = parts[0], parts[1], parts[0], parts[2], parts[3]
        else:
            parts = y.split([size, size, size, size, self.columns - 4 * size], dim=-1)
            value, query, key, own, rest = parts[0], parts[1], parts[2], parts[3], parts[4]
        score = fixed + rest[..., 0].unsqueeze(2)
        add_energy(score, query, key, edge, self.slope, self.weight, scratch)
        attention = torch.softmax(score, dim=-1)
        out = torch.baddbmm(own.flatten(0, 1), attention.flatten(0, 1), value.flatten(0, 1))
        return out.view(self.kinds, scenes, agents, size)
