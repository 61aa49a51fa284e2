# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The Kalman recursion against whole matrices, and definiteness where float32 is worst."""

import pytest
import torch
from motion_samples import definite, matrices_last

from models import ModelConfig
from models.ekf import EkfCovariance
from models.mtp_go_config import INFLATION
from models.own_frame.covariance_frames import FLOOR, rotate_blocks

H, B, N, M = 25, 2, 3, 4


@pytest.mark.parametrize("noise_input", ["velocity", "integrated"])
@pytest.mark.parametrize("order", [1, 2])
def test_recursion_equals_whole_matrices(order, noise_input):
    s, dt, eye = 2 * order, 0.2, torch.eye(2).double()
    ekf = EkfCovariance(ModelConfig(order=order, noise_input=noise_input)).double()
    of_q = eye + 0.1 * torch.randn(H, B, N, M, 2, 2).double()
    of_position = dt * eye + 0.05 * torch.randn(H, B, N, M, 2, 2).double()
    noise, initial = definite(H, B, N, M, 2), definite(B, N, s)
    blocks = ekf(
        initial.permute(2, 3, 0, 1),
        matrices_last(of_q),
        matrices_last(of_position),
        matrices_last(noise),
    )
    angle = torch.randn(B, N).double()
    direction = torch.stack((angle.cos(), angle.sin()), dim=-1)
    got = rotate_blocks(blocks, direction)
    assert got.shape == (B, N, M, H, s, s)
    g = {1: dt * eye, 2: torch.cat((0.5 * dt**2 * eye, dt * eye))}[order]
    if order == 2 and noise_input == "velocity":
        g = torch.cat((0 * eye, dt * eye))
    for b, n, m in ((0, 0, 0), (1, 2, 3), (0, 1, 2)):
        c, d = direction[b, n]
        turn = torch.block_diag(
            *[torch.stack((torch.stack((c, -d)), torch.stack((d, c))))] * order
        )
        p = initial[b, n]
        for k in range(H):
            f = of_q[k, b, n, m]
            if order == 2:
                upper = torch.cat((eye, of_position[k, b, n, m]), dim=1)
                f = torch.cat((upper, torch.cat((0 * eye, f), dim=1)))
            p = f @ p @ f.t() + g @ noise[k, b, n, m] @ g.t()
            p = p + INFLATION * torch.diag(p.diagonal())
            want = turn @ p @ turn.t()
            for block in range(order):
                part = slice(2 * block, 2 * block + 2)
                want[part, part] += 0.5 * FLOOR * want[part, part].trace() * eye
            torch.testing.assert_close(got[b, n, m, k], want, rtol=1e-9, atol=1e-9)


def test_constant_velocity_by_hand():
    """P_0 = diag(1, 4, 9, 16), no noise, F = [[I, dt I], [0, I]]: variances add as (k dt)^2."""
    ekf = EkfCovariance(ModelConfig()).double()
    eye = torch.eye(2).double().view(2, 2, 1, 1, 1, 1).expand(2, 2, 5, 1, 1, 1)
    p0 = torch.diag(torch.tensor([1.0, 4.0, 9.0, 16.0])).double().view(4, 4, 1, 1)
    a, c, v = ekf(p0, eye, 0.2 * eye, 0.0 * eye)
    last = [block[:, :, -1, 0, 0, 0] for block in (a, c, v)]
    close = {"rtol": 1e-4, "atol": 1e-4}
    torch.testing.assert_close(last[0], torch.diag(torch.tensor([10.0, 20.0])).double(), **close)
    torch.testing.assert_close(last[1], torch.diag(torch.tensor([9.0, 16.0])).double(), **close)
    torch.testing.assert_close(last[2], torch.diag(torch.tensor([9.0, 16.0])).double(), **close)


def test_the_papers_noise_input_leaves_the_first_position_alone():
    """The reason for the other choice: one step from P_0 the position is as certain as at t."""
    eye = torch.eye(2).view(2, 2, 1, 1, 1, 1)
    p0 = (torch.diag(torch.tensor([1e-5, 1e-5, 0.0, 0.0]))).view(4, 4, 1, 1)
    for choice, variance in (("velocity", 1e-5), ("integrated", 1e-5 + 0.02**2 * 9.0)):
        a = EkfCovariance(ModelConfig(noise_input=choice))(p0, eye, 0.2 * eye, 9.0 * eye)[0]
        assert float(a[0, 0]) == pytest.approx(variance, rel=1e-3)


def test_definite_in_float32_where_it_is_hardest():
    """Millimetres and tens of metres, correlations next to one, any heading, stiff dynamics."""
    torch.manual_seed(1)
    cases = 400
    config = ModelConfig()
    ekf = EkfCovariance(config)
    std = 10.0 ** torch.empty(4, 1, cases).uniform_(-2.0, 1.5)
    p0 = torch.zeros(4, 4, 1, cases)
    for i in range(4):
        p0[i, i] = std[i] ** 2
    sigma = 10.0 ** torch.empty(2, H, 1, cases, 1).uniform_(-2.0, 1.5)
    rho = 0.999 * torch.empty(H, 1, cases, 1).uniform_(-1.0, 1.0).sign()
    cross = rho * sigma[0] * sigma[1]
    noise = torch.stack((torch.stack((sigma[0] ** 2, cross)), torch.stack((cross, sigma[1] ** 2))))
    eye = torch.eye(2).view(2, 2, 1, 1, 1, 1)
    scale = torch.empty(1, 1, 1, 1, cases, 1).uniform_(0.0, 0.8)
    of_q = eye + scale * torch.randn(2, 2, H, 1, cases, 1)
    of_position = 0.2 * eye + 0.1 * scale * torch.randn(2, 2, H, 1, cases, 1)
    angle = 3.0 * torch.randn(1, cases)
    blocks = ekf(p0, of_q, of_position, noise)
    p = rotate_blocks(blocks, torch.stack((angle.cos(), angle.sin()), dim=-1))
    assert p.dtype == torch.float32
    torch.testing.assert_close(p, p.transpose(-1, -2), rtol=0, atol=0)
    _, failed = torch.linalg.cholesky_ex(p)
    assert not failed.any()
    assert (torch.linalg.eigvalsh(p.double()) > 0).all()
