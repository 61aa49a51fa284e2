# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The whole of MTP-GO for inference, built from a trained model."""

from typing import Final

import torch
from torch import Tensor, nn

from models.gaussian_mixture import favour_staying, heaviest_at_local_mean, settle_standing
from models.gnn_layers.interaction_graph import complete_graph, squared_distances
from models.inference.inference_covariance import FastCovariance
from models.inference.inference_decoder import FastDecoder
from models.inference.inference_encoder import FastEncoder
from models.inference.inference_motion import FastMotion
from models.inference.packed_attention import make_scratch
from models.mtp_go import MTPGO
from models.mtp_go_config import ModelConfig
from models.own_frame.agent_frames import Start, motion_share, to_scene
from models.own_frame.covariance_frames import initial_in_own_frame
from models.temporal_attention import presence_bias


def is_covered(config: ModelConfig) -> bool:
    """Return whether :class:`FastMTPGO` can compute this model: the default and similar ones."""
    return (
        config.layer in ("gat", "gat+")
        and (config.heads, config.gnn_layers, config.ode_layers, config.order) == (1, 1, 1, 2)
        and config.encoder_gnn
        and config.decoder_gnn
        and config.ekf
        and config.agent_frame
    )


def deployable(model: MTPGO) -> nn.Module:
    """Return what is exported of a model: its fast form where there is one, else itself."""
    return FastMTPGO(model) if is_covered(model.config) else model


