# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Update of the gated recurrent unit from its intermediate vectors.

Why the gradient is written out: it takes a third of the operators that autograd needs for the same
(counted), and the update runs once per history and horizon step.
"""

from typing import Any

import torch
from torch import Tensor


def plain_gru_update(kappa: Tensor, xi: Tensor, bias: Tensor, h: Tensor) -> Tensor:
    """Return the next state [..., D] (GRU update, eq. 6).

    r  = sigmoid(kappa_r + xi_r + b_r)
    z  = sigmoid(kappa_z + xi_z + b_z)
    h~ = tanh(kappa_h + r xi_h + b_h)
    h' = (1 - z) h~ + z h

    Args:
        kappa: [..., 3D] kappa_r, kappa_z, kappa_h: the input's GNN (eq. 7a).
        xi: [..., 3D] xi_r, xi_z, xi_h: the state's GNN (eq. 7b).
        bias: [3D] b_r, b_z, b_h.
        h: [..., D] the state before.
    """
    size = h.size(-1)
    of_input, from_input = (kappa + bias).split([2 * size, size], dim=-1)
    of_state, from_state = xi.split([2 * size, size], dim=-1)
    r, z = torch.sigmoid(of_input + of_state).chunk(2, dim=-1)
    candidate = torch.tanh(from_input + r * from_state)
    return candidate + z * (h - candidate)


class GRUUpdate(torch.autograd.Function):
    """:func:`plain_gru_update` with its gradient."""

    @staticmethod
    def forward(ctx: Any, kappa: Tensor, xi: Tensor, bias: Tensor, h: Tensor) -> Tensor:
        """See :func:`plain_gru_update`."""
        size = h.size(-1)
        of_input, from_input = (kappa + bias).split([2 * size, size], dim=-1)
        of_state, from_state = xi.split([2 * size, size], dim=-1)
        gates = torch.add(of_input, of_state).sigmoid_()
        r, z = gates.chunk(2, dim=-1)
        candidate = torch.addcmul(from_input, r, from_state).tanh_()
        ctx.save_for_backward(gates, candidate, xi, h)
        return torch.lerp(candidate, h, z)

    @staticmethod
    def backward(ctx: Any, *grads: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """Return the gradients of all four arguments."""
        gates, candidate, xi, h = ctx.saved_tensors
        size = h.size(-1)
        r, z = gates.chunk(2, dim=-1)
        from_state = xi[..., 2 * size :]
        g_h = grads[0] * z
        inner = grads[0] - g_h  # gradient of the candidate, next line: of the tanh's argument
        inner = torch.addcmul(inner, inner, candidate * candidate, value=-1.0)
        outer = torch.cat((inner * from_state, grads[0] * (h - candidate)), dim=-1)
        outer.mul_(torch.addcmul(gates, gates, gates, value=-1.0))
        g_kappa = torch.cat((outer, inner), dim=-1)
        g_xi = torch.cat((outer, inner * r), dim=-1)
        return g_kappa, g_xi, g_kappa.flatten(0, -2).sum(0), g_h


def gru_update(kappa: Tensor, xi: Tensor, bias: Tensor, h: Tensor) -> Tensor:
    """Return :func:`plain_gru_update`, by the kernel where the types are the same."""
    if torch.jit.is_scripting() or not kappa.dtype == xi.dtype == h.dtype:
        return plain_gru_update(kappa, xi, bias, h)
    return GRUUpdate.apply(kappa, xi, bias, h)
