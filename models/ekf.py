# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Covariances over the horizon: the time update of the extended Kalman filter (eq. 21b)."""

import torch
from torch import Tensor, nn

from models.kernels.block_product import block_product, symmetric
from models.mtp_go_config import ModelConfig


class EkfCovariance(nn.Module):
    r"""P' = F P F^T + G Q G^T over the whole horizon (EKF time update, eq. 21b).

    Second order, by 2x2 blocks of position p and velocity v. With B and D the derivatives of the
    next position and of the next velocity by the velocity (F, eq. 22), and g the noise's gain on
    the position, 0 in the paper (G, eq. 25) and dt^2/2 for ``noise_input="integrated"``::

        P = [P_pp  P_pv]    F = [I  B]    G = [g I ]    G Q G^T = [g^2  Q   g dt Q]
            [P_vp  P_vv]        [0  D]        [dt I]              [g dt Q   dt^2 Q]

        P_pp' = P_pp + P_pv B^T + B P_vp + B P_vv B^T + g^2 Q
        P_pv' =        (P_pv + B P_vv) D^T            + g dt Q
        P_vv' =        D P_vv D^T                     + dt^2 Q

    First order has the position alone: P' = D P D^T + dt^2 Q.

    The blocks are laid out [2, 2, ...] with the batch last, so that a product is a few long vector
    operations. After each step every variance grows by
    ``covariance_inflation``, 0 in the paper.
    """

    inflation: Tensor

    def __init__(self, config: ModelConfig):
        super().__init__()
        self.order = config.order
        dt = config.dt_s
        self.to_q = dt  # G's gain on the highest-order states
        self.to_position = 0.5 * dt * dt if config.noise_input == "integrated" else 0.0  # g
        self.share = config.covariance_inflation
        inflation = config.covariance_inflation * torch.eye(2).view(2, 2, 1, 1, 1)
        self.register_buffer("inflation", inflation, persistent=False)

    def forward(
        self, initial: Tensor, of_q: Tensor, of_position: Tensor, noise: Tensor
    ) -> list[Tensor]:
        """Return the blocks of P at all steps, [2, 2, H, B, N, M] each.

        Args:
            initial: [S, S, B, N] P_0.
            of_q: [2, 2, H, B, N, M] D, the Jacobian of the next highest-order states q by q.
            of_position: [2, 2, H, B, N, M] B, that of the next position by q (second order).
            noise: [2, 2, H, B, N, M] Q (eq. 23).

        Returns:
            P_pp, P_pv and P_vv; in first order P_pp alone.
        """
        p = initial.unsqueeze(-1)
        if self.order == 1:
            positions: list[Tensor] = []
            for d, q in zip(of_q.unbind(2), (self.to_q**2 * noise).unbind(2)):  # noqa: B905
                p = block_product(block_product(d, p), d.transpose(0, 1)) + q
                p = torch.addcmul(p, p, self.inflation)
                positions.append(p)
            return [symmetric(torch.stack(positions, dim=2))]
        pp, pv, vv = p[:2, :2], p[:2, 2:], p[2:, 2:]
        noise_vv = (self.to_q**2 * noise).unbind(2)
        noise_pv = (self.to_q * self.to_position * noise).unbind(2)
        noise_pp = (self.to_position**2 * noise).unbind(2)
        all_pp: list[Tensor] = []
        all_pv: list[Tensor] = []
        all_vv: list[Tensor] = []
        for k, (b, d) in enumerate(zip(of_position.unbind(2), of_q.unbind(2))):  # noqa: B905
            bt, dt = b.transpose(0, 1), d.transpose(0, 1)
            m = pv + block_product(b, vv)
            pp = pp + block_product(m, bt) + block_product(b, pv.transpose(0, 1)) + noise_pp[k]
            pv = block_product(m, dt) + noise_pv[k]
            vv = block_product(block_product(d, vv), dt) + noise_vv[k]
            pp = torch.addcmul(pp, pp, self.inflation)
            vv = torch.addcmul(vv, vv, self.inflation)
            all_pp.append(pp)
            all_pv.append(pv)
            all_vv.append(vv)
        return [
            symmetric(torch.stack(all_pp, dim=2)),
            torch.stack(all_pv, dim=2),
            symmetric(torch.stack(all_vv, dim=2)),
        ]
