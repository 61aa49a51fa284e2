# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Motion models: the neural ODE of first and second order, its step and the step's Jacobian.

The highest-order states q (the position in a first-order model, the velocity in a second-order
one) follow dq/dt = f(q, u); in a second-order model the position integrates q, exactly as the
chosen Runge-Kutta method would do on the whole state.
"""

from typing import NamedTuple

import torch
from torch import Tensor, nn

from models.agent_frames import Start
from models.ekf import block_product
from models.kernels.ode_step import OdeStep, Scheme
from models.mtp_go_config import ModelConfig

TABLEAUS: dict[str, tuple[tuple[float, ...], tuple[float, ...]]] = {
    "euler": ((0.0,), (1.0,)),
    "heun": ((0.0, 1.0), (0.5, 0.5)),
    "rk4": ((0.0, 0.5, 0.5, 1.0), (1 / 6, 1 / 3, 1 / 3, 1 / 6)),
}
"""Nodes a_i and weights b_i: k_i = f(q + dt a_i k_{i-1}), q' = q + dt sum_i b_i k_i."""


class Field(NamedTuple):
    """Packed weights of both networks f_1 and f_2, W units wide each, and a roll-out's constants.

    Attributes:
        of_q: [2, 2W] first layer's weights of the states q.
        of_u: [2, 2W] of the inputs, each input into its own network.
        rest: [2W] or [B, N, 1, 2W] first layer's bias, and what the class adds.
        inner: [2W, 2W] of each further hidden layer.
        inner_bias: [2W] likewise.
        out: [2W, 2] output layer.
        out_bias: [2].
        through: [4, 2W] derivative of the output (first index of the four) by q (second) through
            each unit of an only hidden layer, and
        base: [4, 1] its sum over the units.
        added: [B, N, 1, 2] or [1] what the decoder's command is added to (m/s or m/s^2).
    """

    of_q: Tensor
    of_u: Tensor
    rest: Tensor
    inner: list[Tensor]
    inner_bias: list[Tensor]
    out: Tensor
    out_bias: Tensor
    through: Tensor
    base: Tensor
    added: Tensor


