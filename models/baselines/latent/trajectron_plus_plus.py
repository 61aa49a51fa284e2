# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Trajectron++: a discrete latent between recurrent encoders and integrated dynamics.

T. Salzmann et al., "Trajectron++: Dynamically-Feasible Trajectory Forecasting with Heterogeneous
Data", ECCV 2020, Sec. 4: p(y | x) = sum_z p(y | x, z) p(z | x) (eq. 1) with a categorical z. Given
z, a GRU gives Gaussian controls, whose means are fed back, and the dynamics turn them into
positions, their covariances by linearisation. So the prediction is a Gaussian mixture over z.
"""

import torch
from torch import Tensor, nn

from models.baselines.agent_headings import yaw_vectors
from models.baselines.latent.trajectron_config import TrajectronConfig
from models.baselines.latent.trajectron_encoder import TrajectronEncoder
from models.baselines.latent.unicycle import unicycle_step
from models.heads import ControlHead, MixtureHead, NoiseHead, first_circle
from models.own_frame.agent_frames import (
    Start,
    last_seen,
    start_in_own_frames,
    states_to_own,
    states_to_scene,
)
from models.own_frame.covariance_frames import rotate_blocks
from models.trajectory_predictor import TrajectoryPredictor

CONTROL_SCALE = (0.1, 1.0)
"""Turn rate (rad/s) and acceleration (m/s^2) of a unit of the decoder's output for vehicles.

Chosen: common values in traffic. For single integrators the unit is 1 m/s."""

START_STD = (0.05, 0.05, 0.02, 0.05)
"""Deviation of x, y (m), heading (rad) and speed (m/s) at t.

Chosen: below a tracker's, and not zero, or a standing vehicle's position would be certain."""

FUTURE_M = 5.0
"""Scale of the true future's deviation from uniform motion (m), as DEVIATION_STD."""


