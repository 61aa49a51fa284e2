# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The costly inner product of GATv2 attention over complete graphs, in blocks that stay in cache.

With slope 0.2, leaky_relu(z) = 0.6 z + 0.4 |z|. The linear half is separable and cheap; what is
left is sum_c a_c |q_ic + k_jc + e_ij w_c|, whose [N, N, C] intermediate is never held as a whole,
neither forward nor backward.
"""

from typing import Any

import torch
from torch import Tensor

BLOCK = 131072
"""Numbers of the intermediate that are worked on at a time: half a megabyte of float32."""


def blocks(agents: int, channels: int, block: int = BLOCK) -> tuple[int, int]:
    """Graphs and rows of a block."""
    rows = max(1, min(agents, block // (agents * channels)))
    graphs = max(1, block // (agents * agents * channels)) if rows == agents else 1
    return graphs, rows


def absolute_sum(query: Tensor, key: Tensor, edge: Tensor, slope: Tensor, score: Tensor) -> Tensor:
    """[L, N, N, heads] of sum_c score_c |query_ic + key_jc + edge_ij slope_c|, without gradient.

    Args:
        query: [L, N, C] of the target i.
        key: [L, N, C] of the neighbour j.
        edge: [L, N, N] weights.
        slope: [C] how the edge weight enters each channel.
        score: [C, heads].
    """
    length, agents, channels = query.size(0), query.size(1), query.size(2)
    graphs, rows = blocks(agents, channels)
    out = torch.empty(
        (length, agents, agents, score.size(1)), dtype=query.dtype, device=query.device
    )
    for start in range(0, length, graphs):
        k = key[start : start + graphs].unsqueeze(1)
        for row in range(0, agents, rows):
            e = edge[start : start + graphs, row : row + rows].unsqueeze(-1)
            z = torch.addcmul(k, e, slope)
            z.add_(query[start : start + graphs, row : row + rows].unsqueeze(2)).abs_()
            out[start : start + graphs, row : row + rows] = torch.matmul(z, score)
    return out


class AbsoluteSum(torch.autograd.Function):
    """:func:`absolute_sum` with a gradient that recomputes the intermediate block by block."""

    @staticmethod
    def forward(
        ctx: Any, query: Tensor, key: Tensor, edge: Tensor, slope: Tensor, score: Tensor
    ) -> Tensor:
        """See :func:`absolute_sum`."""
        ctx.save_for_backward(query, key, edge, slope, score)
        return absolute_sum(query, key, edge, slope, score)

    @staticmethod
    def backward(ctx: Any, *grads: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor, Tensor]:
        """Gradients of all five arguments."""
        query, key, edge, slope, score = ctx.saved_tensors
        grad = grads[0].contiguous()
        length, agents, channels = query.shape
        graphs, rows = blocks(agents, channels)
        g_query, g_key, g_edge = (torch.zeros_like(x) for x in (query, key, edge))
        g_slope, g_score = torch.zeros_like(slope), torch.zeros_like(score)
        for start in range(0, length, graphs):
            some = slice(start, start + graphs)
            for row in range(0, agents, rows):
                part = slice(row, row + rows)
                g, e = grad[some, part], edge[some, part]
                z = torch.addcmul(key[some].unsqueeze(1), e.unsqueeze(-1), slope)
                z.add_(query[some, part].unsqueeze(2))
                flat = g.reshape(-1, g.size(-1))
                sign = z.sign()
                g_score.addmm_(z.abs_().view(-1, channels).t(), flat)
                z = sign.mul_(torch.matmul(g, score.t()))  # the gradient of z from here on
                g_query[some, part] = z.sum(2)
                g_key[some] += z.sum(1)
                g_edge[some, part] = torch.matmul(z, slope)
                g_slope.addmv_(z.view(-1, channels).t(), e.reshape(-1))
        return g_query, g_key, g_edge, g_slope, g_score
