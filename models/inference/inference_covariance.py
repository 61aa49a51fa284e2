# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The covariance recursion for inference: whole 4 x 4 matrices, batch last, in few operators."""

import torch
from torch import Tensor, nn

from models.ekf import EkfCovariance


def output_map(floor: float) -> Tensor:
    """Return the [16, 16] linear map of what is done to a rotated P: row 4 a + b is entry (a, b).

    The blocks of position and velocity become symmetric, with ``floor`` times their mean variance
    added to the diagonal; below the diagonal stands what is above it.
    """
    whole = torch.zeros(4, 4, 4, 4, dtype=torch.float64)
    for a in range(4):
        for b in range(4):
            if a // 2 != b // 2:
                whole[a, b, min(a, b), max(a, b)] = 1.0
                continue
            whole[a, b, a, b] += 0.5
            whole[a, b, b, a] += 0.5
            if a == b:
                for c in (2 * (a // 2), 2 * (a // 2) + 1):
                    whole[a, b, c, c] += 0.5 * floor
    return whole.view(16, 16)


class FastCovariance(nn.Module):
    """Equivalent of :class:`models.ekf.EkfCovariance` in second order, up to the network's output.

    With F = [[I, B], [0, D]] and W = [B; D] stacked, F P is W times P's lower half plus, in the
    upper rows, P's upper half; (F P) F^T is the same product on the columns.

    All that follows is linear in P and the same for all modes and steps of an agent: the rotation
    into the scene frame R P R^T, :func:`output_map` and the factor. It is one 16 x 16 matrix per
    agent, and the observation noise is added by the same product.

    Args:
        covariance: the filter.
        observation: [4, 4] covariance of an observed state around the true one.
        scale: factor on the output.
        floor: see :func:`models.own_frame.covariance_frames.rotate_blocks`.
    """

    inflation: Tensor
    spread: Tensor
    output: Tensor
    added: Tensor

    def __init__(self, covariance: EkfCovariance, observation: Tensor, scale: float, floor: float):
        super().__init__()
        g = torch.tensor([covariance.to_position, covariance.to_q], dtype=torch.float64)
        self.register_buffer("spread", torch.outer(g, g).view(2, 1, 2, 1, 1, 1))
        inflation = 1.0 + covariance.share * torch.eye(4, dtype=torch.float64)
        self.register_buffer("inflation", inflation.unsqueeze(-1))
        self.register_buffer("output", scale * output_map(floor))
        self.register_buffer("added", scale * observation.detach().double().flatten())

    def forward(
        self,
        initial: Tensor,
        of_q: Tensor,
        of_position: Tensor,
        noise: Tensor,
        direction: Tensor,
    ) -> Tensor:
        """Return P plus the observation noise [B, N, M, H, 4, 4] in the scene frame, scaled.

        Other arguments as in :meth:`models.ekf.EkfCovariance.forward`.

        Args:
            initial: see there.
            of_q: see there.
            of_position: see there.
            noise: see there; contiguous.
            direction: [B, N, 2] cosine and sine of the agents' frames.
        """
        steps, modes = noise.size(2), noise.size(5)
        scenes, agents = noise.size(3), noise.size(4)
        rest = scenes * agents * modes
        p = initial.unsqueeze(-1).expand(-1, -1, -1, -1, modes).reshape(4, 4, rest)
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
        entries = torch.stack(out).view(steps, 16, scenes * agents, modes)
        entries = entries.permute(2, 3, 0, 1).reshape(scenes * agents, modes * steps, 16)
        whole = torch.baddbmm(self.added, entries, self.in_scene(direction))
        return whole.view(scenes, agents, modes, steps, 4, 4)

    def in_scene(self, direction: Tensor) -> Tensor:
        """Return [B N, 16, 16] what a row of entries of P is multiplied by."""
        cos, sin = direction.flatten(0, 1).unbind(-1)
        none = torch.zeros_like(cos)
        rows = [cos, -sin, none, none, sin, cos, none, none]
        rows += [none, none, cos, -sin, none, none, sin, cos]
        turn = torch.stack(rows, dim=-1).view(-1, 4, 4)
        kron = (turn[:, :, None, :, None] * turn[:, None, :, None, :]).view(-1, 16, 16)
        return torch.matmul(self.output, kron).transpose(1, 2)
