# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Products of 2x2 matrices with the batch last, and their gradient."""

import torch
from kernel_checks import check_kernel, draw

from models.kernels.block_product import BlockProduct, block_product, plain_block_product

GIVEN = draw((2, 2, 3, 1, 2), (2, 2, 3, 4, 2))  # broadcast over an axis


def test_value_and_gradient():
    check_kernel(BlockProduct, plain_block_product, GIVEN)


def test_the_product_by_einsum():
    x, y = GIVEN
    torch.testing.assert_close(block_product(x, y), torch.einsum("ik...,kj...->ij...", x, y))
