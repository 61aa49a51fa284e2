# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The covariance recursion on whole matrices against the one on blocks, and by hand."""

import pytest
import torch
from motion_samples import B, H, M, N, definite, matrices_last

from models import ModelConfig
from models.ekf import EkfCovariance
from models.inference.inference_covariance import FastCovariance
from models.mtp_go_config import INFLATION
from models.own_frame.covariance_frames import FLOOR, rotate_blocks

NO_NOISE = torch.zeros(4, 4)


def directions():
    angle = torch.linspace(-3.0, 3.0, B * N).double().view(B, N)
    return torch.stack((angle.cos(), angle.sin()), dim=-1)


@pytest.mark.parametrize("noise_input", ["velocity", "integrated"])
@pytest.mark.parametrize("floor", [FLOOR, 0.05, 0.0])
def test_the_output_is_that_of_the_filter_in_the_scene_frame(noise_input, floor):
    plain = EkfCovariance(ModelConfig(noise_input=noise_input)).double()
    eye = torch.eye(2).double()
    arguments = (
        definite(B, N, 4).permute(2, 3, 0, 1),
        matrices_last(eye + 0.1 * torch.randn(H, B, N, M, 2, 2).double()),
        matrices_last(0.2 * eye + 0.05 * torch.randn(H, B, N, M, 2, 2).double()),
        matrices_last(definite(H, B, N, M, 2)).contiguous(),
    )
    observation = definite(4)
    fast = FastCovariance(plain, observation, scale=2.0, floor=floor).double()
    want = rotate_blocks(plain(*arguments), directions(), floor)
    got = fast(*arguments, directions())
    torch.testing.assert_close(got, 2.0 * (want + observation), rtol=1e-10, atol=1e-10)


def test_one_step_of_constant_velocity_by_hand():
    """dt 0.2 s, P_0 = diag(1, 4, 9, 16), Q = I, noise on the velocity alone.

    P_pp = P_pp + dt^2 P_vv, P_pv = dt P_vv, P_vv = P_vv + dt^2 Q; variances grow by the inflation.
    """
    plain = EkfCovariance(ModelConfig(noise_input="velocity"))
    fast = FastCovariance(plain, NO_NOISE, scale=1.0, floor=0.0).double()
    eye = torch.eye(2).double().view(2, 2, 1, 1, 1, 1)
    p0 = torch.diag(torch.tensor([1.0, 4.0, 9.0, 16.0])).double().view(4, 4, 1, 1)
    ahead = torch.tensor([[[1.0, 0.0]]]).double()
    got = fast(p0, eye, 0.2 * eye, eye, ahead).view(4, 4)
    more = 1.0 + INFLATION
    expected = more * torch.diag(torch.tensor([1.36, 4.64, 9.04, 16.04], dtype=torch.float64))
    expected[0, 2] = expected[2, 0] = 1.8
    expected[1, 3] = expected[3, 1] = 3.2
    torch.testing.assert_close(got, expected, rtol=1e-12, atol=0.0)


def test_a_quarter_turn_swaps_the_axes():
    """An agent that looks along y: what is ahead of it (1, 9) is y in the scene."""
    plain = EkfCovariance(ModelConfig(noise_input="velocity"))
    fast = FastCovariance(plain, NO_NOISE, scale=1.0, floor=0.0).double()
    turn = fast.in_scene(torch.tensor([[[0.0, 1.0]]]).double())
    own = torch.diag(torch.tensor([1.0, 4.0, 9.0, 16.0])).double()
    got = (own.view(1, 1, 16) @ turn).view(4, 4)
    torch.testing.assert_close(got.diagonal(), torch.tensor([4.0, 1.0, 16.0, 9.0]).double())


def test_covariances_are_exactly_symmetric_in_float32():
    plain = EkfCovariance(ModelConfig())
    fast = FastCovariance(plain, NO_NOISE, scale=1.0, floor=FLOOR).float()
    eye = torch.eye(2).view(2, 2, 1, 1, 1, 1)
    noise = matrices_last(definite(H, B, N, M, 2)).float().contiguous()
    of_q = eye + 0.3 * torch.randn(2, 2, H, B, N, M)
    of_position = 0.2 * eye + 0.1 * torch.randn(2, 2, H, B, N, M)
    initial = definite(B, N, 4).permute(2, 3, 0, 1).float()
    got = fast(initial, of_q, of_position, noise, directions().float())
    assert (got == got.transpose(-1, -2)).all()
