# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Inputs of the network: features and motion in the agent's own frame, scaled."""

import torch
from torch import Tensor, nn

from models.network_config import NetworkConfig
from models.own_frame.agent_frames import Start, last_seen, start_in_own_frames, to_own

OWN_STD = (3.0, 1.0, 10.0, 2.0, 2.0, 1.0, 1.0, 1.0, 0.2, 0.2)
"""Scales of the ten own-frame inputs before statistics are set (m, m/s, m/s^2, 1; chosen).

In the order of :meth:`Conditioning.own_inputs`.
"""

FEATURE_STD = (30.0, 10.0, 10.0, 5.0, 1.0, 1.0, 1.0, 1.0)
"""Scales of the base features before statistics are set (m, m/s, m/s^2, 1; chosen).

Context features begin with 1.
"""

DEVIATION_STD = (5.0, 2.0, 3.0, 1.0)
"""Scales of the decoder's states as deviations from uniform motion (m, m/s; chosen)."""

STATE_STD = (30.0, 10.0, 10.0, 5.0)
"""Scales of the decoder's states in the scene frame before statistics are set (m, m/s; chosen)."""

LEAST_STD = 0.02
"""Least scale of an input: a constant feature is not amplified (chosen)."""


class Conditioning(nn.Module):
    """Scaled inputs of encoder and decoder, and the start of the roll-out (decision 16).

    The scales are buffers, so an exported model contains them.

    Attributes:
        input_mean: [input_size] of the encoder's inputs.
        input_std: [input_size].
        state_mean: [S] of the states that the decoder sees.
        state_std: [S].
    """

    input_mean: Tensor
    input_std: Tensor
    state_mean: Tensor
    state_std: Tensor

    def __init__(self, config: NetworkConfig):
        super().__init__()
        self.agent_frame = config.agent_frame
        self.dt_s = config.dt_s
        self.order = config.state_size // 2
        context = (1.0,) * (config.feature_size - len(FEATURE_STD))
        self.scaled = config.is_conditioned
        base = (FEATURE_STD + context)[: config.feature_size]
        std = base + (OWN_STD if config.agent_frame else ())
        # In the agent's frame the decoder sees the deviation from uniform motion.
        state: tuple[float, ...] = DEVIATION_STD if config.agent_frame else STATE_STD
        if not self.scaled:
            std, state = (1.0,) * len(std), (1.0,) * len(state)
        self.register_buffer("input_mean", torch.zeros(len(std)))
        self.register_buffer("input_std", torch.tensor(std))
        self.register_buffer("state_mean", torch.zeros(config.state_size))
        self.register_buffer("state_std", torch.tensor(state[: config.state_size]))

    @property
    def input_size(self) -> int:
        """Number of channels of the encoder's input."""
        return int(self.input_std.numel())

    def start(self, features: Tensor, valid: Tensor) -> Start:
        """Return the roll-out's start from features [B, N, T, F], zero where not valid.

        An agent that is absent at t starts from its last sample; its prediction is not used.
        """
        last, _ = last_seen(features, valid)
        position, velocity = last[..., :2], last[..., 2:4]
        if self.agent_frame:
            return start_in_own_frames(position, velocity, last[..., 6:8])
        direction = torch.zeros_like(position)
        direction[..., 0] = 1.0
        return Start(torch.zeros_like(position), direction, position, velocity)

    def own_inputs(self, features: Tensor, valid: Tensor, start: Start) -> Tensor:
        """Return [B, N, T, 10] each agent's motion in its own frame.

        Position minus uniform motion through the last sample (2), velocity (2), velocity minus the
        last velocity (2), acceleration (2), cosine and sine of the yaw (2). The differences keep a
        slow drift visible next to ninety metres of travel.
        """
        _, index = last_seen(features, valid)
        steps = torch.arange(features.size(2), device=features.device)
        since = (steps - index.unsqueeze(-1)).unsqueeze(-1).to(features.dtype) * self.dt_s
        direction = start.direction.unsqueeze(2).expand(-1, -1, features.size(2), -1)
        last_velocity = start.velocity.unsqueeze(2)
        moved = to_own(features[..., :2] - start.origin.unsqueeze(2), direction)
        velocity = to_own(features[..., 2:4], direction)
        parts = (
            moved - last_velocity * since,
            velocity,
            velocity - last_velocity,
            to_own(features[..., 4:6], direction),
            to_own(features[..., 6:8], direction),
        )
        return torch.cat(parts, dim=-1)

    def inputs(self, features: Tensor, valid: Tensor, start: Start) -> Tensor:
        """Return [B, N, T, input_size] unscaled inputs of the encoder, meaningful where valid."""
        if self.agent_frame:
            return torch.cat((features, self.own_inputs(features, valid, start)), dim=-1)
        return features

    def forward(self, features: Tensor, valid: Tensor, start: Start) -> Tensor:
        """Return [B, N, T, input_size] scaled inputs of the encoder, zero where not valid."""
        scaled = (self.inputs(features, valid, start) - self.input_mean) / self.input_std
        return scaled * valid.unsqueeze(-1)

    def encoder_inputs(
        self, features: Tensor, valid: Tensor, static: Tensor, with_static: bool
    ) -> tuple[Tensor, Tensor, Start]:
        """Return what every network begins with.

        Args:
            features: [B, N, T, F], any value where not valid.
            valid: [B, N, T].
            static: [B, N, C] static features.
            with_static: append them to the inputs.

        Returns:
            Features that are zero where not valid; scaled inputs of the encoder
            [B, N, T, input_size (+ C)]; the roll-out's start.
        """
        features = torch.where(valid.unsqueeze(-1), features, torch.zeros_like(features))
        start = self.start(features, valid)
        inputs = self.forward(features, valid, start)
        if with_static:
            inputs = self.append_static(inputs, static, valid)
        return features, inputs, start

    def append_static(self, inputs: Tensor, static: Tensor, valid: Tensor) -> Tensor:
        """Return [B, N, T, . + C] inputs with the static features [B, N, C], zero if not valid."""
        repeated = static.unsqueeze(2).expand(-1, -1, inputs.size(2), -1)
        return torch.cat((inputs, repeated * valid.unsqueeze(-1)), dim=-1)

    def scale_states(self, states: Tensor, start: Start, step: int) -> Tensor:
        """Return [B, N, M * S] the decoder's view of states [B, N, M, S] at ``step`` (0: t)."""
        if self.agent_frame:
            expected = start.position + start.velocity * (step * self.dt_s)
            if self.order == 2:
                expected = torch.cat((expected, start.velocity), dim=-1)
            states = states - expected.unsqueeze(2)
        return ((states - self.state_mean) / self.state_std).flatten(2)

    @torch.no_grad()
    def set_statistics(
        self,
        feature_mean: Tensor,
        feature_std: Tensor,
        own_mean: Tensor | None = None,
        own_std: Tensor | None = None,
    ) -> None:
        """Fill the scaling buffers: [F] of the features, [10] of the own-frame inputs.

        Without effect on an unconditioned network, whose inputs are as they are.
        """
        if not self.scaled:
            return
        count = feature_mean.numel()
        self.input_mean[:count] = feature_mean
        self.input_std[:count] = feature_std.clamp(min=LEAST_STD)
        if self.agent_frame:
            if own_mean is not None:
                self.input_mean[count:] = own_mean
            if own_std is not None:
                self.input_std[count:] = own_std.clamp(min=LEAST_STD)
            return
        columns = self.state_mean.numel()
        self.state_mean.copy_(self.input_mean[:columns])
        self.state_std.copy_(self.input_std[:columns])

    @torch.no_grad()
    def fit_statistics(self, features: Tensor, valid: Tensor) -> None:
        """Fill the scaling buffers from sample scenes [B, N, T, F] with presence [B, N, T]."""
        features = torch.where(valid.unsqueeze(-1), features, 0.0)
        values = self.inputs(features, valid, self.start(features, valid))[valid]
        mean, std = values.mean(0), values.std(0)
        count = features.size(-1)
        if self.agent_frame:
            self.set_statistics(mean[:count], std[:count], mean[count:], std[count:])
        else:
            self.set_statistics(mean, std)
