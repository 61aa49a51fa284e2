# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""MTP-GO: graph GRU encoder and decoder, neural ODE, Kalman covariance, mixture output."""

from typing import TYPE_CHECKING, Final

import torch
from torch import Tensor

from models.ablations.direct_covariance import DirectCovariance
from models.ablations.direct_states import DirectStates
from models.decoder import Decoder
from models.ekf import EkfCovariance
from models.encoder import Encoder
from models.gaussian_mixture import favour_staying, heaviest_at_local_mean, settle_standing
from models.heads import ControlHead, InitialCovariance, MixtureHead, NoiseHead
from models.mtp_go_config import ModelConfig
from models.neural_ode import NeuralODE
from models.own_frame.agent_frames import (
    Start,
    hold_first_mode,
    motion_share,
    states_to_own,
    states_to_scene,
    to_scene,
)
from models.own_frame.covariance_frames import FLOOR, initial_in_own_frame, rotate_blocks
from models.own_frame.trail_input import TrailInput
from models.temporal_attention import presence_bias
from models.trajectory_predictor import TrajectoryPredictor


class MTPGO(TrajectoryPredictor):
    """Multimodal Gaussian trajectories of all agents of B scenes.

    Args:
        config: see :class:`models.mtp_go_config.ModelConfig`.

    Attributes:
        ode: the decoder commands the ``motion``; otherwise it gives the states.
        ekf: a ``filter`` propagates the covariances; otherwise the decoder gives them.
    """

    # Final, so that TorchScript compiles only the branch that is taken.
    ode: Final[bool]
    ekf: Final[bool]
    static_everywhere: Final[bool]
    hold_standing: Final[bool]
    sees_trails: Final[bool]
    settles_standing: Final[bool]
    favours_staying: Final[bool]
    stay_bias: Final[float]
    moves_heaviest: Final[bool]
    heaviest_kernels: Tensor
    if TYPE_CHECKING:  # TorchScript would compile an annotation that it can see
        config: ModelConfig

    def __init__(self, config: ModelConfig):
        super().__init__(config)
        self.order = config.order
        self.ode = config.ode
        self.ekf = config.ekf
        self.static_everywhere = config.static_features and config.static_inputs == "all"
        self.hold_standing = config.hold_standing
        self.sees_trails = config.trail_branches > 0
        self.settles_standing = config.settle_standing
        self.favours_staying = config.stay_bias > 0.0
        self.stay_bias = config.stay_bias
        self.moves_heaviest = any(config.heaviest_kernels)
        kernels = torch.zeros(config.static_size)
        kernels[: len(config.heaviest_kernels)] = torch.tensor(config.heaviest_kernels)
        self.register_buffer("heaviest_kernels", kernels, persistent=False)
        self.floor = FLOOR if config.covariance_inflation > 0.0 else 0.0
        static_size = config.static_size if self.static_everywhere else 0
        self.encoder = Encoder(config, self.condition.input_size + static_size)
        self.decoder = Decoder(config)
        if config.ode:
            self.motion = NeuralODE(config)
            controls = self.motion.controls
        else:
            self.direct_states = DirectStates(config)
            controls = self.direct_states.controls
        usual = config.conditioned
        self.control = ControlHead(config.hidden, config.modes, controls, usual)
        self.noise = NoiseHead(
            config.hidden, config.modes, config.noise_floor, config.correlation_limit, usual
        )
        self.initial_covariance = InitialCovariance(config)
        if config.ekf:
            self.filter = EkfCovariance(config)
        else:
            self.direct_covariance = DirectCovariance(config)
        self.mixture = MixtureHead(config.hidden, config.modes, usual)
        if self.sees_trails:
            self.trail = TrailInput(config, config.trail_branches)

    def forward(
        self,
        features: Tensor,
        valid: Tensor,
        static: Tensor,
        initial_covariance: Tensor | None = None,
        trails: Tensor | None = None,
    ) -> tuple[Tensor, Tensor, Tensor]:
        """See :meth:`models.trajectory_predictor.TrajectoryPredictor.forward`."""
        log_weight, mean, covariance = self.roll_out(
            features, valid, static, initial_covariance, True, None, None, trails
        )
        if self.settles_standing or self.favours_staying or self.moves_heaviest:
            known = torch.where(valid.unsqueeze(-1), features, torch.zeros_like(features))
            start = self.condition.start(known, valid)
            share = motion_share(start.velocity)
            place = start.origin + to_scene(start.position, start.direction)
            if self.settles_standing:
                velocity = to_scene(start.velocity, start.direction)
                mean = settle_standing(mean, place, velocity, share, self.condition.dt_s)
            if self.favours_staying:
                log_weight = favour_staying(log_weight, mean, place, share, self.stay_bias)
        if self.moves_heaviest:
            kernel = torch.mv(static.flatten(0, 1), self.heaviest_kernels).view(share.shape)
            mean = heaviest_at_local_mean(log_weight, mean, covariance, share, kernel)
        return log_weight, mean, covariance

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
        """See :meth:`models.trajectory_predictor.TrajectoryPredictor.roll_out`."""
        features, inputs, start = self.condition.encoder_inputs(
            features, valid, static, self.static_everywhere
        )

        # Encode.
        position = features[..., :2]
        encoded = self.encoder(inputs, position, valid)  # [B, N, T, D]
        last = encoded[:, :, -1]
        trail: list[Tensor] = []
        if self.sees_trails:
            steps, summary = self.trail(trails)
            trail = list(self.trail.embed(steps).unbind(0))
            last = last + summary
        log_weight = self.mixture(last)  # [B, N, M]

        # Decode and move, step by step.
        edges = self.decoder.prepare(position[:, :, -1], valid[:, :, -1])
        bias = presence_bias(valid)
        h = last + self.decoder.initial
        state = self.first_state(start)
        teacher_own = None if teacher is None else states_to_own(torch.nan_to_num(teacher), start)
        states: list[Tensor] = []
        slopes: list[list[Tensor]] = []
        hidden: list[Tensor] = []
        if self.ode:
            network = self.motion.prepare(static)
        for k in range(self.horizon_steps):
            seen = self.seen(state, teacher_own, teacher_valid, k)
            h = self.decoder(
                h,
                self.condition.scale_states(seen, start, k),
                encoded,
                bias,
                edges,
                trail[k] if self.sees_trails else None,
            )  # [B, N, D]
            control = self.control(h)  # [B, N, M, controls]
            if self.ode:
                u = self.motion.command(control, start.velocity)
                state, slope = self.motion(state, u, network, with_covariance and self.ekf)
                slopes.append(slope)
            else:
                state = self.direct_states(control, start, k + 1)
            states.append(state)  # [B, N, M, S]
            hidden.append(h)
        path = torch.stack(states)
        if self.hold_standing:
            path = hold_first_mode(path, start, self.condition.dt_s)
        mean = states_to_scene(path, start).permute(1, 2, 3, 0, 4).contiguous()

        # Covariance over the whole horizon.
        if not with_covariance:
            return log_weight, mean, torch.empty(0, dtype=mean.dtype, device=mean.device)
        noise = self.noise(torch.stack(hidden))  # [2, 2, H, B, N, M]
        if self.ekf:
            first = self.initial_covariance(last)  # [S, S, B, N]
            if initial_covariance is not None:
                first = initial_in_own_frame(initial_covariance, first, start.direction)
            of_q, of_position = self.motion.jacobian(slopes, list(state.shape[:3]))
            blocks = self.filter(first, of_q, of_position, noise)  # [2, 2, H, B, N, M] each
        else:
            blocks = self.direct_covariance(noise)
        return log_weight, mean, self.observed(rotate_blocks(blocks, start.direction, self.floor))

    def first_state(self, start: Start) -> Tensor:
        """Return [B, N, M, S] the state at t, the same for all modes."""
        state = start.position
        if self.order == 2:
            state = torch.cat((state, start.velocity), dim=-1)
        return state.unsqueeze(2).expand(-1, -1, self.modes, -1)
