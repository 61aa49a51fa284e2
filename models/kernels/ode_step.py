# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""One step of the neural ODE with its gradient written out, for training.

What :meth:`models.neural_ode.NeuralODE.move` computes for networks of one hidden layer, with the
states in columns: products with two long rows are five times as fast as those with two short
columns, and e = exp(min(a, 0)) is at once what ELU and its derivative need: elu(a) is
max(a, 0) + e - 1 and elu'(a) is e. Autograd would keep more and take four times as many operators.
"""

from typing import Any, NamedTuple

import torch
from torch import Tensor


class Scheme(NamedTuple):
    """A Runge-Kutta method as :data:`models.neural_ode.TABLEAUS` has it.

    Attributes:
        dt_s: step (s).
        nodes: a_i.
        weights: b_i.
        carried: b_{i+1} a_{i+1}, how k_i enters the position of a second-order model.
    """

    dt_s: float
    nodes: list[float]
    weights: list[float]
    carried: list[float]


class OdeStep(torch.autograd.Function):
    """The state one step later, and for each stage the derivative of the field by q.

    The field is k = u + out^T elu(of_q^T q + of_u^T u + rest) + out_bias.
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
        scheme: Scheme,
        with_slopes: bool,
    ) -> tuple[Tensor, ...]:
        """State [B, N, M, S], and where asked for [4, B N M] for each stage.

        Args:
            ctx: of autograd.
            state: [B, N, M, S] before the step; the last two are q.
            u: [B, N, M, 2] the input.
            of_q: [2, W], see :class:`models.neural_ode.Field`, as for the next five.
            of_u: [2, W].
            rest: [W] or [B, N, 1, W].
            out: [W, 2].
            out_bias: [2].
            through: [4, W].
            scheme: the method.
            with_slopes: whether the derivatives are wanted.
        """
        columns, inputs = _columns(state), _columns(u)
        q = columns[-2:]
        bias = rest.unsqueeze(1)
        if rest.dim() > 1:
            bias = rest.flatten(0, -2).t().repeat_interleave(state.size(2), dim=1)
        base = torch.addmm(bias, of_u.t(), inputs)
        command = inputs + out_bias.unsqueeze(1)
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
        """Gradients of the eight tensors."""
        of_q, of_u, rest, out, through, inputs, *kept = ctx.saved_tensors
        scheme: Scheme = ctx.scheme
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
        g_bias = g_u.sum(1)  # the command is the input and the output's bias
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
    """[S, B N M] of [B, N, M, S]; no copy of what this module gave."""
    return x.reshape(-1, x.size(-1)).t().contiguous()