class NeuralODE(nn.Module):
    """dq_i/dt = u_i + f_i(q, u_i[, class]) with one small ELU network f_i per axis.

    The input u is what the decoder commands, in a first-order model added to the velocity at t;
    with the networks' last layer at zero and nothing commanded, agents move at constant velocity
    in both orders (design D16). f_1 and f_2 run as one network with block-diagonal weights.

    Attributes:
        controls: numbers that the decoder gives per mode and step.
        q_scale: by which the networks divide q (m in first order, m/s in second).
        u_scale: by which they divide u (m/s in first order, m/s^2 in second).
    """

    def __init__(self, config: ModelConfig):
        super().__init__()
        self.dt_s = config.dt_s
        self.order = config.order
        self.controls = 2
        nodes, weights = TABLEAUS[config.integrator]
        self.nodes = list(nodes)
        self.weights = list(weights)
        # b_i a_i: how k_{i-1} enters the position of a second-order model.
        self.carried = [b * a for a, b in zip(nodes[1:], weights[1:], strict=True)] + [0.0]
        first_order = config.order == 1
        self.q_scale = 50.0 if first_order else 10.0
        self.u_scale = 10.0 if first_order else 1.0
        self.static_size = config.static_size if config.static_features else 0
        width = config.ode_hidden
        bound = (3 + self.static_size) ** -0.5
        self.first = nn.Parameter(torch.empty(2, width, 3 + self.static_size))
        self.first_bias = nn.Parameter(torch.empty(2, width))
        nn.init.uniform_(self.first, -bound, bound)
        nn.init.uniform_(self.first_bias, -bound, bound)
        depth = config.ode_layers - 1
        self.inner = nn.Parameter(torch.empty(depth, 2, width, width))
        self.inner_bias = nn.Parameter(torch.zeros(depth, 2, width))
        nn.init.uniform_(self.inner, -(width**-0.5), width**-0.5)
        self.last = nn.Parameter(torch.zeros(2, width))
        self.last_bias = nn.Parameter(torch.zeros(2))

    def prepare(self, static: Tensor, start: Start) -> Field:
        """What does not change over the roll-out, from classes [B, N, C] and the start."""
        of_q = torch.cat((self.first[0, :, :2], self.first[1, :, :2])).t() / self.q_scale
        of_u = torch.block_diag(self.first[0:1, :, 2], self.first[1:2, :, 2]) / self.u_scale
        rest = self.first_bias.flatten()
        if self.static_size > 0:
            rest = rest + torch.matmul(static, self.first[:, :, 3:].flatten(0, 1).t()).unsqueeze(2)
        inner: list[Tensor] = []
        for weight in self.inner.unbind(0):
            inner.append(torch.block_diag(weight[0], weight[1]).t())
        inner_bias = list(self.inner_bias.flatten(1).unbind(0))
        out = torch.block_diag(self.last[0].unsqueeze(1), self.last[1].unsqueeze(1))
        through = (out.t().unsqueeze(1) * of_q.unsqueeze(0)).flatten(0, 1)
        base = through.sum(1, keepdim=True)
        added = torch.zeros(1, dtype=static.dtype, device=static.device)
        if self.order == 1:
            added = start.velocity.unsqueeze(2)
        return Field(
            of_q, of_u, rest, inner, inner_bias, out, self.last_bias, through, base, added
        )

    def derivative(
        self, q: Tensor, u: Tensor, base: Tensor, field: Field, with_slope: bool
    ) -> tuple[Tensor, Tensor]:
        """[..., 2] dq/dt, and its derivative by q where asked for, else nothing.

        The derivative is [4, R] with R the number of states: of the first, of the second
        component, each by both. That of ELU is exp(min(a, 0)), which is min(elu(a), 0) + 1.

        Args:
            q: [..., 2].
            u: [..., 2].
            base: [..., 2W] the part of the first layer that q is not in.
            field: of :meth:`prepare`.
            with_slope: whether the derivative is wanted.
        """
        hidden = nn.functional.elu(torch.matmul(q, field.of_q) + base)
        slope = hidden[:0]
        if len(field.inner) == 0:
            if with_slope:
                drop = hidden.clamp(max=0.0).view(-1, hidden.size(-1))
                slope = torch.addmm(field.base, field.through, drop.t())
        else:
            gain = hidden.clamp(max=0.0) + 1.0
            tangent = field.of_q * gain.unsqueeze(-2)  # [..., 2, 2W]
            for i, weight in enumerate(field.inner):
                hidden = nn.functional.elu(torch.matmul(hidden, weight) + field.inner_bias[i])
                if with_slope:
                    gain = (hidden.clamp(max=0.0) + 1.0).unsqueeze(-2)
                    tangent = torch.matmul(tangent, weight) * gain
            if with_slope:
                slope = torch.matmul(tangent, field.out).view(-1, 2, 2)  # [R, by, of]
                slope = slope.permute(2, 1, 0).reshape(4, -1)
        return u + torch.matmul(hidden, field.out) + field.out_bias, slope

    def forward(
        self, state: Tensor, control: Tensor, step: int, start: Start, field: Field
    ) -> Tensor:
        """The state [B, N, M, S] one step later; arguments as in :meth:`move`."""
        return self.move(state, control, step, start, field, False)[0]

    def move(
        self,
        state: Tensor,
        control: Tensor,
        step: int,
        start: Start,
        field: Field,
        with_slopes: bool,
    ) -> tuple[Tensor, list[Tensor]]:
        """The state [B, N, M, S] one step later, and what :meth:`jacobian` needs of the step.

        Args:
            state: [B, N, M, S] in the agent's frame.
            control: [B, N, M, 2] of the decoder (m/s or m/s^2).
            step: not used by this model.
            start: not used by this model.
            field: of :meth:`prepare`.
            with_slopes: whether the latter is wanted.
        """
        u = control + field.added
        if not torch.jit.is_scripting() and self._steps_by_hand(state, u, field):
            scheme = Scheme(self.dt_s, self.nodes, self.weights, self.carried)
            moved_to, *gains = OdeStep.apply(
                state,
                u,
                field.of_q,
                field.of_u,
                field.rest,
                field.out,
                field.out_bias,
                field.through,
                scheme,
                with_slopes,
            )
            return moved_to, gains
        base = torch.matmul(u, field.of_u) + field.rest
        # Split, not indexed: the gradient of an index fills the whole array with zeros.
        parts = state.split(2, dim=-1)
        q = parts[-1]
        k, slope = self.derivative(q, u, base, field, with_slopes)
        slopes = [slope]
        total = self.weights[0] * k
        moved = self.carried[0] * k
        for i in range(1, len(self.nodes)):
            reached = q + (self.dt_s * self.nodes[i]) * k
            k, slope = self.derivative(reached, u, base, field, with_slopes)
            slopes.append(slope)
            total = total + self.weights[i] * k
            moved = moved + self.carried[i] * k
        following = q + self.dt_s * total
        if self.order == 1:
            return following, slopes
        position = parts[0] + self.dt_s * q + (self.dt_s * self.dt_s) * moved
        return torch.cat((position, following), dim=-1), slopes

    @torch.jit.unused
    def _steps_by_hand(self, state: Tensor, u: Tensor, field: Field) -> bool:
        """Whether :class:`OdeStep` serves: one hidden layer, one type throughout."""
        device = state.device.type
        if torch.amp.is_autocast_available(device) and torch.is_autocast_enabled(device):
            return False
        return not field.inner and state.dtype == u.dtype == field.of_q.dtype == field.rest.dtype

    def jacobian(self, slopes: list[list[Tensor]], agents: list[int]) -> tuple[Tensor, Tensor]:
        """Derivatives of the discrete step by q for all steps, in closed form (design D8).

        Args:
            slopes: of :meth:`move` at all steps.
            agents: B, N, M.

        Returns:
            [2, 2, H, B, N, M] of the next q and of the next position, derivatives of the first
            index's component by the second's (in first order the latter has no meaning). The
            position's derivative by itself is the identity.
        """
        size = [2, 2, len(slopes), agents[0], agents[1], agents[2]]
        slope = torch.stack([stages[0] for stages in slopes], dim=1).view(size)
        eye = torch.eye(2, dtype=slope.dtype, device=slope.device).view(2, 2, 1, 1, 1, 1)
        gain = slope
        total = self.weights[0] * gain
        moved = self.carried[0] * gain
        for i in range(1, len(self.nodes)):
            slope = torch.stack([stages[i] for stages in slopes], dim=1).view(size)
            # Chain rule: d k_i = slope (I + a_i dt d k_{i-1}).
            gain = slope + (self.dt_s * self.nodes[i]) * block_product(slope, gain)
            total = total + self.weights[i] * gain
            moved = moved + self.carried[i] * gain
        return eye + self.dt_s * total, self.dt_s * eye + (self.dt_s * self.dt_s) * moved


