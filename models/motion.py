# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Motion models: the neural ODE of first and second order, its step and the step's Jacobian.

The highest-order states q (the position in a first-order model, the velocity in a second-order
one) follow dq/dt = f(q, u); in a second-order model the position integrates q, exactly as the
chosen Runge-Kutta method would do on the whole state.
"""

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


class NeuralODE(nn.Module):
    """dq_i/dt = u_i + scale * f_i(q, u_i[, class]) with one small ELU network f_i per axis.

    The input u is what the decoder commands, in a first-order model added to the velocity at t;
    with the networks' last layer at zero and nothing commanded, agents move at constant velocity
    in both orders (design D16). f_1 and f_2 run as one network with block-diagonal weights.
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
        self.q_scale = 50.0 if first_order else 10.0  # m, or m/s
        self.u_scale = 10.0 if first_order else 1.0  # m/s, or m/s^2
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

    def prepare(self, static: Tensor, start: Start) -> list[Tensor]:
        """Constants of the roll-out: the packed weights, and what does not change over it.

        In order: [2, 2W] of q, [2, 2W] of u, [.., 2W] class term and bias, [2W, 2] of the output,
        [2] its bias, [B, N, 1, 2] or [1] what the command is added to; then [2W, 2W] and [2W] of
        each further hidden layer. W is the width of one network.
        """
        of_q = torch.cat((self.first[0, :, :2], self.first[1, :, :2])).t() / self.q_scale
        of_u = torch.block_diag(self.first[0:1, :, 2], self.first[1:2, :, 2]) / self.u_scale
        rest = self.first_bias.flatten()
        if self.static_size > 0:
            rest = rest + torch.matmul(static, self.first[:, :, 3:].flatten(0, 1).t()).unsqueeze(2)
        out = torch.block_diag(self.last[0].unsqueeze(1), self.last[1].unsqueeze(1))
        added = torch.zeros(1, dtype=static.dtype, device=static.device)
        if self.order == 1:
            added = start.velocity.unsqueeze(2)
        constants = [of_q, of_u, rest, out, self.last_bias, added]
        for weight, bias in zip(self.inner.unbind(0), self.inner_bias.unbind(0)):  # noqa: B905
            constants.append(torch.block_diag(weight[0], weight[1]).t())
            constants.append(bias.flatten())
        return constants

    def derivative(self, q: Tensor, u: Tensor, base: Tensor, constants: list[Tensor]) -> Tensor:
        """[..., 2] dq/dt; ``base`` [..., 2W] is the part of the first layer that q is not in."""
        hidden = nn.functional.elu(torch.matmul(q, constants[0]) + base)
        for i in range(6, len(constants), 2):
            hidden = nn.functional.elu(torch.matmul(hidden, constants[i]) + constants[i + 1])
        return u + torch.matmul(hidden, constants[3]) + constants[4]

    def slope(self, q: Tensor, base: Tensor, constants: list[Tensor]) -> tuple[Tensor, Tensor]:
        """The network's value [..., 2] and its Jacobian with respect to q, transposed [..., 2, 2].

        Entry [s, g] is the derivative of the g-th component by q_s. The derivative of ELU is
        exp(min(a, 0)), which is min(elu(a), 0) + 1.
        """
        hidden = nn.functional.elu(torch.matmul(q, constants[0]) + base)
        tangent = constants[0] * (hidden.clamp(max=0.0) + 1.0).unsqueeze(-2)  # [..., 2, 2W]
        for i in range(6, len(constants), 2):
            hidden = nn.functional.elu(torch.matmul(hidden, constants[i]) + constants[i + 1])
            gain = (hidden.clamp(max=0.0) + 1.0).unsqueeze(-2)
            tangent = torch.matmul(tangent, constants[i]) * gain
        value = torch.matmul(hidden, constants[3]) + constants[4]
        return value, torch.matmul(tangent, constants[3])

    def forward(
        self, state: Tensor, control: Tensor, step: int, start: Start, constants: list[Tensor]
    ) -> Tensor:
        """The state [B, N, M, S] one step later.

        Args:
            state: [B, N, M, S] in the agent's frame.
            control: [B, N, M, 2] of the decoder (m/s or m/s^2).
            step: not used by this model.
            start: not used by this model.
            constants: of :meth:`prepare`.
        """
        u = control + constants[5]
        base = torch.matmul(u, constants[1]) + constants[2]
        q = state[..., -2:]
        k = self.derivative(q, u, base, constants)
        total = self.weights[0] * k
        moved = self.carried[0] * k
        for i in range(1, len(self.nodes)):
            k = self.derivative(q + (self.dt_s * self.nodes[i]) * k, u, base, constants)
            total = total + self.weights[i] * k
            moved = moved + self.carried[i] * k
        following = q + self.dt_s * total
        if self.order == 1:
            return following
        position = state[..., :2] + self.dt_s * q + (self.dt_s * self.dt_s) * moved
        return torch.cat((position, following), dim=-1)

    def jacobian(
        self, state: Tensor, control: Tensor, constants: list[Tensor]
    ) -> tuple[Tensor, Tensor]:
        """Derivatives of the discrete step by q, in closed form (design D8).

        Args:
            state: [..., S] before the step.
            control: [..., 2].
            constants: of :meth:`prepare`.

        Returns:
            [..., 2, 2] of the next q and [..., 2, 2] of the next position (second order; for first
            order its value has no meaning). The position's derivative by itself is the identity.
        """
        u = control + constants[5]
        base = torch.matmul(u, constants[1]) + constants[2]
        q = state[..., -2:]
        eye = torch.eye(2, dtype=q.dtype, device=q.device)
        value, slope = self.slope(q, base, constants)
        total = self.weights[0] * slope
        moved = self.carried[0] * slope
        gain = slope
        for i in range(1, len(self.nodes)):
            reach = self.dt_s * self.nodes[i]
            value, slope = self.slope(q + reach * (u + value), base, constants)
            # Chain rule on transposes: d k_i = slope^T (I + reach d k_{i-1}).
            gain = _product(eye + reach * gain, slope)
            total = total + self.weights[i] * gain
            moved = moved + self.carried[i] * gain
        of_q = (eye + self.dt_s * total).transpose(-1, -2)
        of_position = (self.dt_s * eye + (self.dt_s * self.dt_s) * moved).transpose(-1, -2)
        return of_q, of_position


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

    def prepare(self, static: Tensor, start: Start) -> list[Tensor]:
        """Nothing is constant here."""
        return [static]

    def forward(
        self, state: Tensor, control: Tensor, step: int, start: Start, constants: list[Tensor]
    ) -> Tensor:
        """The state [B, N, M, S] after ``step`` + 1 steps, from control [B, N, M, S]."""
        expected = start.position + start.velocity * ((step + 1) * self.dt_s)
        if self.order == 2:
            expected = torch.cat((expected, start.velocity), dim=-1)
        return expected.unsqueeze(2) + control

    def jacobian(
        self, state: Tensor, control: Tensor, constants: list[Tensor]
    ) -> tuple[Tensor, Tensor]:
        """Not used: without a motion model there is no Kalman filter. The identity."""
        eye = torch.eye(2, dtype=state.dtype, device=state.device)
        return eye, eye


def _product(x: Tensor, y: Tensor) -> Tensor:
    """[..., 2, 2] matrix product, written out: far cheaper than a batched call of this size."""
    return x[..., :1] * y[..., :1, :] + x[..., 1:] * y[..., 1:, :]
