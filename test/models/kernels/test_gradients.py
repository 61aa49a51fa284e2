# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Gradients that are written out, against numerical ones and against autograd's."""

import pytest
import torch

from models.graph_gru import GRUUpdate, gru_update
from models.temporal_attention import WeightedSum, weighted_sum


def draw(*shapes):
    generator = torch.Generator().manual_seed(4)
    return [torch.randn(s, generator=generator, dtype=torch.float64) for s in shapes]


CASES = {
    "gru": (GRUUpdate, gru_update, draw((2, 3, 12), (2, 3, 12), (12,), (2, 3, 4))),
    "sum": (WeightedSum, weighted_sum, draw((2, 3, 5), (2, 3, 5, 4))),
}


@pytest.mark.parametrize("name", CASES)
def test_gradient_is_the_numerical_one(name):
    function, plain, given = CASES[name]
    given = [x.clone().requires_grad_() for x in given]
    torch.testing.assert_close(function.apply(*given), plain(*given))
    assert torch.autograd.gradcheck(function.apply, given)


@pytest.mark.parametrize("name", CASES)
def test_gradient_is_that_of_autograd(name):
    function, plain, given = CASES[name]
    found = []
    for apply in (function.apply, plain):
        leaves = [x.float().requires_grad_() for x in given]
        apply(*leaves).sin().sum().backward()
        found.append([x.grad for x in leaves])
    for mine, theirs in zip(*found, strict=True):
        torch.testing.assert_close(mine, theirs)
