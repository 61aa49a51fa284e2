# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Covariances over the horizon: the time update of the extended Kalman filter (eq. ekf).

All matrices are handled as 2x2 blocks laid out [2, 2, ...] with the batch last, so that a product
is a few long vector operations. The blocks of a second-order P are position A, position-velocity C
and velocity V.
"""

from typing import Any

import torch
from torch import Tensor, nn

from models.mtp_go_config import ModelConfig
from models.network_config import NetworkConfig

INFLATION = 1e-5
"""Share of each variance that is added to it in every step.

Float32 keeps a matrix definite only down to relative eigenvalues of some 1e-6; a P_0 of
millimetres under a motion of a hundred metres is beyond that. The share widens a standard
deviation by 0.013 % over 25 steps, and covariances stay positive definite (design D9).
"""

FLOOR = 1e-6
"""Share of a block's mean variance added on its diagonal after the rotation to the scene frame."""


def _block_product(x: Tensor, y: Tensor) -> Tensor:
    return x[:, :1] * y[:1] + x[:, 1:] * y[1:]


class BlockProduct(torch.autograd.Function):
    """:func:`block_product` with its short gradient: autograd's own takes far more ops."""

    @staticmethod
    def forward(ctx: Any, x: Tensor, y: Tensor) -> Tensor:
        """See :func:`block_product`."""
        ctx.save_for_backward(x, y)
        return _block_product(x, y)

    @staticmethod
    def backward(ctx: Any, *grads: Tensor) -> tuple[Tensor | None, Tensor | None]:
        """G y^T and x^T G."""
        x, y = ctx.saved_tensors
        g_x = g_y = None
        if ctx.needs_input_grad[0]:
            g_x = _block_product(grads[0], y.transpose(0, 1)).sum_to_size(x.shape)
        if ctx.needs_input_grad[1]:
            g_y = _block_product(x.transpose(0, 1), grads[0]).sum_to_size(y.shape)
        return g_x, g_y


def block_product(x: Tensor, y: Tensor) -> Tensor:
    """[2, 2, ...] product of two arrays of 2x2 matrices."""
    if torch.jit.is_scripting():
        return _block_product(x, y)
    return BlockProduct.apply(x, y)


def symmetric(x: Tensor) -> Tensor:
    """[2, 2, ...] the symmetric part."""
    return 0.5 * (x + x.transpose(0, 1))


class EkfCovariance(nn.Module):
    """P' = F P F^T + G Q G^T over the whole horizon."""

    inflation: Tensor

    def __init__(self, config: ModelConfig):
        super().__init__()
        self.order = config.order
        dt = config.dt_s
        self.to_q = dt  # G's lower block
        self.to_position = 0.5 * dt * dt if config.noise_input == "integrated" else 0.0
        inflation = INFLATION * torch.eye(2).view(2, 2, 1, 1, 1)
        self.register_buffer("inflation", inflation, persistent=False)

    def forward(
        self, initial: Tensor, of_q: Tensor, of_position: Tensor, noise: Tensor
    ) -> list[Tensor]:
        """The blocks of P at all steps, [2, 2, H, B, N, M] each: A, C, V; in first order A alone.

        Args:
            initial: [S, S, B, N] P_0.
            of_q: [2, 2, H, B, N, M] Jacobian of the next q by q.
            of_position: [2, 2, H, B, N, M] Jacobian of the next position by q (second order).
            noise: [2, 2, H, B, N, M] Q.
        """
        p = initial.unsqueeze(-1)
        if self.order == 1:
            positions: list[Tensor] = []
            a = p
            for d, q in zip(of_q.unbind(2), (self.to_q**2 * noise).unbind(2)):  # noqa: B905
                a = block_product(block_product(d, a), d.transpose(0, 1)) + q
                a = torch.addcmul(a, a, self.inflation)
                positions.append(a)
            return [symmetric(torch.stack(positions, dim=2))]
        a, c, v = p[:2, :2], p[:2, 2:], p[2:, 2:]
        into_v = (self.to_q**2 * noise).unbind(2)
        into_c = (self.to_q * self.to_position * noise).unbind(2)
        into_a = (self.to_position**2 * noise).unbind(2)
        blocks_a: list[Tensor] = []
        blocks_c: list[Tensor] = []
        blocks_v: list[Tensor] = []
        for k, (b, d) in enumerate(zip(of_position.unbind(2), of_q.unbind(2))):  # noqa: B905
            bt, dt = b.transpose(0, 1), d.transpose(0, 1)
            m = c + block_product(b, v)
            a = a + block_product(m, bt) + block_product(b, c.transpose(0, 1)) + into_a[k]
            c = block_product(m, dt) + into_c[k]
            v = block_product(block_product(d, v), dt) + into_v[k]
            a = torch.addcmul(a, a, self.inflation)
            v = torch.addcmul(v, v, self.inflation)
            blocks_a.append(a)
            blocks_c.append(c)
            blocks_v.append(v)
        return [
            symmetric(torch.stack(blocks_a, dim=2)),
            torch.stack(blocks_c, dim=2),
            symmetric(torch.stack(blocks_v, dim=2)),
        ]


