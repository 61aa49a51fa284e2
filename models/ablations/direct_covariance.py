# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Covariances that the decoder gives directly, without a Kalman filter."""

import torch
from torch import Tensor, nn

from models.network_config import NetworkConfig


class DirectCovariance(nn.Module):
    """The decoder's own covariance of the position (ablation ``ekf=False``, and the baselines).

    The position's covariance k steps ahead is (k dt)^2 Q_k, so that the uncertainty of an
    untrained model already grows along the horizon. The paper predicts the position's covariance
    only; to fill the state's S x S matrix, the velocity gets Q_k, the covariance of a constant
    velocity that would explain the position's, without correlation of the two. Such a model is
    trained by the position's likelihood. An unconditioned network gives Q_k itself.
    """

    def __init__(self, config: NetworkConfig):
        super().__init__()
        self.order = config.state_size // 2
        self.dt_s = config.dt_s
        self.grows = config.is_conditioned

    def forward(self, noise: Tensor) -> list[Tensor]:
        """Return the blocks [2, 2, H, B, N, M] of :class:`models.ekf.EkfCovariance`.

        Args:
            noise: [2, 2, H, B, N, M] Q.
        """
        steps = torch.arange(1, noise.size(2) + 1, dtype=noise.dtype, device=noise.device)
        position = noise
        if self.grows:
            position = noise * (self.dt_s * steps).square().view(1, 1, -1, 1, 1, 1)
        if self.order == 1:
            return [position]
        return [position, torch.zeros_like(noise), noise]
