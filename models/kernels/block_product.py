# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Products of 2x2 matrices that are laid out [2, 2, ...], with the batch last.

In this layout a product of many small matrices is a few long vector operations.

Why the gradient is written out: autograd differentiates the slices and sums one by one; the two
matrix products G y^T and x^T G take far fewer operators.
"""

from typing import Any

import torch
from torch import Tensor


def plain_block_product(x: Tensor, y: Tensor) -> Tensor:
    """Return [2, 2, ...] z_ik = sum_j x_ij y_jk of two arrays of 2x2 matrices."""
    return x[:, :1] * y[:1] + x[:, 1:] * y[1:]


class BlockProduct(torch.autograd.Function):
    """:func:`plain_block_product` with its gradient."""

    @staticmethod
    def forward(ctx: Any, x: Tensor, y: Tensor) -> Tensor:
        """See :func:`plain_block_product`."""
        ctx.save_for_backward(x, y)
        return plain_block_product(x, y)

    @staticmethod
    def backward(ctx: Any, *grads: Tensor) -> tuple[Tensor | None, Tensor | None]:
        """Return G y^T and x^T G, summed over what was broadcast."""
        x, y = ctx.saved_tensors
        g_x = g_y = None
        if ctx.needs_input_grad[0]:
            g_x = plain_block_product(grads[0], y.transpose(0, 1)).sum_to_size(x.shape)
        if ctx.needs_input_grad[1]:
            g_y = plain_block_product(x.transpose(0, 1), grads[0]).sum_to_size(y.shape)
        return g_x, g_y


def block_product(x: Tensor, y: Tensor) -> Tensor:
    """Return :func:`plain_block_product`, by the kernel where autograd runs."""
    if torch.jit.is_scripting():
        return plain_block_product(x, y)
    return BlockProduct.apply(x, y)


def symmetric(x: Tensor) -> Tensor:
    """Return [2, 2, ...] the symmetric parts."""
    return 0.5 * (x + x.transpose(0, 1))