class FastMTPGO(nn.Module):
    """The same function as :meth:`MTPGO.forward` of the model it is built from.

    It holds products of the weights: after further training it has to be built again.

    Args:
        model: a model whose configuration :func:`is_covered`.
    """

    static_everywhere: Final[bool]
    hold_standing: Final[bool]
    sees_trails: Final[bool]
    settles_standing: Final[bool]
    favours_staying: Final[bool]
    stay_bias: Final[float]
    moves_heaviest: Final[bool]
    heaviest_kernels: Tensor
    time: Tensor

    def __init__(self, model: MTPGO):
        super().__init__()
        self.config = model.config
        self.modes = model.modes
        self.horizon_steps = model.horizon_steps
        self.condition = model.condition
        self.mixture = model.mixture
        self.noise = model.noise
        self.initial_covariance = model.initial_covariance
        self.encoder = FastEncoder(model.encoder)
        self.decoder = FastDecoder(model.decoder, model.condition, model.modes)
        self.motion = FastMotion(model.motion, model.modes)
        self.covariance = FastCovariance(
            model.filter, model.observation, model.covariance_scale, model.floor
        )
        self.control = model.control
        time = model.config.dt_s * torch.arange(1, self.horizon_steps + 1, dtype=torch.float64)
        self.register_buffer("time", time.view(1, 1, -1, 1))
        self.static_everywhere = model.static_everywhere
        self.hold_standing = model.hold_standing
        self.sees_trails = model.sees_trails
        self.settles_standing = model.settles_standing
        self.favours_staying = model.favours_staying
        self.stay_bias = model.stay_bias
        self.moves_heaviest = model.moves_heaviest
        self.register_buffer("heaviest_kernels", model.heaviest_kernels)
        if self.sees_trails:
            self.trail = model.trail
        self.to(model.control.out.weight.dtype)
        self.eval()

    def forward(
        self,
        features: Tensor,
        valid: Tensor,
        static: Tensor,
        initial_covariance: Tensor | None = None,
        trails: Tensor | None = None,
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Predict every agent, in the scene frame; see :meth:`MTPGO.forward`."""
        features, inputs, start = self.condition.encoder_inputs(
            features, valid, static, self.static_everywhere
        )
        position = features[..., :2]
        scratch = make_scratch(features, valid.size(1), self.decoder.gnn.size)
        encoded = self.encoder(inputs, position, valid, scratch)  # [B, N, T, D]
        last = encoded[:, :, -1].contiguous()
        trail: list[Tensor] = []
        if self.sees_trails:
            steps, summary = self.trail(trails)
            trail = list(self.decoder.of_trails(self.trail.embed(steps)).unbind(0))
            last = last + summary
        log_weight = self.mixture(last)

        scenes, agents = valid.size(0), valid.size(1)
        rows = scenes * agents * self.modes
        absent = complete_graph(valid[:, :, -1]).logical_not_()
        edge, fixed = self.decoder.gnn.prepare(squared_distances(position[:, :, -1]), absent)
        summaries, constant = self.decoder.prepare(encoded, presence_bias(valid))
        constants = self.motion.prepare(static, start.velocity)
        h = (last + self.decoder.initial).flatten(0, 1)
        state = torch.zeros(rows, 4, dtype=h.dtype, device=h.device)
        states: list[Tensor] = []
        units: list[Tensor] = []
        hidden: list[Tensor] = []
        for k in range(self.horizon_steps):
            deviation = state.view(scenes * agents, self.modes * 4)
            known = constant
            if self.sees_trails:
                known = constant + trail[k]
            h = self.decoder(h, deviation, summaries, known, edge, fixed, scratch)
            control = self.control(h.unsqueeze(0)).view(rows, 2)
            state, unit = self.motion(state, control, constants)
            states.append(state)
            units.append(unit)
            hidden.append(h)
        size = [self.horizon_steps, scenes, agents, -1]
        mean = self.to_scene(torch.stack(states), start)

        noise = self.noise(torch.stack(hidden).view(size))  # [2, 2, H, B, N, M]
        first = self.initial_covariance(last)  # [S, S, B, N]
        if initial_covariance is not None:
            first = initial_in_own_frame(initial_covariance, first, start.direction)
        of_q, of_position = self.motion.jacobian(torch.cat(units))
        spread = self.covariance(first, of_q, of_position, noise, start.direction)
        share = motion_share(start.velocity)
        # Each agent's own frame begins at its place.
        if self.settles_standing:
            velocity = to_scene(start.velocity, start.direction)
            mean = settle_standing(mean, start.origin, velocity, share, self.condition.dt_s)
        if self.favours_staying:
            log_weight = favour_staying(log_weight, mean, start.origin, share, self.stay_bias)
        if self.moves_heaviest:
            kernel = torch.mv(static.flatten(0, 1), self.heaviest_kernels).view(share.shape)
            mean = heaviest_at_local_mean(log_weight, mean, spread, share, kernel)
        return log_weight, mean, spread

    def to_scene(self, deviations: Tensor, start: Start) -> Tensor:
        """Return [B, N, M, H, S] states in the scene frame from [H, B N M, S] deviations."""
        scenes, agents = start.origin.size(0), start.origin.size(1)
        cos, sin = start.direction.unbind(-1)
        # A row vector times the transposed rotation, for position and velocity together.
        turn = torch.stack((torch.stack((cos, sin), -1), torch.stack((-sin, cos), -1)), -2)
        none = torch.zeros_like(turn)
        both = torch.cat((torch.cat((turn, none), -1), torch.cat((none, turn), -1)), -2)
        velocity = start.velocity.unsqueeze(2).expand(-1, -1, self.horizon_steps, -1)
        uniform = torch.cat((start.position.unsqueeze(2) + velocity * self.time, velocity), -1)
        uniform = torch.matmul(uniform, both)  # [B, N, H, 4]
        uniform[..., :2].add_(start.origin.unsqueeze(2))
        own = deviations.view(self.horizon_steps, scenes, agents, self.modes, 4)
        if self.hold_standing:
            share = motion_share(start.velocity)[..., None, None]
            own = torch.cat((own[..., :1, :] * share, own[..., 1:, :]), dim=3)
        own = own.permute(1, 2, 3, 0, 4).flatten(2, 3)  # [B, N, M H, 4]
        mean = torch.matmul(own, both)
        return mean.view(scenes, agents, self.modes, -1, 4).add_(uniform.unsqueeze(2))
