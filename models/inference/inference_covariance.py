# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The covariance recursion for inference: whole 4 x 4 matrices, batch last, in few operators."""

import torch
from torch import Tensor, nn

from models.ekf import EkfCovariance
from models.kernels.block_product import symmetric


class FastCovariance(nn.Module):
    """Equivalent of :class:`models.ekf.EkfCovariance` in second order.

    With F = [[I, B], [0, D]] and W = [B; D] stacked, F P is W times P's lower half plus, in the
    upper rows, P's upper half; (F P) F^T is the same product on the columns.
    """

    inflation: Tensor
    spread: Tensor

    def __init__(self, covariance: EkfCovariance):
        super().__init__()
        g = torch.tensor([covariance.to_position, covariance.to_q], dtype=torch.float64)
        self.register_buffer("spread", torch.outer(g, g).view(2, 1, 2, 1, 1, 1))
        inflation = 1.0 + covariance.share * torch.eye(4, dtype=torch.float64)
        self.register_buffer("inflation", inflation.unsqueeze(-1))

    def forward(
        self, initial: Tensor, of_q: Tensor, of_position: Tensor, noise: Tensor
    ) -> list[Tensor]:
        """Return the blocks of P, [2, 2, H, B, N, M] each.

        Arguments as in :meth:`models.ekf.EkfCovariance.forward`; ``noise`` must be contiguous.
        """
        steps, rest = noise.size(2), noise.size(3) * noise.size(4) * noise.size(5)
        p = initial.unsqueeze(-1).expand(-1, -1, -1, -1, noise.size(5)).reshape(4, 4, rest)
        flat = noise.reshape(1, 2, 1, 2, steps, rest)
        added = (self.spread * flat).view(4, 4, steps, rest).unbind(2)
        both = torch.cat((of_position, of_q)).view(4, 2, steps, rest)
        w0, w1 = both[:, 0:1].unbind(2), both[:, 1:2].unbind(2)
        turned = both.transpose(0, 1)
        t0, t1 = turned[0:1].unbind(2), turned[1:2].unbind(2)
        out: list[Tensor] = []
        for k, q in enumerate(added):
            upper, row2, row3 = p.split([2, 1, 1])
            fp = torch.mul(w0[k], row2).addcmul_(w1[k], row3)
            fp[:2].add_(upper)
            left, column2, column3 = fp.split([2, 1, 1], dim=1)
            p = torch.addcmul(q, column2, t0[k]).addcmul_(column3, t1[k])
            p[:, :2].add_(left)
            p.mul_(self.inflation)
            out.append(p)
        whole = torch.stack(out, dim=2)
        size = [4, 4, steps, noise.size(3), noise.size(4), noise.size(5)]
        whole = whole.view(size)
        return [symmetric(whole[:2, :2]), whole[:2, 2:], symmetric(whole[2:, 2:])]
