# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The structure of the baselines: LSTM encoder and decoder around an interaction.

Everything else is shared with MTP-GO, so that a comparison is about the networks alone: inputs
and their scales, each agent's own frame, presence, the start at constant velocity, the heads for
modes, weights and covariances. The published forms differ in these, see
docs/baselines.md.
"""

import torch
from torch import Tensor, nn
from torch.nn.functional import leaky_relu

from models.ablations.direct_covariance import DirectCovariance
from models.baselines.agent_headings import headings_at_t
from models.baselines.baseline_config import RecurrentConfig
from models.baselines.interaction import Interaction
from models.heads import ControlHead, MixtureHead, NoiseHead
from models.own_frame.agent_frames import states_to_own, states_to_scene
from models.own_frame.covariance_frames import rotate_blocks
from models.trajectory_predictor import TrajectoryPredictor


class AgentLSTM(nn.Module):
    """One step of an LSTM for every agent of every scene.

    Args:
        size_in: channels of the input.
        hidden: D.
    """

    def __init__(self, size_in: int, hidden: int):
        super().__init__()
        self.cell = nn.LSTMCell(size_in, hidden)

    def forward(self, x: Tensor, h: Tensor, c: Tensor) -> tuple[Tensor, Tensor]:
        """Return the next h and c, [B, N, D] each, from the input [B, N, size_in] and the last."""
        next_h, next_c = self.cell(x.flatten(0, 1), (h.flatten(0, 1), c.flatten(0, 1)))
        return next_h.view(h.shape), next_c.view(c.shape)


class RecurrentPredictor(TrajectoryPredictor):
    """LSTM encoder and decoder; the output is the position's mixture, S = 2.

    A step's output is how far each mode's velocity is from that at t, so that small outputs are
    constant velocity. Its covariance k steps ahead is (k dt)^2 times what the decoder gives.

    Args:
        config: the network's options.
        interaction: the neighbour features.
    """

    def __init__(self, config: RecurrentConfig, interaction: Interaction):
        super().__init__(config)
        hidden, modes, size = config.hidden, config.modes, interaction.size
        self.dt_s = config.dt_s
        self.static_features = config.static_features
        self.yaw_as_angle = config.has_angle
        self.each_step = interaction.each_step
        self.interaction = interaction
        inputs = self.condition.input_size + config.static_size * config.static_features
        self.embed_inputs = nn.Linear(inputs, config.embedding)
        self.embed_states = nn.Linear(2 * modes, config.embedding)
        self.initial = nn.Parameter(torch.empty(2, hidden).uniform_(-0.01, 0.01))
        self.encoder = AgentLSTM(config.embedding + size * self.each_step, hidden)
        self.decoder = AgentLSTM(config.embedding + size, hidden)
        self.mixture = MixtureHead(hidden + size, modes)
        self.control = ControlHead(hidden, modes, 2)
        self.noise = NoiseHead(hidden, modes)
        self.covariance = DirectCovariance(config)

    def roll_out(
        self,
        features: Tensor,
        valid: Tensor,
        static: Tensor,
        initial_covariance: Tensor | None,
        with_covariance: bool,
        teacher: Tensor | None,
        teacher_valid: Tensor | None,
        trails: Tensor | None = None,
    ) -> tuple[Tensor, Tensor, Tensor]:
        """See :meth:`TrajectoryPredictor.roll_out`; P_0 is ignored."""
        features, inputs, start = self.condition.encoder_inputs(
            features, valid, static, self.static_features
        )
        position = features[..., :2]
        course = headings_at_t(features, valid, self.yaw_as_angle)
        h, c = self.encode(inputs, position, valid, course)

        present = valid[:, :, -1]
        links = self.interaction.prepare(position[:, :, -1], course, present)
        neighbours = self.interaction(h, links)  # [B, N, size]
        log_weight = self.mixture(torch.cat((h, neighbours), dim=-1))  # [B, N, M]

        state = start.position.unsqueeze(2).expand(-1, -1, self.modes, -1)
        uniform = start.velocity.unsqueeze(2)
        teacher_own = None if teacher is None else states_to_own(torch.nan_to_num(teacher), start)
        states: list[Tensor] = []
        hidden: list[Tensor] = []
        for k in range(self.horizon_steps):
            seen = self.seen(state, teacher_own, teacher_valid, k)
            if k > 0 and self.each_step:
                neighbours = self.interaction(h, links)
            x = leaky_relu(self.embed_states(self.condition.scale_states(seen, start, k)), 0.1)
            h, c = self.decoder(torch.cat((x, neighbours), dim=-1), h, c)
            state = state + self.dt_s * (uniform + self.control(h))  # [B, N, M, 2]
            states.append(state)
            hidden.append(h)
        mean = states_to_scene(torch.stack(states), start).permute(1, 2, 3, 0, 4).contiguous()
        if not with_covariance:
            return log_weight, mean, torch.empty(0, dtype=mean.dtype, device=mean.device)
        noise = self.noise(torch.stack(hidden))  # [2, 2, H, B, N, M]
        blocks = self.covariance(noise)
        return log_weight, mean, self.observed(rotate_blocks(blocks, start.direction))

    def encode(
        self, inputs: Tensor, position: Tensor, valid: Tensor, course: Tensor
    ) -> tuple[Tensor, Tensor]:
        """Return the LSTM's h and c at t, [B, N, D] each.

        They keep the learned initial values until the agent is seen, and their last values while
        it is absent (docs/design.md, decision 2).

        Args:
            inputs: [B, N, T, .] scaled.
            position: [B, N, T, 2] in the scene frame (m).
            valid: [B, N, T].
            course: [B, N, 2] cosine and sine of the agents' headings at t.
        """
        embedded = leaky_relu(self.embed_inputs(inputs), 0.1)
        h = self.initial[0].expand(valid.size(0), valid.size(1), -1)
        c = self.initial[1].expand(valid.size(0), valid.size(1), -1)
        for i, x in enumerate(embedded.unbind(2)):
            present = valid[:, :, i]
            if self.each_step:
                links = self.interaction.prepare(position[:, :, i], course, present)
                x = torch.cat((x, self.interaction(h, links)), dim=-1)
            new_h, new_c = self.encoder(x, h, c)
            h = torch.where(present.unsqueeze(-1), new_h, h)
            c = torch.where(present.unsqueeze(-1), new_c, c)
        return h, c