class DirectCovariance(nn.Module):
    """The decoder's own covariance of the position (ablation ``ekf=False``).

    The position's covariance k steps ahead is (k dt)^2 Q_k, so that an untrained model is already
    less certain of what is farther off. The paper predicts no more than that; to fill the state's
    S x S matrix, the velocity gets Q_k, the spread of velocities that alone would explain the
    position's, and no correlation with it. Such a model is trained by the position's likelihood.
    """

    def __init__(self, config: NetworkConfig):
        super().__init__()
        self.order = config.state_size // 2
        self.dt_s = config.dt_s

    def forward(
        self, initial: Tensor, of_q: Tensor, of_position: Tensor, noise: Tensor
    ) -> list[Tensor]:
        """The blocks at all steps as in :class:`EkfCovariance`; only ``noise`` is used."""
        steps = torch.arange(1, noise.size(2) + 1, dtype=noise.dtype, device=noise.device)
        position = noise * (self.dt_s * steps).square().view(1, 1, -1, 1, 1, 1)
        if self.order == 1:
            return [position]
        return [position, torch.zeros_like(noise), noise]


def rotate_blocks(blocks: list[Tensor], direction: Tensor) -> Tensor:
    """[B, N, M, H, S, S] covariance in the scene frame.

    Args:
        blocks: [2, 2, H, B, N, M] each, in the agents' frames.
        direction: [B, N, 2] cosine and sine of the agents' frames.
    """
    cos, sin = direction.unsqueeze(2).unbind(-1)
    turn = torch.stack((torch.stack((cos, -sin)), torch.stack((sin, cos)))).unsqueeze(2)
    back = turn.transpose(0, 1)
    turned = [block_product(block_product(turn, block), back) for block in blocks]
    a = _firm(turned[0])
    if len(turned) == 1:
        return a.permute(3, 4, 5, 2, 0, 1).contiguous()
    c, v = turned[1], _firm(turned[2])
    rows = (torch.cat((a, c), dim=1), torch.cat((c.transpose(0, 1), v), dim=1))
    return torch.cat(rows, dim=0).permute(3, 4, 5, 2, 0, 1).contiguous()


def _firm(block: Tensor, floor: float = FLOOR) -> Tensor:
    """The symmetric part with a little of the mean variance added to the diagonal."""
    eye = torch.eye(2, dtype=block.dtype, device=block.device).view(2, 2, 1, 1, 1, 1)
    return symmetric(block) + (0.5 * floor) * (block[0, 0] + block[1, 1]) * eye


def initial_in_own_frame(given: Tensor, learned: Tensor, direction: Tensor) -> Tensor:
    """[S, S, B, N] P_0 in the agents' frames.

    Args:
        given: [B, N, S, S] in the scene frame, for instance the tracker's; an agent with an entry
            that is not finite takes the learned one.
        learned: [S, S, B, N] in the agents' frames.
        direction: [B, N, 2] cosine and sine of the agents' frames.
    """
    known = torch.isfinite(given).all(dim=-1).all(dim=-1)
    p = torch.where(known[:, :, None, None], given, torch.zeros_like(given)).permute(2, 3, 0, 1)
    cos, sin = direction.unbind(-1)
    turn = torch.stack((torch.stack((cos, sin)), torch.stack((-sin, cos))))
    back = turn.transpose(0, 1)
    order = p.size(0) // 2
    rows: list[Tensor] = []
    for i in range(order):
        row: list[Tensor] = []
        for j in range(order):
            block = p[2 * i : 2 * i + 2, 2 * j : 2 * j + 2]
            row.append(block_product(block_product(turn, block), back))
        rows.append(torch.cat(row, dim=1))
    own = torch.cat(rows, dim=0)
    return torch.where(known, 0.5 * (own + own.transpose(0, 1)), learned)
