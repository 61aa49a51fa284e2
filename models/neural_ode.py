# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The motion model: a neural ODE of first or second order, its step and the step's Jacobian.

The highest-order states q (the position in a first-order model, the velocity in a second-order
one) follow dq/dt = f(q, u); in a second-order model the position integrates q, exactly as the
chosen Runge-Kutta method would do on the whole state.
"""

import torch
from torch import Tensor, nn

from models.kernels.block_product import block_product
from models.kernels.ode_step import OdeNetwork, RungeKutta, ode_step
from models.mtp_go_config import ModelConfig

TABLEAUS: dict[str, tuple[tuple[float, ...], tuple[float, ...]]] = {
    "euler": ((0.0,), (1.0,)),
    "heun": ((0.0, 1.0), (0.5, 0.5)),
    "rk4": ((0.0, 0.5, 0.5, 1.0), (1 / 6, 1 / 3, 1 / 3, 1 / 6)),
}
"""Nodes a_i and weights b_i: k_i = f(q + dt a_i k_{i-1}), q' = q + dt sum_i b_i k_i."""

Q_SCALES = {1: 50.0, 2: 10.0}
"""What the networks divide q by, by order (m; m/s). Chosen: a usual range of the values."""

U_SCALES = {1: 10.0, 2: 1.0}
"""What the networks divide u by, by order (m/s; m/s^2). Chosen: a usual range of the values."""


class NeuralODE(nn.Module):
    """dq_i/dt = u_i + f_i(q, u_i[, class]), one small ELU network f_i per axis (eq. 17 to 19).

    The input u is what the decoder commands, in a first-order model added to the velocity at t;
    with the networks' last layer at zero and nothing commanded, agents move at constant velocity
    in both orders (docs/design.md, decision 16). With ``motion_input="network"``
    dq_i/dt = f_i(q, u_i[, class]) as in the paper, and u is what the decoder gives in both orders.
    f_1 and f_2 run as one network with block-diagonal weights.

    Attributes:
        controls: numbers that the decoder gives per mode and step.
        method: the Runge-Kutta method.
        q_scale: what the networks divide q by (m in first order, m/s in second).
        u_scale: what they divide u by (m/s in first order, m/s^2 in second).
    """

    method: RungeKutta  # TorchScript needs the name

    def __init__(self, config: ModelConfig):
        super().__init__()
        self.order = config.order
        self.controls = 2
        nodes, weights = TABLEAUS[config.integrator]
        carried = [b * a for a, b in zip(nodes[1:], weights[1:], strict=True)] + [0.0]
        self.added = config.motion_input == "added"
        drive = 1.0 if self.added else 0.0
        self.method = RungeKutta(config.dt_s, list(nodes), list(weights), carried, drive)
        self.q_scale = Q_SCALES[config.order] if config.conditioned else 1.0
        self.u_scale = U_SCALES[config.order] if config.conditioned else 1.0
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
        if not (self.added and config.conditioned):
            # Zeros would keep the decoder's inputs from having any effect, and any gradient.
            nn.init.uniform_(self.last, -(width**-0.5), width**-0.5)

    def prepare(self, static: Tensor) -> OdeNetwork:
        """Return both networks as one, for agents with classes [B, N, C]."""
        of_q = torch.cat((self.first[0, :, :2], self.first[1, :, :2])).t()
        of_u = torch.block_diag(self.first[0:1, :, 2], self.first[1:2, :, 2])
        state_weight, input_weight = of_q / self.q_scale, of_u / self.u_scale
        bias = self.first_bias.flatten()
        if self.static_size > 0:
            bias = bias + torch.matmul(static, self.first[:, :, 3:].flatten(0, 1).t()).unsqueeze(2)
        inner: list[Tensor] = []
        for weight in self.inner.unbind(0):
            inner.append(torch.block_diag(weight[0], weight[1]).t())
        output = torch.block_diag(self.last[0].unsqueeze(1), self.last[1].unsqueeze(1))
        unit_slope = (output.t().unsqueeze(1) * state_weight.unsqueeze(0)).flatten(0, 1)
        return OdeNetwork(
            state_weight=state_weight,
            input_weight=input_weight,
            first_bias=bias,
            inner_weights=inner,
            inner_biases=list(self.inner_bias.flatten(1).unbind(0)),
            output_weight=output,
            output_bias=self.last_bias,
            unit_slope=unit_slope,
            full_slope=unit_slope.sum(1, keepdim=True),
        )

    def command(self, control: Tensor, velocity: Tensor) -> Tensor:
        """Return the input u [B, N, M, 2] (m/s or m/s^2).

        Args:
            control: [B, N, M, 2] of the decoder (m/s or m/s^2).
            velocity: [B, N, 2] at t, in the agents' frames (m/s).
        """
        if self.order == 1 and self.added:
            return control + velocity.unsqueeze(2)
        return control.to(velocity.dtype)  # autocast may have narrowed it

    def forward(
        self, state: Tensor, u: Tensor, network: OdeNetwork, with_slopes: bool
    ) -> tuple[Tensor, list[Tensor]]:
        """Return the state [B, N, M, S] one step later (eq. 21a), and the stages' derivatives.

        Args:
            state: [B, N, M, S] in the agents' frames.
            u: [B, N, M, 2] result of :meth:`command`.
            network: result of :meth:`prepare`.
            with_slopes: whether the derivatives are needed, by :meth:`jacobian`.
        """
        return ode_step(state, u, network, self.method, with_slopes)

    def jacobian(self, slopes: list[list[Tensor]], agents: list[int]) -> tuple[Tensor, Tensor]:
        """Return the blocks D and B of F (eq. 22) at all steps, in closed form.

        They are derivatives of the discrete step that moves the mean (docs/design.md, decision 8).

        Args:
            slopes: of :meth:`forward` at all steps.
            agents: B, N, M.

        Returns:
            [2, 2, H, B, N, M] of the next q and of the next position by q, derivatives of the
            first index's component by the second's (in first order the latter has no meaning). The
            position's derivative by itself is the identity.
        """
        dt_s, nodes = self.method.dt_s, self.method.nodes
        weights, carried = self.method.weights, self.method.carried
        size = [2, 2, len(slopes), agents[0], agents[1], agents[2]]
        slope = torch.stack([stages[0] for stages in slopes], dim=1).view(size)
        eye = torch.eye(2, dtype=slope.dtype, device=slope.device).view(2, 2, 1, 1, 1, 1)
        gain = slope
        total = weights[0] * gain
        moved = carried[0] * gain
        for i in range(1, len(nodes)):
            slope = torch.stack([stages[i] for stages in slopes], dim=1).view(size)
            # Chain rule: d k_i = slope (I + a_i dt d k_{i-1}).
            gain = slope + (dt_s * nodes[i]) * block_product(slope, gain)
            total = total + weights[i] * gain
            moved = moved + carried[i] * gain
        return eye + dt_s * total, dt_s * eye + (dt_s * dt_s) * moved
