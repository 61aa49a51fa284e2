# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The GRU's update against its equation, and its gradient."""

import torch
from kernel_checks import check_kernel, draw

from models.kernels.gru_update import GRUUpdate, gru_update, plain_gru_update

GIVEN = draw((2, 3, 12), (2, 3, 12), (12,), (2, 3, 4))


def test_value_and_gradient():
    check_kernel(GRUUpdate, plain_gru_update, GIVEN)


def test_the_equation_gate_by_gate():
    kappa, xi, bias, h = GIVEN
    (kr, kz, kh), (xr, xz, xh) = kappa.chunk(3, dim=-1), xi.chunk(3, dim=-1)
    br, bz, bh = bias.chunk(3)
    r, z = torch.sigmoid(kr + xr + br), torch.sigmoid(kz + xz + bz)
    expected = (1.0 - z) * torch.tanh(kh + r * xh + bh) + z * h
    torch.testing.assert_close(plain_gru_update(*GIVEN), expected)


def test_mixed_types_take_the_plain_function():
    """As autocast hands them over; the kernel's gradient would have the wrong type."""
    kappa, xi, bias, h = (x.float().requires_grad_() for x in GIVEN)
    assert gru_update(kappa, xi, bias, h).grad_fn.name() == "GRUUpdateBackward"
    assert gru_update(kappa.bfloat16(), xi, bias, h).grad_fn.name() != "GRUUpdateBackward"
