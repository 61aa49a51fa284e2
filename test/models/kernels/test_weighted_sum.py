# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The attention's weighted sum, and its gradient."""

import torch
from kernel_checks import check_kernel, draw

from models.kernels.weighted_sum import WeightedSum, plain_weighted_sum, weighted_sum

GIVEN = draw((2, 3, 5), (2, 3, 5, 4))


def test_value_and_gradient():
    check_kernel(WeightedSum, plain_weighted_sum, GIVEN)


def test_the_sum_by_einsum():
    expected = torch.einsum("bnt,bntd->bnd", *GIVEN)
    torch.testing.assert_close(plain_weighted_sum(*GIVEN), expected)


def test_mixed_types_take_the_plain_function():
    weight, encoded = (x.float().requires_grad_() for x in GIVEN)
    assert weighted_sum(weight, encoded).grad_fn.name() == "WeightedSumBackward"
    with torch.autocast("cpu", torch.bfloat16):
        mixed = weighted_sum(weight, encoded.bfloat16())
    assert mixed.grad_fn.name() != "WeightedSumBackward"
