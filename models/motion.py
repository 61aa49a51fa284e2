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

from models.config import ModelConfig
from models.frames import Start

TABLEAUS: dict[str, tuple[tuple[float, ...], tuple[float, ...]]] = {
    "euler": ((0.0,), (1.0,)),
    "heun": ((0.0, 1.0), (0.5, 0.5)),
    "rk4": ((0.0, 0.5, 0.5, 1.0), (1 / 6, 1 / 3, 1 / 3, 1 / 6)),
}
"""Nodes a_i and weights b_i: k_i = f(q + dt a_i k_{i-1}), q' = q + dt sum_i b_i k_i."""

ROWS = 16384
"""Jacobians that are worked on at a time, so that what lies between stays in the cache."""


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
        through: [2W, 4] derivative of the output by q through each unit of an only hidden layer.
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
        through = (of_q.t().unsqueeze(-1) * out.unsqueeze(1)).flatten(1)
        added = torch.zeros(1, dtype=static.dtype, device=static.device)
        if self.order == 1:
            added = start.velocity.unsqueeze(2)
        return Field(of_q, of_u, rest, inner, inner_bias, out, self.last_bias, through, added)

    def derivative(self, q: Tensor, u: Tensor, base: Tensor, field: Field) -> Tensor:
        """[..., 2] dq/dt; ``base`` [..., 2W] is the part of the first layer that q is not in."""
        hidden = nn.functional.elu(torch.matmul(q, field.of_q) + base)
        for i, weight in enumerate(field.inner):
            hidden = nn.functional.elu(torch.matmul(hidden, weight) + field.inner_bias[i])
        return u + torch.matmul(hidden, field.out) + field.out_bias

    def slope(self, q: Tensor, base: Tensor, field: Field) -> tuple[Tensor, Tensor]:
        """The networks' value [..., 2] and their Jacobian by q, transposed [..., 2, 2].

        Entry [s, g] is the derivative of the g-th component by q_s. The derivative of ELU is
        exp(min(a, 0)), which is min(elu(a), 0) + 1.
        """
        hidden = nn.functional.elu(torch.matmul(q, field.of_q) + base)
        gain = hidden.clamp(max=0.0) + 1.0
        if len(field.inner) == 0:
            slope = torch.matmul(gain, field.through).unflatten(-1, (2, 2))
        else:
            tangent = field.of_q * gain.unsqueeze(-2)  # [..., 2, 2W]
            for i, weight in enumerate(field.inner):
                hidden = nn.functional.elu(torch.matmul(hidden, weight) + field.inner_bias[i])
                gain = (hidden.clamp(max=0.0) + 1.0).unsqueeze(-2)
                tangent = torch.matmul(tangent, weight) * gain
            slope = torch.matmul(tangent, field.out)
        return torch.matmul(hidden, field.out) + field.out_bias, slope

    def forward(
        self, state: Tensor, control: Tensor, step: int, start: Start, field: Field
    ) -> Tensor:
        """The state [B, N, M, S] one step later.

        Args:
            state: [B, N, M, S] in the agent's frame.
            control: [B, N, M, 2] of the decoder (m/s or m/s^2).
            step: not used by this model.
            start: not used by this model.
            field: of :meth:`prepare`.
        """
        u = control + field.added
        base = torch.matmul(u, field.of_u) + field.rest
        q = state if self.order == 1 else state[..., 2:]
        k = self.derivative(q, u, base, field)
        total = self.weights[0] * k
        moved = self.carried[0] * k
        for i in range(1, len(self.nodes)):
            k = self.derivative(q + (self.dt_s * self.nodes[i]) * k, u, base, field)
            total = total + self.weights[i] * k
            moved = moved + self.carried[i] * k
        following = q + self.dt_s * total
        if self.order == 1:
            return following
        position = state[..., :2] + self.dt_s * q + (self.dt_s * self.dt_s) * moved
        return torch.cat((position, following), dim=-1)

    def jacobian(
        self, states: Tensor, controls: Tensor, field: Field, rows: int = ROWS
    ) -> tuple[Tensor, Tensor]:
        """Derivatives of the discrete step by q for all steps, in closed form (design D8).

        Args:
            states: [H, B, N, M, S] before each step.
            controls: [H, B, N, M, 2].
            field: of :meth:`prepare`.
            rows: states that are worked on at a time.

        Returns:
            [2, 2, H, B, N, M] of the next q and of the next position, derivatives of the first
            index's component by the second's (in first order the latter has no meaning). The
            position's derivative by itself is the identity.
        """
        steps = max(1, rows // controls[0, ..., 0].numel())
        of_q: list[Tensor] = []
        of_position: list[Tensor] = []
        for state, control in zip(states.split(steps), controls.split(steps)):  # noqa: B905
            one, other = self.step_jacobian(state, control, field)
            of_q.append(one.permute(5, 4, 0, 1, 2, 3))
            of_position.append(other.permute(5, 4, 0, 1, 2, 3))
        return torch.cat(of_q, dim=2), torch.cat(of_position, dim=2)

    def step_jacobian(self, state: Tensor, control: Tensor, field: Field) -> tuple[Tensor, Tensor]:
        """:meth:`jacobian` of states [..., S] and controls [..., 2], transposed: [..., 2, 2]."""
        u = control + field.added
        base = torch.matmul(u, field.of_u) + field.rest
        q = state if self.order == 1 else state[..., 2:]
        eye = torch.eye(2, dtype=q.dtype, device=q.device)
        value, slope = self.slope(q, base, field)
        total = self.weights[0] * slope
        moved = self.carried[0] * slope
        gain = slope
        for i in range(1, len(self.nodes)):
            reach = self.dt_s * self.nodes[i]
            value, slope = self.slope(q + reach * (u + value), base, field)
            # Chain rule, transposed: d k_i = (I + reach d k_{i-1}) slope.
            ahead = eye + reach * gain
            gain = ahead[..., :1] * slope[..., :1, :] + ahead[..., 1:] * slope[..., 1:, :]
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
        return Field(none, none, none, [none], [none], none, none, none, none)

    def forward(
        self, state: Tensor, control: Tensor, step: int, start: Start, field: Field
    ) -> Tensor:
        """The state [B, N, M, S] after ``step`` + 1 steps, from control [B, N, M, S]."""
        expected = start.position + start.velocity * ((step + 1) * self.dt_s)
        if self.order == 2:
            expected = torch.cat((expected, start.velocity), dim=-1)
        return expected.unsqueeze(2) + control

    def jacobian(self, states: Tensor, controls: Tensor, field: Field) -> tuple[Tensor, Tensor]:
        """Not used, and empty: without a motion model there is no Kalman filter."""
        return states[:0], states[:0]
