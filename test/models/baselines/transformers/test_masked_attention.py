# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Attention and its layers against those of torch, with the same weights."""

import pytest
import torch
from torch import nn
from torch.nn.functional import scaled_dot_product_attention

from models.baselines.transformers.masked_attention import (
    HIDDEN_FACTOR,
    DecoderLayer,
    EncoderLayer,
    MaskedAttention,
)

SIZE, HEADS = 8, 2


def copy_attention(own, other):
    """Give a module of torch the weights of ours."""
    parts = (own.query, own.key, own.value)
    other.in_proj_weight.copy_(torch.cat([part.weight for part in parts]))
    other.in_proj_bias.copy_(torch.cat([part.bias for part in parts]))
    other.out_proj.load_state_dict(own.out.state_dict())


def copy_layer(own, other, pairs):
    for name, theirs in pairs.items():
        getattr(other, theirs).load_state_dict(own.get_submodule(name).state_dict())


@pytest.fixture
def entries():
    torch.manual_seed(4)
    known = torch.tensor([[True] * 5, [True, False, True, True, False]])
    return torch.randn(2, 3, SIZE).double(), torch.randn(2, 5, SIZE).double(), known


@torch.no_grad()
def test_attention_is_that_of_torch(entries):
    x, memory, known = entries
    own = MaskedAttention(SIZE, HEADS).double()
    other = nn.MultiheadAttention(SIZE, HEADS, batch_first=True).double()
    copy_attention(own, other)
    expected, _ = other(x, memory, memory, key_padding_mask=~known)
    torch.testing.assert_close(own(x, memory, known), expected)


@torch.no_grad()
def test_one_head_is_scaled_dot_product_attention(entries):
    x, memory, known = entries
    own = MaskedAttention(SIZE, 1).double()
    parts = own.query(x), own.key(memory), own.value(memory)
    expected = own.out(scaled_dot_product_attention(*parts, attn_mask=known.unsqueeze(1)))
    torch.testing.assert_close(own(x, memory, known), expected)


def test_nothing_to_look_at_gives_finite_values_and_gradients(entries):
    x, memory, known = entries
    own = MaskedAttention(SIZE, HEADS).double()
    result = own(x, memory, torch.zeros_like(known))
    torch.testing.assert_close(result, own.out.bias.expand_as(result))
    result.sum().backward()
    assert all(torch.isfinite(p.grad).all() for p in own.parameters() if p.grad is not None)


@torch.no_grad()
def test_an_encoder_layer_is_that_of_torch(entries):
    _, memory, known = entries
    own = EncoderLayer(SIZE, HEADS).double()
    other = nn.TransformerEncoderLayer(
        SIZE, HEADS, HIDDEN_FACTOR * SIZE, 0.0, batch_first=True, norm_first=True
    ).double()
    copy_attention(own.attention, other.self_attn)
    names = {"feed_forward.wide": "linear1", "feed_forward.out": "linear2"}
    copy_layer(own, other, names | {"norm_1": "norm1", "norm_2": "norm2"})
    expected = other.train()(memory, src_key_padding_mask=~known)
    torch.testing.assert_close(own(memory, known), expected)


@torch.no_grad()
def test_a_decoder_layer_is_that_of_torch(entries):
    x, memory, known = entries
    own = DecoderLayer(SIZE, HEADS).double()
    other = nn.TransformerDecoderLayer(
        SIZE, HEADS, HIDDEN_FACTOR * SIZE, 0.0, batch_first=True, norm_first=True
    ).double()
    copy_attention(own.own, other.self_attn)
    copy_attention(own.cross, other.multihead_attn)
    names = {"feed_forward.wide": "linear1", "feed_forward.out": "linear2"}
    copy_layer(own, other, names | {f"norm_{i}": f"norm{i}" for i in (1, 2, 3)})
    expected = other(x, memory, memory_key_padding_mask=~known)
    torch.testing.assert_close(own(x, memory, known), expected)
