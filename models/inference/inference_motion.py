# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The neural ODE and its Jacobian for inference, on deviations from uniform motion.

With p = p_0 + v_0 k dt + d and v = v_0 + w, the states (d, w) follow the same Runge-Kutta step;
v_0's part of the first layer is a constant of the agent, and the decoder, which sees deviations,
needs no subtraction. The stages' rates k_i = u + h_i O + o enter the next stage only through the
first layer, so the ELU units h_i follow each other directly (a_i: nodes, Q and O: first and
last layer):

    h_1 = elu(b + w Q),  h_i = elu(b + w Q + a_i dt (u + o) Q + a_i dt h_{i-1} (O Q)).

What is linear in u, d and w, the next state's part included, comes out of one product.
"""

import torch
from torch import Tensor, nn

from models.kernels.block_product import block_product
from models.neural_ode import NeuralODE


class FastMotion(nn.Module):
    """Equivalent of :class:`models.neural_ode.NeuralODE` in second order with one hidden layer.

    Columns of the product: b + w Q, dt (u + o) Q, and the next state without the networks' part.

    Args:
        motion: the motion model.
        modes: M.
    """

    product: Tensor
    bias: Tensor
    of_q: Tensor
    recurrent: Tensor
    output: Tensor
    through: Tensor
    base: Tensor
    of_static: Tensor

    def __init__(self, motion: NeuralODE, modes: int):
        super().__init__()
        self.modes = modes
        method = motion.method
        self.nodes, self.weights, self.carried = method.nodes, method.weights, method.carried
        self.dt_s = dt = method.dt_s
        self.static_size = motion.static_size
        first, last = motion.first.detach().double(), motion.last.detach().double()
        width = 2 * first.size(1)
        self.width = width
        self.columns = 2 * width + 4
        of_q = torch.cat((first[0, :, :2], first[1, :, :2])).t() / motion.q_scale  # [2, 2W]
        of_u = torch.block_diag(first[0:1, :, 2], first[1:2, :, 2]) / motion.u_scale
        output = torch.block_diag(last[0].unsqueeze(1), last[1].unsqueeze(1))  # [2W, 2]
        shift = motion.last_bias.detach().double()
        moved = dt * dt * sum(self.carried)
        eye = torch.eye(2, dtype=torch.float64)
        free = torch.eye(4, dtype=torch.float64)
        free[2:, :2] = dt * eye
        none = torch.zeros(4, width, dtype=torch.float64)
        drive = method.drive  # what dq/dt = drive u + f(q, u) has of u by itself
        of_drive = torch.cat((dt * of_q, moved * eye, dt * eye), dim=1)
        of_control = torch.cat((of_u, drive * of_drive), dim=1)  # [2, columns]
        of_state = torch.cat((none, none, free), dim=1)  # [4, columns]
        of_state[2:, :width] = of_q
        self.register_buffer("product", torch.cat((of_control, of_state)))
        rest = motion.first_bias.detach().double().flatten()
        constant = torch.cat((rest, dt * shift @ of_q, moved * shift, dt * shift))
        self.register_buffer("bias", constant)
        self.register_buffer("of_q", of_q)
        self.register_buffer("recurrent", dt * output @ of_q)  # [2W, 2W]
        stages = [
            torch.cat((dt * dt * c * output, dt * b * output), dim=1)
            for b, c in zip(self.weights, self.carried, strict=True)
        ]
        # [4, stages 2W]: a product with few columns is faster from rows.
        self.register_buffer("output", torch.cat(stages).t().contiguous())
        through = of_q.t().unsqueeze(-1) * output.unsqueeze(1)  # [2W, 2 (by), 2 (of)]
        through = through.transpose(1, 2).flatten(1).t()  # [4, 2W], of first
        self.register_buffer("through", through.contiguous())
        self.register_buffer("base", through.sum(1, keepdim=True))
        self.register_buffer("of_static", first[:, :, 3:].flatten(0, 1).t().contiguous())

    def prepare(self, static: Tensor, velocity: Tensor) -> Tensor:
        """Return [B N M, columns] constants of the product, from classes and v_0 [B, N, 2]."""
        own = torch.matmul(velocity.flatten(0, 1), self.of_q)
        if self.static_size > 0:
            own = own + torch.matmul(static.flatten(0, 1), self.of_static)
        whole = self.bias.repeat(own.size(0), self.modes, 1)
        whole[..., : self.width].add_(own.unsqueeze(1))
        return whole.flatten(0, 1)

    def forward(self, state: Tensor, control: Tensor, constant: Tensor) -> tuple[Tensor, Tensor]:
        """Return deviations [R, 4] one step later, and the stages' units [R, stages 2W].

        Args:
            state: [R, 4] with R = B N M.
            control: [R, 2] of the decoder.
            constant: result of :meth:`prepare`.
        """
        width = self.width
        linear = torch.addmm(constant, torch.cat((control, state), dim=1), self.product)
        before, drive, free = linear.split([width, width, 4], dim=1)
        unit = nn.functional.elu(before)
        units = [unit]
        driven = before
        for i in range(1, len(self.nodes)):
            node = self.nodes[i]
            if node != self.nodes[i - 1]:
                driven = torch.add(before, drive, alpha=node)
            unit = torch.addmm(driven, unit, self.recurrent, alpha=node)
            unit = nn.functional.elu(unit, inplace=True)
            units.append(unit)
        joined = torch.cat(units, dim=1)
        return torch.addmm(free, joined, self.output.t()), joined

    def jacobian(self, units: Tensor) -> tuple[Tensor, Tensor]:
        """Return [2, 2, R] derivatives of the next q and position by q, from units [R, .].

        ELU's derivative is min(elu, 0) + 1. The units are overwritten.
        """
        gains = units.clamp_(max=0.0).split(self.width, dim=1)
        eye = torch.eye(2, dtype=units.dtype, device=units.device).unsqueeze(-1)
        slope = torch.addmm(self.base, self.through, gains[0].t()).view(2, 2, -1)
        rate = slope
        total, moved = self.weights[0] * rate, self.carried[0] * rate
        for i in range(1, len(self.nodes)):
            slope = torch.addmm(self.base, self.through, gains[i].t()).view(2, 2, -1)
            # Chain rule: d k_i = slope (I + a_i dt d k_{i-1}).
            rate = torch.add(slope, block_product(slope, rate), alpha=self.dt_s * self.nodes[i])
            total.add_(rate, alpha=self.weights[i])
            moved.add_(rate, alpha=self.carried[i])
        return (
            torch.add(eye, total, alpha=self.dt_s),
            torch.add(self.dt_s * eye, moved, alpha=self.dt_s * self.dt_s),
        )
