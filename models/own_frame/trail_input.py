# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The paths that earlier road users took from an agent's place, as input of the decoder.

At each step the decoder sees where each path is after the distance that the agent covers until
then at its present speed, in the same frame and scale as its own state: to follow a path is then
nearly a linear function of the decoder's input. Not in the paper: docs/design.md, "Trails in the
network".
"""

import torch
from torch import Tensor, nn

from models.network_config import NetworkConfig
from models.own_frame.conditioning import DEVIATION_STD
from models.own_frame.small_linear import small_linear

COLUMNS = 5
"""Per path and step: position (2), velocity (2), share."""

SUMMARY_STEPS = 5
"""Steps, evenly spaced over the horizon, that the weights and the decoder's start see (chosen)."""

LARGEST_M = 40.0
"""Largest deviation of a path from straight motion that is told apart (m, chosen)."""


class TrailInput(nn.Module):
    """Inputs made of ``trails`` [B, N, R, H, 3]: offsets ahead and to the left (m), share."""

    std: Tensor

    def __init__(self, config: NetworkConfig, branches: int):
        super().__init__()
        self.dt_s = config.dt_s
        self.largest_m = LARGEST_M
        self.branches = branches
        steps = config.horizon_steps
        self.stride = max(1, steps // SUMMARY_STEPS)
        count = len(range(self.stride - 1, steps, self.stride))
        self.register_buffer("std", torch.tensor([*DEVIATION_STD, 1.0]), persistent=False)
        # Small, so that without training trails change nothing.
        self.embed = small_linear(self.branches * COLUMNS, config.hidden, bias=None)
        self.body = nn.Linear(self.branches * COLUMNS * count, config.hidden)
        self.out = small_linear(config.hidden, config.hidden)

    def forward(self, trails: Tensor | None) -> tuple[Tensor, Tensor]:
        """Return scaled inputs [H, B, N, R * 5] of all steps, and a summary [B, N, D].

        Raises:
            ValueError: no trails are given.
        """
        if trails is None:
            raise ValueError(
                "the network has trail_branches but is given no trails, expected [B, N, R, H, 3]"
            )
        offset = trails[..., :2].clamp(-self.largest_m, self.largest_m)
        share = trails[..., 2:]
        before = torch.cat((torch.zeros_like(offset[..., :1, :]), offset[..., :-1, :]), dim=-2)
        velocity = (offset - before) / self.dt_s * (share > 0.0)
        columns = torch.cat((offset, velocity, share), dim=-1) / self.std  # [B, N, R, H, 5]
        some = columns[..., self.stride - 1 :: self.stride, :].flatten(2)
        summary = self.out(nn.functional.elu(self.body(some)))
        return columns.permute(3, 0, 1, 2, 4).flatten(3), summary
