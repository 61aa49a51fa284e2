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


@pytest.mark.parametrize("noise_input", ["velocity", "integrated"])
def test_the_blocks_are_those_of_the_filter(noise_input):
    plain = EkfCovariance(ModelConfig(noise_input=noise_input)).double()
    eye = torch.eye(2).double()
    arguments = (
        definite(B, N, 4).permute(2, 3, 0, 1),
        matrices_last(eye + 0.1 * torch.randn(H, B, N, M, 2, 2).double()),
        matrices_last(0.2 * eye + 0.05 * torch.randn(H, B, N, M, 2, 2).double()),
        matrices_last(definite(H, B, N, M, 2)).contiguous(),
    )
    fast = FastCovariance(plain).double()
    for got, want in zip(fast(*arguments), plain(*arguments), strict=True):
        torch.testing.assert_close(got, want, rtol=1e-10, atol=1e-10)


def test_one_step_of_constant_velocity_by_hand():
    """dt 0.2 s, P_0 = diag(1, 4, 9, 16), Q = I, noise on the velocity alone.

    P_pp = P_pp + dt^2 P_vv, P_pv = dt P_vv, P_vv = P_vv + dt^2 Q; variances grow by the inflation.
    """
    fast = FastCovariance(EkfCovariance(ModelConfig(noise_input="velocity"))).double()
    eye = torch.eye(2).double().view(2, 2, 1, 1, 1, 1)
    p0 = torch.diag(torch.tensor([1.0, 4.0, 9.0, 16.0])).double().view(4, 4, 1, 1)
    got = [block.view(2, 2).tolist() for block in fast(p0, eye, 0.2 * eye, eye)]
    more = 1.0 + INFLATION
    expected = [(1.36 * more, 4.64 * more), (1.8, 3.2), (9.04 * more, 16.04 * more)]
    for block, diagonal in zip(got, expected, strict=True):
        assert [block[0][0], block[1][1]] == pytest.approx(list(diagonal), rel=1e-12)
        assert block[0][1] == block[1][0] == 0.0


def test_covariances_are_exactly_symmetric_in_float32():
    fast = FastCovariance(EkfCovariance(ModelConfig())).float()
    eye = torch.eye(2).view(2, 2, 1, 1, 1, 1)
    noise = matrices_last(definite(H, B, N, M, 2)).float().contiguous()
    of_q = eye + 0.3 * torch.randn(2, 2, H, B, N, M)
    of_position = 0.2 * eye + 0.1 * torch.randn(2, 2, H, B, N, M)
    pp, _, vv = fast(definite(B, N, 4).permute(2, 3, 0, 1).float(), of_q, of_position, noise)
    for block in (pp, vv):
        assert (block[0, 1] == block[1, 0]).all()
