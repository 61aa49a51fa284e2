# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The decoder's own covariances."""

import pytest
import torch
from motion_samples import B, M, N, definite, matrices_last

from models import ModelConfig
from models.ablations.direct_covariance import DirectCovariance

H = 25


@pytest.mark.parametrize("order", [1, 2])
def test_direct_covariance(order):
    noise = matrices_last(definite(H, B, N, M, 2))
    blocks = DirectCovariance(ModelConfig(order=order, ekf=False))(noise)
    torch.testing.assert_close(blocks[0][:, :, 9], 4.0 * noise[:, :, 9])  # (10 * 0.2 s)^2
    if order == 2:
        assert not blocks[1].any()
        torch.testing.assert_close(blocks[2], noise)
