# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""One Runge-Kutta step of the neural ODE.

Why the gradient is written out: with the states in columns, a product with two rows takes a fifth
of the time of one with two columns, and e = exp(min(a, 0)) gives both ELU, elu(a) = max(a, 0) +
e - 1, and its derivative, elu'(a) = e. Autograd keeps more memory and takes four times as many
operators; the step takes a third of its time (docs/performance.md, "A step of training").
"""

from typing import Any, NamedTuple

import torch
from torch import Tensor, nn


class RungeKutta(NamedTuple):
    """An explicit Runge-Kutta method whose stage i needs stage i - 1 alone.

    Attributes:
        dt_s: step (s).
        nodes: a_i: k_i = f(q + dt a_i k_{i-1}).
        weights: b_i: q' = q + dt sum_i b_i k_i.
        carried: b_{i+1} a_{i+1}: p' = p + dt q + dt^2 sum_i b_{i+1} a_{i+1} k_i, the position of a
            second-order model when the same method integrates the whole state.
        drive: factor on u in dq/dt = drive u + f(q, u): 1, or 0 as in the paper.
    """

    dt_s: float
    nodes: list[float]
    weights: list[float]
    carried: list[float]
    drive: float = 1.0


class OdeNetwork(NamedTuple):
    """Both networks f_1 and f_2 as one, W being 2 x ``ode_hidden`` units; weights in rows.

    Attributes:
        state_weight: [2, W] first layer, of the states q.
        input_weight: [2, W] first layer, of the inputs u, each into its own network.
        first_bias: [W] or [B, N, 1, W] first layer, the class's contribution included.
        inner_weights: [W, W] of each further hidden layer.
        inner_biases: [W] of each further hidden layer.
        output_weight: [W, 2].
        output_bias: [2].
        unit_slope: [4, W] derivative of the output (first index of the four) by q (second) through
            each unit of the first layer where the unit has slope 1, if it is the only one.
        full_slope: [4, 1] sum of ``unit_slope`` over the units.
    """

    state_weight: Tensor
    input_weight: Tensor
    first_bias: Tensor
    inner_weights: list[Tensor]
    inner_biases: list[Tensor]
    output_weight: Tensor
    output_bias: Tensor
    unit_slope: Tensor
    full_slope: Tensor


def rate(
    q: Tensor, drive: Tensor, of_input: Tensor, network: OdeNetwork, with_slope: bool
) -> tuple[Tensor, Tensor]:
    """Return [..., 2] dq/dt = drive + f(q, u) and its derivative by q, empty if not asked for.

    The derivative is [4, R] with R the number of states: of the first, of the second component,
    each by both. That of ELU is exp(min(a, 0)), which is min(elu(a), 0) + 1.

    Args:
        q: [..., 2].
        drive: [..., 2] what is added to f: u, or zero as in the paper.
        of_input: [..., W] the part of the first layer that does not depend on q.
        network: f.
        with_slope: whether the derivative is needed.
    """
    hidden = nn.functional.elu(torch.matmul(q, network.state_weight) + of_input)
    slope = hidden[:0]
    if len(network.inner_weights) == 0:
        if with_slope:
            drop = hidden.clamp(max=0.0).view(-1, hidden.size(-1))
            slope = torch.addmm(network.full_slope, network.unit_slope, drop.t())
    else:
        gain = hidden.clamp(max=0.0) + 1.0
        tangent = network.state_weight * gain.unsqueeze(-2)  # [..., 2, W]
        for i, weight in enumerate(network.inner_weights):
            hidden = nn.functional.elu(torch.matmul(hidden, weight) + network.inner_biases[i])
            if with_slope:
                gain = (hidden.clamp(max=0.0) + 1.0).unsqueeze(-2)
                tangent = torch.matmul(tangent, weight) * gain
        if with_slope:
            slope = torch.matmul(tangent, network.output_weight).view(-1, 2, 2)  # [R, by, of]
            slope = slope.permute(2, 1, 0).reshape(4, -1)
    return drive + torch.matmul(hidden, network.output_weight) + network.output_bias, slope


def plain_ode_step(
    state: Tensor, u: Tensor, network: OdeNetwork, method: RungeKutta, with_slopes: bool
) -> tuple[Tensor, list[Tensor]]:
    """Return the state [B, N, M, S] one step later, and the derivative [4, B N M] of each stage.

    Integrates the motion model: eq. (18) for S = 2 with q = (x, y), eq. (19) for S = 4 with
    q = (vx, vy).

    Args:
        state: [B, N, M, S] before the step; the last two components are q.
        u: [B, N, M, 2] the input.
        network: f.
        method: how to integrate.
        with_slopes: whether the derivatives of the stages' rates by q are needed.
    """
    dt_s = method.dt_s
    of_input = torch.matmul(u, network.input_weight) + network.first_bias
    drive = u * method.drive
    # Split, not indexed: the gradient of an index fills the whole array with zeros.
    parts = state.split(2, dim=-1)
    q = parts[-1]
    k, slope = rate(q, drive, of_input, network, with_slopes)
    slopes = [slope]
    total = method.weights[0] * k
    moved = method.carried[0] * k
    for i in range(1, len(method.nodes)):
        reached = q + (dt_s * method.nodes[i]) * k
        k, slope = rate(reached, drive, of_input, network, with_slopes)
        slopes.append(slope)
        total = total + method.weights[i] * k
        moved = moved + method.carried[i] * k
    following = q + dt_s * total
    if len(parts) == 1:
        return following, slopes
    position = parts[0] + dt_s * q + (dt_s * dt_s) * moved
    return torch.cat((position, following), dim=-1), slopes


class OdeStep(torch.autograd.Function):
    """:func:`plain_ode_step` of networks with one hidden layer, with its gradient.

    In columns, the rate is k = drive u + out^T elu(of_q^T q + of_u^T u + rest) + out_bias.
    """

    @staticmethod
    def forward(
        ctx: Any,
        state: Tensor,
        u: Tensor,
        of_q: Tensor,
        of_u: Tensor,
        rest: Tensor,
        out: Tensor,
        out_bias: Tensor,
        through: Tensor,
        scheme: RungeKutta,
        with_slopes: bool,
    ) -> tuple[Tensor, ...]:
        """Return the state [B, N, M, S] and, where asked for, [4, B N M] for each stage.

        Args:
            ctx: autograd's.
            state: [B, N, M, S] before the step; the last two components are q.
            u: [B, N, M, 2] the input.
            of_q: ``state_weight`` of :class:`OdeNetwork`.
            of_u: ``input_weight``.
            rest: ``first_bias``.
            out: ``output_weight``.
            out_bias: ``output_bias``.
            through: ``unit_slope``.
            scheme: how to integrate.
            with_slopes: whether the derivatives are needed.
        """
        columns, inputs = _columns(state), _columns(u)
        q = columns[-2:]
        bias = rest.unsqueeze(1)
        if rest.dim() > 1:
            bias = rest.flatten(0, -2).t().repeat_interleave(state.size(2), dim=1)
        base = torch.addmm(bias, of_u.t(), inputs)
        command = torch.add(out_bias.unsqueeze(1), inputs, alpha=scheme.drive)
        k = command
        total, moved = torch.zeros_like(q), torch.zeros_like(q)
        kept: list[Tensor] = []
        slopes: list[Tensor] = []
        for node, weight, carried in zip(
            scheme.nodes, scheme.weights, scheme.carried, strict=True
        ):
            reach = torch.add(q, k, alpha=scheme.dt_s * node) if node else q
            a = torch.addmm(base, of_q.t(), reach)
            e = a.clamp(max=0.0).exp_()
            hidden = a.clamp_(min=0.0).add_(e).sub_(1.0)
            k = torch.addmm(command, out.t(), hidden)
            total.add_(k, alpha=weight)
            moved.add_(k, alpha=carried)
            kept += [reach, e, hidden]
            if with_slopes:
                slopes.append(torch.mm(through, e))
        following = torch.add(q, total, alpha=scheme.dt_s)
        if columns.size(0) == 4:
            position = torch.add(columns[:2], q, alpha=scheme.dt_s)
            position.add_(moved, alpha=scheme.dt_s * scheme.dt_s)
            following = torch.cat((position, following))
        ctx.save_for_backward(of_q, of_u, rest, out, through, inputs, *kept)
        ctx.scheme = scheme
        ctx.leading = state.shape[:3]
        ctx.states = state.size(3)
        ctx.set_materialize_grads(False)
        return (following.t().view(state.shape), *slopes)

    @staticmethod
    def backward(ctx: Any, *grads: Tensor | None) -> tuple[Tensor | None, ...]:
        """Return the gradients of the eight tensors."""
        of_q, of_u, rest, out, through, inputs, *kept = ctx.saved_tensors
        scheme: RungeKutta = ctx.scheme
        reached, gains, units = kept[::3], kept[1::3], kept[2::3]
        of_slopes = grads[1:]
        dt = scheme.dt_s
        if grads[0] is None:
            g_state = inputs.new_zeros((ctx.states, inputs.size(1)))
        else:
            g_state = _columns(grads[0])
        g_next = g_state[-2:]
        g_q = g_next.clone()
        if g_state.size(0) == 4:
            g_q.add_(g_state[:2], alpha=dt)
        g_u, g_base = torch.zeros_like(inputs), torch.zeros_like(units[0])
        g_of_q, g_out, g_through = (torch.zeros_like(x) for x in (of_q, out, through))
        g_reach: Tensor | None = None
        for i in reversed(range(len(scheme.nodes))):
            g_k = g_next * (dt * scheme.weights[i])
            if g_state.size(0) == 4 and scheme.carried[i]:
                g_k.add_(g_state[:2], alpha=dt * dt * scheme.carried[i])
            if g_reach is not None:
                g_k.add_(g_reach, alpha=dt * scheme.nodes[i + 1])
            g_u += g_k
            g_out += torch.mm(g_k, units[i].t()).t()
            g_a = torch.mm(out, g_k)
            slope = of_slopes[i] if of_slopes else None
            if slope is not None:
                g_through += torch.mm(slope, gains[i].t())
                # e rises only where a is negative; elsewhere it is 1.
                g_a.add_(torch.mm(through.t(), slope).masked_fill_(gains[i] == 1.0, 0.0))
            g_a.mul_(gains[i])
            g_reach = torch.mm(of_q, g_a)
            g_q += g_reach
            g_base += g_a
            g_of_q += torch.mm(reached[i], g_a.t())
        g_bias = g_u.sum(1)  # the command is drive times the input and the output's bias
        g_u.mul_(scheme.drive)
        g_of_u = torch.mm(inputs, g_base.t())
        g_u += torch.mm(of_u, g_base)
        if rest.dim() > 1:
            g_rest = g_base.view(g_base.size(0), -1, ctx.leading[2]).sum(2).t().reshape(rest.shape)
        else:
            g_rest = g_base.sum(1)
        g_before = torch.cat((g_state[:2], g_q)) if g_state.size(0) == 4 else g_q
        return (
            g_before.t().view(*ctx.leading, -1),
            g_u.t().view(*ctx.leading, -1),
            g_of_q,
            g_of_u,
            g_rest,
            g_out,
            g_bias,
            g_through,
            None,
            None,
        )


def _columns(x: Tensor) -> Tensor:
    """Return [S, B N M] of [B, N, M, S], without a copy where this module made it."""
    return x.reshape(-1, x.size(-1)).t().contiguous()


def ode_step(
    state: Tensor, u: Tensor, network: OdeNetwork, method: RungeKutta, with_slopes: bool
) -> tuple[Tensor, list[Tensor]]:
    """Return :func:`plain_ode_step`, by the kernel where it has that network's form."""
    if torch.jit.is_scripting() or not kernel_covers(state, u, network):
        return plain_ode_step(state, u, network, method, with_slopes)
    following, *slopes = OdeStep.apply(
        state,
        u,
        network.state_weight,
        network.input_weight,
        network.first_bias,
        network.output_weight,
        network.output_bias,
        network.unit_slope,
        method,
        with_slopes,
    )
    return following, slopes


@torch.jit.unused
def kernel_covers(state: Tensor, u: Tensor, network: OdeNetwork) -> bool:
    """Return whether :class:`OdeStep` applies: one hidden layer, one type, no autocast."""
    device = state.device.type
    if torch.amp.is_autocast_available(device) and torch.is_autocast_enabled(device):
        return False
    types = {x.dtype for x in (state, u, network.state_weight, network.first_bias)}
    return not network.inner_weights and len(types) == 1
