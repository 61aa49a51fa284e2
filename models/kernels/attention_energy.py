# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Energy of the graph attention (GATv2) between all pairs of agents, in blocks that fit the cache.

With slope 0.2, leaky_relu(z) = 0.6 z + 0.4 |z|. The linear half separates into a number for each
agent and is cheap; what is left is sum_c a_c |q_ic + k_jc + e_ij w_c|.

Why it is written out: its [N, N, C] intermediate is the largest array of the network and the
attention a quarter to a third of a training step (docs/performance.md). Here it is held one block
at a time, forward and backward. Forward, |z| = 2 max(k + e w, -q) + q - (k + e w), where again all
but the maximum separates, takes three passes over the intermediate.
"""

import functools
from typing import Any

import torch
from torch import Tensor

BLOCK = 1 << 20
"""Numbers of the intermediate in work at a time: 4 MB of float32 (chosen: stays in the cache)."""


def plain_absolute_sum(
    query: Tensor, key: Tensor, edge: Tensor, slope: Tensor, score: Tensor
) -> Tensor:
    """Return [L, N, N, heads] sum_c a_c |q_ic + k_jc + e_ij w_c| (in the energy of eq. 10).

    Args:
        query: [L, N, C] q of the receiving agent i.
        key: [L, N, C] k of the neighbour j.
        edge: [L, N, N] edge weights e.
        slope: [C] w, how the edge weight enters each channel.
        score: [C, heads] a.
    """
    z = query.unsqueeze(2) + key.unsqueeze(1) + edge.unsqueeze(-1) * slope
    return torch.matmul(z.abs(), score)


def blocks(agents: int, channels: int, block: int = BLOCK) -> tuple[int, int]:
    """Return the graphs and the rows of a block."""
    rows = max(1, min(agents, block // (agents * channels)))
    graphs = max(1, block // (agents * agents * channels)) if rows == agents else 1
    return graphs, rows


def make_scratch(x: Tensor, graphs: int, rows: int) -> Tensor:
    """Return memory for a block; reused memory is in the cache, newly allocated memory is not.

    Args:
        x: [L, N, C] of the type and device that is needed.
        graphs: graphs of a block.
        rows: rows of a block.
    """
    most = min(graphs, x.size(0)) * rows * x.size(1) * x.size(2)
    return torch.empty(most, dtype=x.dtype, device=x.device)


def absolute_sum_in_blocks(
    query: Tensor, key: Tensor, edge: Tensor, slope: Tensor, score: Tensor
) -> Tensor:
    """Return :func:`plain_absolute_sum`, block by block and without a gradient."""
    length, agents, channels = query.size(0), query.size(1), query.size(2)
    graphs, rows = blocks(agents, channels)
    out = torch.empty(
        (length, agents, agents, score.size(1)), dtype=query.dtype, device=query.device
    )
    least = query.neg()
    scratch = make_scratch(query, graphs, rows)
    for start in range(0, length, graphs):
        k = key[start : start + graphs].unsqueeze(1)
        for row in range(0, agents, rows):
            e = edge[start : start + graphs, row : row + rows].unsqueeze(-1)
            z = scratch[: e.size(0) * e.size(1) * agents * channels]
            z = z.view(e.size(0), e.size(1), agents, channels)
            torch.addcmul(k, e, slope, out=z)
            bound = least[start : start + graphs, row : row + rows].unsqueeze(2)
            torch.maximum(z, bound, out=z)
            out[start : start + graphs, row : row + rows] = torch.matmul(z, score)
    own, other = torch.matmul(query, score), torch.matmul(key, score)
    along = torch.matmul(slope, score)
    out.mul_(2.0).add_(own.unsqueeze(2)).sub_(other.unsqueeze(1))
    return out.sub_(edge.unsqueeze(-1) * along)


class AbsoluteSum(torch.autograd.Function):
    """:func:`plain_absolute_sum` with a gradient that recomputes the intermediate by blocks."""

    @staticmethod
    def forward(
        ctx: Any, query: Tensor, key: Tensor, edge: Tensor, slope: Tensor, score: Tensor
    ) -> Tensor:
        """See :func:`plain_absolute_sum`; in the arguments' widest type, under autocast too."""
        given = (query, key, edge, slope, score)
        wide = functools.reduce(torch.promote_types, (x.dtype for x in given))
        query, key, edge, slope, score = (x.to(wide) for x in given)
        ctx.save_for_backward(query, key, edge, slope, score)
        device = query.device.type
        if not torch.amp.is_autocast_available(device):
            return absolute_sum_in_blocks(query, key, edge, slope, score)
        with torch.autocast(device, enabled=False):
            return absolute_sum_in_blocks(query, key, edge, slope, score)

    @staticmethod
    def backward(ctx: Any, *grads: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor, Tensor]:
        """Return the gradients of all five arguments."""
        query, key, edge, slope, score = ctx.saved_tensors
        grad = grads[0].contiguous()
        length, agents, channels = query.shape
        graphs, rows = blocks(agents, channels)
        g_query, g_key, g_edge = (torch.zeros_like(x) for x in (query, key, edge))
        g_slope, g_score = torch.zeros_like(slope), torch.zeros_like(score)
        one = score.size(1) == 1
        along = slope * score[:, 0]
        scratch = make_scratch(query, graphs, rows)
        for start in range(0, length, graphs):
            some = slice(start, start + graphs)
            for row in range(0, agents, rows):
                part = slice(row, row + rows)
                g, e = grad[some, part], edge[some, part]
                z = scratch[: e.numel() * channels].view(*e.shape, channels)
                torch.addcmul(key[some].unsqueeze(1), e.unsqueeze(-1), slope, out=z)
                z.add_(query[some, part].unsqueeze(2))
                if one:
                    # The gradient of z without the factor score, which joins the sums below.
                    z.sign_().mul_(g)
                    g_edge[some, part] = torch.matmul(z, along)
                else:
                    sign = z.sign()
                    flat = g.reshape(-1, g.size(-1))
                    g_score.addmm_(z.abs_().view(-1, channels).t(), flat)
                    z = sign.mul_(torch.matmul(g, score.t()))  # the gradient of z
                    g_edge[some, part] = torch.matmul(z, slope)
                g_query[some, part] = z.sum(2)
                g_key[some] += z.sum(1)
                g_slope.addmv_(z.view(-1, channels).t(), e.reshape(-1))
        if one:
            # |z| is sign(z) z, and z is linear in query, key and slope: the sums are known.
            found = (query * g_query).sum((0, 1)) + (key * g_key).sum((0, 1)) + slope * g_slope
            g_score = found.unsqueeze(1)
            weight = score[:, 0]
            g_query, g_key, g_slope = g_query * weight, g_key * weight, g_slope * weight
        return g_query, g_key, g_edge, g_slope, g_score


def absolute_sum(query: Tensor, key: Tensor, edge: Tensor, slope: Tensor, score: Tensor) -> Tensor:
    """Return :func:`plain_absolute_sum` in blocks, with a gradient where autograd runs."""
    if torch.jit.is_scripting():
        return absolute_sum_in_blocks(query, key, edge, slope, score)
    # Autocast narrows products of nodes and not the edge weights; the gradient, which runs outside
    # of autocast, needs one type.
    one = [x.to(edge.dtype) for x in (query, key, edge, slope, score)]
    return AbsoluteSum.apply(*one)
