# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Covariances between the scene frame and each agent's own frame."""

import torch
from torch import Tensor

from models.kernels.block_product import block_product, symmetric

FLOOR = 1e-6
"""Share of a block's mean variance that is added to its diagonal after the rotation.

Chosen: keeps a block that is nearly singular positive definite in float32.
"""


def rotate_blocks(blocks: list[Tensor], direction: Tensor, floor: float = FLOOR) -> Tensor:
    """Return the covariances [B, N, M, H, S, S] in the scene frame.

    Args:
        blocks: [2, 2, H, B, N, M] each, in the agents' frames, as in :mod:`models.ekf`.
        direction: [B, N, 2] cosine and sine of the agents' frames.
        floor: share of each block's mean variance that is added to its diagonal.
    """
    cos, sin = direction.unsqueeze(2).unbind(-1)
    turn = torch.stack((torch.stack((cos, -sin)), torch.stack((sin, cos)))).unsqueeze(2)
    back = turn.transpose(0, 1)
    turned = [block_product(block_product(turn, block), back) for block in blocks]
    a = _with_floor(turned[0], floor)
    if len(turned) == 1:
        return a.permute(3, 4, 5, 2, 0, 1).contiguous()
    c, v = turned[1], _with_floor(turned[2], floor)
    rows = (torch.cat((a, c), dim=1), torch.cat((c.transpose(0, 1), v), dim=1))
    return torch.cat(rows, dim=0).permute(3, 4, 5, 2, 0, 1).contiguous()


def _with_floor(block: Tensor, floor: float) -> Tensor:
    """Return the symmetric part with a share of the mean variance added to the diagonal."""
    eye = torch.eye(2, dtype=block.dtype, device=block.device).view(2, 2, 1, 1, 1, 1)
    return symmetric(block) + (0.5 * floor) * (block[0, 0] + block[1, 1]) * eye


def initial_in_own_frame(given: Tensor, learned: Tensor, direction: Tensor) -> Tensor:
    """Return P_0 [S, S, B, N] in the agents' frames.

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