class TrajectronPlusPlus(TrajectoryPredictor):
    """Mixture over the values of z, S = 2.

    The dynamics are those of an agent that looks along x, so states are in the agents' own frames,
    also where ``agent_frame`` leaves the inputs in the scene frame.

    Args:
        config: the network's options.
    """

    wheels: Tensor
    scale: Tensor
    start_covariance: Tensor

    def __init__(self, config: TrajectronConfig):
        super().__init__(config)
        hidden, modes = config.hidden, config.modes
        self.options = config
        self.dt_s = config.dt_s
        self.static_features = config.static_features
        inputs = self.condition.input_size + config.static_size * config.static_features
        self.encoder = TrajectronEncoder(config, inputs)
        context = self.encoder.size
        self.mixture = MixtureHead(context, modes)  # p(z | x)
        self.future = nn.LSTM(3, config.future_hidden, batch_first=True, bidirectional=True)
        self.posterior_head = nn.Linear(context + 2 * config.future_hidden, modes)  # q(z | x, y)
        # z is appended to the context (one of M): weights as of one layer that takes both.
        reach = (context + modes) ** -0.5
        self.of_context = nn.Linear(context, hidden)
        self.of_latent = nn.Parameter(torch.empty(modes, hidden).uniform_(-reach, reach))
        self.of_control = nn.Linear(2, hidden, bias=False)
        self.first_hidden = nn.Linear(context, hidden)
        self.first_of_latent = nn.Parameter(torch.empty(modes, hidden).uniform_(-reach, reach))
        self.decoder = nn.GRUCell(hidden, hidden)
        self.control = ControlHead(hidden, 1, 2)
        self.noise = NoiseHead(hidden, 1)
        self.first_control = nn.Parameter(first_circle(modes))
        wheels = torch.zeros(config.static_size)
        for column in config.wheeled_columns:
            if column < config.static_size:
                wheels[column] = 1.0
        self.register_buffer("wheels", wheels, persistent=False)
        self.register_buffer("scale", torch.tensor(CONTROL_SCALE), persistent=False)
        start = torch.tensor(START_STD).square().diag()
        self.register_buffer("start_covariance", start, persistent=False)

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
        """See :meth:`TrajectoryPredictor.roll_out`; P_0, teacher and trails are ignored."""
        context, start = self.encode(features, valid, static)
        mean, covariance = self.decode(context, start, self.is_wheeled(static), with_covariance)
        return self.mixture(context), mean, covariance

    def is_wheeled(self, static: Tensor) -> Tensor:
        """Return [B, N] whether an agent moves as a unicycle, of static features [B, N, C]."""
        return (static * self.wheels).sum(dim=-1) > 0.5

    def encode(self, features: Tensor, valid: Tensor, static: Tensor) -> tuple[Tensor, Start]:
        """Return the context x of every agent [B, N, .] and its frame."""
        features, inputs, _ = self.condition.encoder_inputs(
            features, valid, static, self.static_features
        )
        last, _ = last_seen(features, valid)
        yaw = yaw_vectors(last, self.encoder.yaw_as_angle)
        start = start_in_own_frames(last[..., :2], last[..., 2:4], yaw)
        wheeled = self.is_wheeled(static)
        return self.encoder(inputs, features, valid, wheeled, start.direction), start

    def decode(
        self, context: Tensor, start: Start, wheeled: Tensor, with_covariance: bool
    ) -> tuple[Tensor, Tensor]:
        """Return means [B, N, M, H, 2] and covariances [B, N, M, H, 2, 2] given each z.

        Args:
            context: [B, N, .] of :meth:`encode`.
            start: the agents' frames.
            wheeled: [B, N], see :meth:`is_wheeled`.
            with_covariance: false skips the covariances, which come back empty.
        """
        b, n, m = context.size(0), context.size(1), self.modes
        given = self.of_context(context).unsqueeze(2) + self.of_latent  # [B, N, M, D]
        h = torch.tanh(self.first_hidden(context).unsqueeze(2) + self.first_of_latent)
        h = h.flatten(0, 2)
        output = torch.zeros(b, n, m, 2, dtype=context.dtype, device=context.device)
        outputs: list[Tensor] = []
        hidden: list[Tensor] = []
        for _ in range(self.horizon_steps):
            x = torch.relu(given + self.of_control(output)).flatten(0, 2)
            h = self.decoder(x, h)
            command = self.control(h.view(b, n * m, -1)).view(b, n, m, 2)
            output = command + self.first_control
            outputs.append(output)
            hidden.append(h)
        noise = torch.empty(0, dtype=context.dtype, device=context.device)
        if with_covariance:
            states = torch.stack(hidden).view(self.horizon_steps, b, n * m, -1)
            noise = self.noise(states).view(2, 2, self.horizon_steps, b, n, m)
        unicycle, unicycle_spread = self.as_unicycles(outputs, noise, start, with_covariance)
        integrator, integrator_spread = self.as_integrators(outputs, noise, start, with_covariance)
        vehicle = wheeled.unsqueeze(-1)  # [B, N, 1]
        own = torch.where(vehicle.unsqueeze(-1), unicycle, integrator)  # [H, B, N, M, 2]
        mean = states_to_scene(own, start).permute(1, 2, 3, 0, 4).contiguous()
        if not with_covariance:
            return mean, noise
        block = torch.where(vehicle, unicycle_spread, integrator_spread)  # [2, 2, H, B, N, M]
        return mean, self.observed(rotate_blocks([block], start.direction))

    def as_unicycles(
        self, outputs: list[Tensor], noise: Tensor, start: Start, with_covariance: bool
    ) -> tuple[Tensor, Tensor]:
        """Integrate the controls with unicycle dynamics (Sec. 4; P' = F P F^T + G Q G^T).

        Args:
            outputs: [B, N, M, 2] scaled turn rate and acceleration of each step.
            noise: [2, 2, H, B, N, M] Q of the outputs.
            start: the agents' frames; the heading at t is the frame's.
            with_covariance: false skips the covariances.

        Returns:
            Positions [H, B, N, M, 2] (m) and their covariances [2, 2, H, B, N, M] (m^2), in the
            agents' own frames.
        """
        zero = torch.zeros_like(start.velocity[..., 0])
        first = (start.position[..., 0], start.position[..., 1], zero, start.velocity[..., 0])
        state = torch.stack(first, dim=-1).unsqueeze(2).expand(-1, -1, self.modes, -1)
        p = self.start_covariance
        positions: list[Tensor] = []
        spreads: list[Tensor] = []
        for k, output in enumerate(outputs):
            state, f, g = unicycle_step(state, output * self.scale, self.dt_s, with_covariance)
            positions.append(state[..., :2])
            if with_covariance:
                q = noise[:, :, k].permute(2, 3, 4, 0, 1)
                g = g * self.scale
                p = f @ p @ f.transpose(-1, -2) + g @ q @ g.transpose(-1, -2)
                spreads.append(p[..., :2, :2])
        if not with_covariance:
            return torch.stack(positions), noise
        return torch.stack(positions), torch.stack(spreads).permute(4, 5, 0, 1, 2, 3)

    def as_integrators(
        self, outputs: list[Tensor], noise: Tensor, start: Start, with_covariance: bool
    ) -> tuple[Tensor, Tensor]:
        """Integrate the controls as velocities (single integrators; Sec. 4).

        The controls are deviations from the velocity at t (m/s); other arguments and results are
        those of :meth:`as_unicycles`.
        """
        velocity = start.velocity.unsqueeze(2) + torch.stack(outputs)
        position = start.position.unsqueeze(2) + self.dt_s * velocity.cumsum(dim=0)
        if not with_covariance:
            return position, noise
        first = self.start_covariance[:2, :2].view(2, 2, 1, 1, 1, 1)
        return position, first + self.dt_s * self.dt_s * noise.cumsum(dim=2)

    @torch.jit.unused
    def log_posterior(
        self, context: Tensor, start: Start, target: Tensor, known: Tensor
    ) -> Tensor:
        """Return [B, N, M] log q(z | x, y).

        Args:
            context: [B, N, .] of :meth:`encode`.
            start: the agents' frames.
            target: [B, N, H, S] true states in the scene frame.
            known: [B, N, H] where they are observed.
        """
        own = states_to_own(torch.nan_to_num(target[..., :2]), start)
        step = torch.arange(1, own.size(2) + 1, device=own.device, dtype=own.dtype)
        uniform = start.velocity.unsqueeze(2) * (self.dt_s * step).unsqueeze(-1)
        deviation = (own - start.position.unsqueeze(2) - uniform) / FUTURE_M
        deviation = torch.where(known.unsqueeze(-1), deviation, torch.zeros_like(deviation))
        inputs = torch.cat((deviation, known.unsqueeze(-1).to(own.dtype)), dim=-1)
        _, (h, _) = self.future(inputs.flatten(0, 1))
        future = h.transpose(0, 1).flatten(1).view(own.size(0), own.size(1), -1)
        logits = self.posterior_head(torch.cat((context, future), dim=-1))
        return torch.log_softmax(logits, dim=-1)
