# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The energy of GATv2 in blocks of every size, forward and backward."""

import pytest
import torch

import models.kernels.attention_energy as module
from models.kernels.attention_energy import AbsoluteSum, blocks, plain_absolute_sum


def make(length, agents, channels, heads):
    shapes = (
        (length, agents, channels),
        (length, agents, channels),
        (length, agents, agents),
        (channels,),
        (channels, heads),
    )
    return [torch.randn(*shape).double().requires_grad_() for shape in shapes]


@pytest.mark.parametrize("limit", [1, 40, 150, 500, 10**6])
def test_value_and_gradient_do_not_depend_on_the_blocks(limit, monkeypatch):
    monkeypatch.setattr(module, "blocks", lambda a, c: blocks(a, c, limit))
    arguments = make(3, 5, 6, 2)
    got, want = AbsoluteSum.apply(*arguments), plain_absolute_sum(*arguments)
    torch.testing.assert_close(got, want)
    weight = torch.randn_like(want)
    ours = torch.autograd.grad((got * weight).sum(), arguments)
    theirs = torch.autograd.grad((want * weight).sum(), arguments)
    for one, other in zip(ours, theirs, strict=True):
        torch.testing.assert_close(one, other)


def test_blocks_by_hand():
    assert blocks(4, 10, 1000) == (6, 4)  # six graphs of 160 numbers
    assert blocks(10, 10, 1000) == (1, 10)
    assert blocks(10, 10, 350) == (1, 3)  # three rows of a graph of 1000
    assert blocks(10, 10, 50) == (1, 1)


@pytest.mark.parametrize("heads", [1, 2])
def test_autocast_does_not_narrow_it(heads):
    """Mixed precision hands over two types; the wider one counts, forward and backward."""
    torch.manual_seed(3)
    query, key = torch.randn(2, 2, 5, 6, dtype=torch.bfloat16)
    edge, slope, score = torch.rand(2, 5, 5), torch.randn(6), torch.randn(6, heads)
    expected, found = [], []
    for grads, autocast, dtype in ((expected, False, torch.float32), (found, True, None)):
        given = [x.detach().to(dtype or x.dtype) for x in (query, key, edge, slope, score)]
        for x in given:
            x.requires_grad_()
        with torch.autocast("cpu", torch.bfloat16, enabled=autocast):
            out = AbsoluteSum.apply(*given)
        assert out.dtype == torch.float32
        out.square().sum().backward()
        grads.extend([out.detach(), *(x.grad for x in given)])
    for mine, theirs in zip(found, expected, strict=True):
        torch.testing.assert_close(mine, theirs.to(mine.dtype), rtol=1e-2, atol=1e-3)


@pytest.mark.parametrize("heads", [1, 2])
def test_gradient_is_the_numerical_one(heads):
    assert torch.autograd.gradcheck(AbsoluteSum.apply, make(2, 3, 4, heads))


def test_the_sum_pair_by_pair():
    query, key, edge, slope, score = make(2, 3, 4, 2)
    got = plain_absolute_sum(query, key, edge, slope, score)
    for i in range(3):
        for j in range(3):
            z = query[1, i] + key[1, j] + edge[1, i, j] * slope
            torch.testing.assert_close(got[1, i, j], z.abs() @ score)
