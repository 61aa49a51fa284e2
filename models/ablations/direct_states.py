# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""States that the decoder gives directly, without a motion model."""

import torch
from torch import Tensor, nn

from models.mtp_go_config import ModelConfig
from models.own_frame.agent_frames import Start


class DirectStates(nn.Module):
    """The decoder's own states (ablation ``ode=False``).

    They are given as differences from uniform motion at the velocity of t, so that this model
    begins at constant velocity as well; an unconditioned network gives the states themselves.

    Attributes:
        controls: numbers that the decoder gives per mode and step, S.
    """

    def __init__(self, config: ModelConfig):
        super().__init__()
        self.dt_s = config.dt_s
        self.order = config.order
        self.relative = config.conditioned
        self.controls = config.state_size

    def forward(self, control: Tensor, start: Start, step: int) -> Tensor:
        """Return the states [B, N, M, S] at ``step``, in the agents' frames.

        Args:
            control: [B, N, M, S] of the decoder (m, m/s).
            start: positions and velocities at t.
            step: horizon step, counted from 1.
        """
        if not self.relative:
            return control
        expected = start.position + start.velocity * (step * self.dt_s)
        if self.order == 2:
            expected = torch.cat((expected, start.velocity), dim=-1)
        return expected.unsqueeze(2) + control
