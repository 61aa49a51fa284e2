# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Attention, and encoder and decoder layers made of it, over sequences with missing entries."""

import math

import torch
from torch import Tensor, nn

HIDDEN_FACTOR = 2
"""Channels of the feed-forward part of a layer as a multiple of its own (chosen: small data)."""

MASKED_SCORE = -1e4
"""Score of an entry that is not there; its weight is 0 in any precision, float16 included."""


class MaskedAttention(nn.Module):
    """Multi-head scaled dot-product attention: softmax(Q K^T / sqrt(d)) V in each head.

    (Vaswani et al., "Attention Is All You Need", NeurIPS 2017, eq. 1.) A query without any known
    entry gets the output's bias.

    Args:
        size: D, channels of queries, memory and output.
        heads: divide D.
    """

    def __init__(self, size: int, heads: int):
        super().__init__()
        self.heads = heads
        self.masked = MASKED_SCORE
        self.scale = 1.0 / math.sqrt(size // heads)
        self.query = nn.Linear(size, size)
        self.key = nn.Linear(size, size)
        self.value = nn.Linear(size, size)
        self.out = nn.Linear(size, size)

    def forward(self, x: Tensor, memory: Tensor, known: Tensor) -> Tensor:
        """Return [L, Q, D].

        Args:
            x: [L, Q, D] queries.
            memory: [L, S, D] keys and values.
            known: [L, S] true where ``memory`` has an entry.
        """
        query = self.query(x).unflatten(2, (self.heads, -1)).transpose(1, 2)  # [L, heads, Q, d]
        key = self.key(memory).unflatten(2, (self.heads, -1)).transpose(1, 2)
        value = self.value(memory).unflatten(2, (self.heads, -1)).transpose(1, 2)
        there = known[:, None, None, :]
        score = torch.matmul(query, key.transpose(2, 3)) * self.scale
        score = torch.where(there, score, torch.full_like(score, self.masked))
        weight = torch.softmax(score, dim=-1) * there
        return self.out(torch.matmul(weight, value).transpose(1, 2).flatten(2))


class FeedForward(nn.Module):
    """Two linear layers with ReLU between them, for every entry alone."""

    def __init__(self, size: int):
        super().__init__()
        self.wide = nn.Linear(size, HIDDEN_FACTOR * size)
        self.out = nn.Linear(HIDDEN_FACTOR * size, size)

    def forward(self, x: Tensor) -> Tensor:
        """Return [L, S, D] of [L, S, D]."""
        return self.out(torch.relu(self.wide(x)))


class EncoderLayer(nn.Module):
    """Self-attention and feed-forward part with residual connections.

    Each part normalises its input first (pre-norm), so that no long warm-up is needed.
    """

    def __init__(self, size: int, heads: int):
        super().__init__()
        self.attention = MaskedAttention(size, heads)
        self.feed_forward = FeedForward(size)
        self.norm_1 = nn.LayerNorm(size)
        self.norm_2 = nn.LayerNorm(size)

    def forward(self, x: Tensor, known: Tensor) -> Tensor:
        """Return [L, S, D] of entries [L, S, D], where they are known [L, S]."""
        y = self.norm_1(x)
        x = x + self.attention(y, y, known)
        return x + self.feed_forward(self.norm_2(x))


class DecoderLayer(nn.Module):
    """Self-attention of the queries, attention to the memory, and feed-forward part (pre-norm)."""

    def __init__(self, size: int, heads: int):
        super().__init__()
        self.own = MaskedAttention(size, heads)
        self.cross = MaskedAttention(size, heads)
        self.feed_forward = FeedForward(size)
        self.norm_1 = nn.LayerNorm(size)
        self.norm_2 = nn.LayerNorm(size)
        self.norm_3 = nn.LayerNorm(size)

    def forward(self, x: Tensor, memory: Tensor, known: Tensor) -> Tensor:
        """Return [L, Q, D] of queries [L, Q, D] and a memory [L, S, D], known [L, S]."""
        y = self.norm_1(x)
        every = torch.ones(x.size(0), x.size(1), dtype=torch.bool, device=x.device)
        x = x + self.own(y, y, every)
        x = x + self.cross(self.norm_2(x), memory, known)
        return x + self.feed_forward(self.norm_3(x))


class Transformer(nn.Module):
    """Encoder layers over a sequence, and decoder layers whose queries attend to its result.

    Args:
        size: D.
        heads: of each attention.
        layers: of the encoder, and of the decoder.
    """

    def __init__(self, size: int, heads: int, layers: int):
        super().__init__()
        self.encoder = nn.ModuleList(EncoderLayer(size, heads) for _ in range(layers))
        self.decoder = nn.ModuleList(DecoderLayer(size, heads) for _ in range(layers))
        self.norm_memory = nn.LayerNorm(size)
        self.norm_out = nn.LayerNorm(size)

    def forward(self, sequence: Tensor, known: Tensor, queries: Tensor) -> Tensor:
        """Return [L, K, D] of a sequence [L, S, D], known [L, S], and queries [L, K, D]."""
        for layer in self.encoder:
            sequence = layer(sequence, known)
        memory = self.norm_memory(sequence)
        for layer in self.decoder:
            queries = layer(queries, memory, known)
        return self.norm_out(queries)