class DirectStates(nn.Module):
    """No motion model: the decoder gives the states themselves (ablation ``ode=False``).

    They are given as differences from uniform motion at the velocity of t, so that this model too
    begins at constant velocity.
    """

    def __init__(self, config: ModelConfig):
        super().__init__()
        self.dt_s = config.dt_s
        self.order = config.order
        self.controls = config.state_size

    def prepare(self, static: Tensor, start: Start) -> Field:
        """A field of nothing: there is no network."""
        none = torch.empty(0, dtype=static.dtype, device=static.device)
        return Field(none, none, none, [none], [none], none, none, none, none, none)

    def forward(
        self, state: Tensor, control: Tensor, step: int, start: Start, field: Field
    ) -> Tensor:
        """The state [B, N, M, S] after ``step`` + 1 steps, from control [B, N, M, S]."""
        expected = start.position + start.velocity * ((step + 1) * self.dt_s)
        if self.order == 2:
            expected = torch.cat((expected, start.velocity), dim=-1)
        return expected.unsqueeze(2) + control

    def move(
        self,
        state: Tensor,
        control: Tensor,
        step: int,
        start: Start,
        field: Field,
        with_slopes: bool,
    ) -> tuple[Tensor, list[Tensor]]:
        """:meth:`forward` and nothing besides: there is no Kalman filter."""
        return self.forward(state, control, step, start, field), [state[:0]]

    def jacobian(self, slopes: list[list[Tensor]], agents: list[int]) -> tuple[Tensor, Tensor]:
        """Not used, and empty."""
        return slopes[0][0], slopes[0][0]
