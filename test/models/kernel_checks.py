# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What every hand-written gradient is held against: finite differences, and autograd."""

import torch


def draw(*shapes):
    """Double precision tensors of these shapes, always the same."""
    generator = torch.Generator().manual_seed(4)
    return [torch.randn(s, generator=generator, dtype=torch.float64) for s in shapes]


def check_kernel(function, plain, given):
    """Assert that value and gradient of an autograd function equal those of its plain function."""
    leaves = [x.clone().requires_grad_() for x in given]
    torch.testing.assert_close(function.apply(*leaves), plain(*leaves))
    assert torch.autograd.gradcheck(function.apply, leaves)
    found = []
    for apply in (function.apply, plain):
        leaves = [x.float().requires_grad_() for x in given]
        apply(*leaves).sin().sum().backward()
        found.append([x.grad for x in leaves])
    for mine, theirs in zip(*found, strict=True):
        torch.testing.assert_close(mine, theirs)
