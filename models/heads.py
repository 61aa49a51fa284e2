# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Output layers on the recurrent states, initialised for constant velocity.

Their initial weights are small, see :mod:`models.own_frame.small_linear`.
"""

import math

import torch
from torch import Tensor, nn

from models.mtp_go_config import RHO_LIMIT, SIGMA_FLOOR, ModelConfig
from models.own_frame.small_linear import small_linear

SPREAD = 0.1
"""Radius of the circle of the modes' initial commands (m/s in first, m/s^2 in second order).

Chosen: large enough for the winner-takes-all loss to separate the modes.
"""

FIRST_MODE = 0.2
"""Initial log weight of the first mode; the others have 0 (chosen: barely the likeliest)."""


def inverse_softplus(value: float) -> float:
    """Return the number whose softplus is ``value``."""
    return value + math.log(-math.expm1(-value))


def first_circle(modes: int) -> Tensor:
    """Return [M, 2] initial commands: the first zero, the others evenly on a small circle.

    Equal modes would get equal gradients, and no loss could separate them.
    """
    angle = torch.arange(modes - 1) * (2.0 * math.pi / max(modes - 1, 1))
    first = torch.zeros(modes, 2)
    first[1:] = SPREAD * torch.stack((angle.cos(), angle.sin()), dim=-1)
    return first


def head_linear(size_in: int, size_out: int, conditioned: bool, bias: float = 0.0) -> nn.Linear:
    """Return a head's last layer: :func:`small_linear`, or torch's usual one (unconditioned)."""
    return small_linear(size_in, size_out, bias) if conditioned else nn.Linear(size_in, size_out)


class ControlHead(nn.Module):
    """The motion model's inputs for all modes.

    The initial commands are those of :func:`first_circle`.

    Args:
        hidden: D.
        modes: M.
        controls: numbers per mode; the first two are initially on the circle.
        conditioned: false for torch's usual initial weights.
    """

    def __init__(self, hidden: int, modes: int, controls: int, conditioned: bool = True):
        super().__init__()
        self.modes = modes
        self.controls = controls
        self.body = nn.Linear(hidden, hidden)
        self.out = head_linear(hidden, modes * controls, conditioned)
        if not conditioned:
            return
        with torch.no_grad():
            self.out.bias.view(modes, controls)[1:, :2] = first_circle(modes)[1:]

    def forward(self, h: Tensor) -> Tensor:
        """Return [B, N, M, controls] of the decoder's state [B, N, D]."""
        out = self.out(nn.functional.elu(self.body(h)))
        return out.view(h.size(0), h.size(1), self.modes, self.controls)


class NoiseHead(nn.Module):
    """Process noise Q (eq. 23) from three heads: softplus, softplus, softsign.

    Args:
        hidden: D.
        modes: M.
        floor: added to both deviations (m/s or m/s^2); 0 in the paper.
        limit: factor on softsign; 1 in the paper.
        conditioned: false for torch's usual initial weights.
    """

    def __init__(
        self,
        hidden: int,
        modes: int,
        floor: float = SIGMA_FLOOR,
        limit: float = RHO_LIMIT,
        conditioned: bool = True,
    ):
        super().__init__()
        self.floor = floor
        self.limit = limit
        self.body = nn.Linear(hidden, hidden)
        start = inverse_softplus(max(1.0 - floor, 1e-4))  # above zero
        self.sigma_1 = head_linear(hidden, modes, conditioned, start)
        self.sigma_2 = head_linear(hidden, modes, conditioned, start)
        self.rho = head_linear(hidden, modes, conditioned)

    def forward(self, h: Tensor) -> Tensor:
        """Return Q [2, 2, H, B, N, M] of the decoder's states [H, B, N, D]."""
        body = nn.functional.elu(self.body(h))
        s1 = nn.functional.softplus(self.sigma_1(body)) + self.floor
        s2 = nn.functional.softplus(self.sigma_2(body)) + self.floor
        cross = self.limit * nn.functional.softsign(self.rho(body)) * s1 * s2
        return torch.stack((torch.stack((s1 * s1, cross)), torch.stack((cross, s2 * s2))))


class InitialCovariance(nn.Module):
    """Diagonal P_0 in the agent's frame: from the last encoder state, or configured.

    If it is learned, an agent that was seen only briefly can get a larger P_0 than others.
    """

    std: Tensor

    def __init__(self, config: ModelConfig):
        super().__init__()
        std = [config.initial_std_m] * 2 + [config.initial_std_mps] * 2
        std = std[: config.state_size]
        self.floor = config.noise_floor
        self.register_buffer("std", torch.tensor(std))
        # Without a Kalman filter there is no P_0 to learn.
        self.learned = config.initial_covariance == "learned" and config.ekf
        self.head: nn.Module = nn.Identity()
        if self.learned:
            head = head_linear(config.hidden, config.state_size, config.conditioned)
            if config.conditioned:
                first = [inverse_softplus(max(s - self.floor, 1e-4)) for s in std]  # above zero
                with torch.no_grad():
                    head.bias.copy_(torch.tensor(first))
            self.head = head

    def forward(self, h: Tensor) -> Tensor:
        """Return P_0 [S, S, B, N] of the last encoder states [B, N, D] (m, m/s)."""
        if self.learned:
            std = nn.functional.softplus(self.head(h)) + self.floor
        else:
            std = self.std.expand(h.size(0), h.size(1), -1)
        return torch.diag_embed(std * std).permute(2, 3, 0, 1)


class MixtureHead(nn.Module):
    """Log mixture weights from the last encoder state, constant over the horizon (eq. 26).

    The first mode, initially constant velocity, initially has the largest weight (docs/design.md,
    decisions 10 and 16).
    """

    def __init__(self, hidden: int, modes: int, conditioned: bool = True):
        super().__init__()
        self.out = head_linear(hidden, modes, conditioned)
        if conditioned:
            with torch.no_grad():
                self.out.bias[0] = FIRST_MODE

    def forward(self, h: Tensor) -> Tensor:
        """Return [B, N, M] of [B, N, D]."""
        return torch.log_softmax(self.out(nn.functional.elu(h)), dim=-1)
