# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The output layers: where they begin, and the ranges that they cannot leave."""

import math

import pytest
import torch

from models import ModelConfig
from models.heads import (
    FIRST_MODE,
    SPREAD,
    ControlHead,
    InitialCovariance,
    MixtureHead,
    NoiseHead,
    inverse_softplus,
)
from models.mtp_go_config import RHO_LIMIT, SIGMA_FLOOR

B, N, D = 2, 3, 4


@pytest.mark.parametrize("value", [1e-4, 0.01, 1.0, 30.0])
def test_softplus_is_inverted(value):
    assert math.log1p(math.exp(inverse_softplus(value))) == pytest.approx(value, rel=1e-9)


@torch.no_grad()
def test_commands_begin_with_zero_and_a_circle():
    """Of five modes the other four begin a quarter turn apart; a third number begins at zero."""
    head = ControlHead(D, 5, 3)
    head.out.weight.zero_()
    circle = [[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]]
    expected = torch.tensor([[0, 0, 0], *circle]) * SPREAD
    got = head(torch.randn(B, N, D))
    torch.testing.assert_close(got, expected.expand(B, N, 5, 3), rtol=0.0, atol=1e-7)


def test_a_single_mode_begins_with_zero():
    assert not ControlHead(D, 1, 2).out.bias.any()


@torch.no_grad()
def test_process_noise_begins_as_the_identity():
    head = NoiseHead(D, 2).double()
    for out in (head.sigma_1, head.sigma_2, head.rho):
        out.weight.zero_()
    q = head(torch.randn(5, B, N, D).double())
    expected = torch.eye(2).double().view(2, 2, 1, 1, 1, 1).expand(2, 2, 5, B, N, 2)
    torch.testing.assert_close(q, expected, rtol=1e-6, atol=1e-6)


@torch.no_grad()
def test_process_noise_by_hand():
    """Eq. 23 with sigma_1 = 2, sigma_2 = 3 and rho = 0.999 * 1 / (1 + 1)."""
    head = NoiseHead(D, 1).double()
    for out, value in (
        (head.sigma_1, inverse_softplus(2.0 - SIGMA_FLOOR)),
        (head.sigma_2, inverse_softplus(3.0 - SIGMA_FLOOR)),
        (head.rho, 1.0),
    ):
        out.weight.zero_()
        out.bias.fill_(value)
    q = head(torch.randn(1, 1, 1, D).double()).view(2, 2)
    cross = 0.5 * RHO_LIMIT * 6.0
    torch.testing.assert_close(q, torch.tensor([[4.0, cross], [cross, 9.0]]).double())


@torch.no_grad()
def test_process_noise_stays_definite_for_extreme_states():
    head = NoiseHead(D, 3)
    for parameter in head.parameters():
        parameter.normal_(0.0, 100.0)
    q = head(100.0 * torch.randn(4, B, N, D)).permute(2, 3, 4, 5, 0, 1)
    assert (q.diagonal(dim1=-2, dim2=-1) >= SIGMA_FLOOR**2 * (1 - 1e-6)).all()
    assert not torch.linalg.cholesky_ex(q).info.any()


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("kind", ["learned", "configured"])
@torch.no_grad()
def test_the_initial_covariance_begins_at_the_configured_deviations(kind, order):
    config = ModelConfig(
        hidden=D, order=order, initial_covariance=kind, initial_std_m=0.5, initial_std_mps=2.0
    )
    head = InitialCovariance(config)
    if kind == "learned":
        head.head.weight.zero_()
    p0 = head(torch.randn(B, N, D))
    variances = torch.tensor([0.25, 0.25, 4.0, 4.0])[: 2 * order]
    assert p0.shape == (2 * order, 2 * order, B, N)
    torch.testing.assert_close(p0[:, :, 1, 2], torch.diag(variances), rtol=1e-5, atol=1e-6)


def test_there_is_nothing_to_learn_without_a_kalman_filter():
    assert not list(InitialCovariance(ModelConfig(ekf=False)).parameters())
    assert list(InitialCovariance(ModelConfig()).parameters())


@torch.no_grad()
def test_the_first_mode_begins_as_the_likeliest():
    head = MixtureHead(D, 3)
    head.out.weight.zero_()
    torch.nn.init.zeros_(head.out.bias[1:])
    weight = head(torch.randn(B, N, D)).exp()
    first = math.exp(FIRST_MODE)
    expected = torch.tensor([first, 1.0, 1.0]) / (first + 2.0)
    torch.testing.assert_close(weight, expected.expand(B, N, 3))
