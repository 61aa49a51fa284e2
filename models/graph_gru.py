# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The gated recurrent unit whose linear maps are GNNs (paper, "Graph-Gated Recurrent Unit")."""

from itertools import pairwise
from typing import Any

import torch
from torch import Tensor, nn

from models.gnn_layers import make_layer
from models.interaction_graph import GaussianKernel

EdgeList = list[tuple[Tensor, Tensor]]


def gru_update(kappa: Tensor, xi: Tensor, bias: Tensor, h: Tensor) -> Tensor:
    """The next state [..., D] (eq. full_gru_update).

    Args:
        kappa: [..., 3D], what a GNN made of the input.
        xi: [..., 3D], what a GNN made of the state.
        bias: [3D].
        h: [..., D] the state before.
    """
    size = h.size(-1)
    of_input, from_input = (kappa + bias).split([2 * size, size], dim=-1)
    of_state, from_state = xi.split([2 * size, size], dim=-1)
    r, z = torch.sigmoid(of_input + of_state).chunk(2, dim=-1)
    candidate = torch.tanh(from_input + r * from_state)
    return candidate + z * (h - candidate)


class GRUUpdate(torch.autograd.Function):
    """:func:`gru_update` with its gradient written out: a third of autograd's operators."""

    @staticmethod
    def forward(ctx: Any, kappa: Tensor, xi: Tensor, bias: Tensor, h: Tensor) -> Tensor:
        """See :func:`gru_update`."""
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
        """Gradients of all four arguments."""
        gates, candidate, xi, h = ctx.saved_tensors
        size = h.size(-1)
        r, z = gates.chunk(2, dim=-1)
        from_state = xi[..., 2 * size :]
        g_h = grads[0] * z
        inner = grads[0] - g_h  # the gradient of the candidate, then of what its tanh is of
        inner = torch.addcmul(inner, inner, candidate * candidate, value=-1.0)
        outer = torch.cat((inner * from_state, grads[0] * (h - candidate)), dim=-1)
        outer.mul_(torch.addcmul(gates, gates, gates, value=-1.0))
        g_kappa = torch.cat((outer, inner), dim=-1)
        g_xi = torch.cat((outer, inner * r), dim=-1)
        return g_kappa, g_xi, g_kappa.flatten(0, -2).sum(0), g_h


class GraphNetwork(nn.Module):
    """A stack of GNN layers with ELU between them; each layer has an edge bandwidth of its own.

    Args:
        sizes: channels before, between and after the layers.
        layer: name of the layer type, see :func:`models.gnn_layers.make_layer`.
        heads: attention heads.
        tied: see :class:`models.gnn_layers.GAT`.
        bandwidth_m: first value of the bandwidths (m).
    """

    def __init__(
        self, sizes: list[int], layer: str, heads: int, tied: bool, bandwidth_m: float
    ) -> None:
        super().__init__()
        pairs = list(pairwise(sizes))
        self.layers = nn.ModuleList(make_layer(layer, i, o, heads, tied) for i, o in pairs)
        self.kernels = nn.ModuleList(GaussianKernel(bandwidth_m) for _ in pairs)

    def prepare(self, squared_distance: Tensor, link: Tensor) -> EdgeList:
        """What each layer needs of L graphs: squared distances (m^2) and links, [L, N, N]."""
        edges: list[tuple[Tensor, Tensor]] = []
        for layer, kernel in zip(self.layers, self.kernels):  # noqa: B905 (TorchScript)
            edges.append(layer.prepare(kernel(squared_distance), link))  # type: ignore[operator]
        return edges

    def forward(self, x: Tensor, edges: EdgeList) -> Tensor:
        """[L, N, out] of [L, N, in] on prepared graphs."""
        for i, layer in enumerate(self.layers):
            if i > 0:
                x = nn.functional.elu(x)
            x = layer(x, edges[i])
        return x


class GraphGRU(nn.Module):
    """One step of the graph GRU (eq. gnn_interm and full_gru_update).

    The input's GNN is a part of its own, because its results do not depend on the recurrent state:
    the encoder computes them for all steps at once.

    Args:
        size_in: channels of the input f.
        hidden: D.
        layer: name of the GNN layer type, ``none`` for an ordinary GRU.
        depth: layers per GNN.
        heads: attention heads.
        tied: see :class:`models.gnn_layers.GAT`.
        bandwidth_m: first value of the bandwidths (m).
    """

    def __init__(
        self,
        size_in: int,
        hidden: int,
        layer: str,
        depth: int,
        heads: int,
        tied: bool,
        bandwidth_m: float,
    ) -> None:
        super().__init__()
        inner = [hidden] * (depth - 1) + [3 * hidden]
        self.hidden = hidden
        self.gnn_f = GraphNetwork([size_in, *inner], layer, heads, tied, bandwidth_m)
        self.gnn_h = GraphNetwork([hidden, *inner], layer, heads, tied, bandwidth_m)
        self.bias = nn.Parameter(torch.zeros(3 * hidden))

    def forward(self, kappa: Tensor, h: Tensor, edges: EdgeList) -> Tensor:
        """The next state [B, N, D].

        Args:
            kappa: [B, N, 3D], what ``gnn_f`` made of the input.
            h: [B, N, D] the state before.
            edges: the graphs, prepared by ``gnn_h``.
        """
        xi = self.gnn_h(h, edges)
        # Under autocast the types differ.
        if torch.jit.is_scripting() or not kappa.dtype == xi.dtype == h.dtype:
            return gru_update(kappa, xi, self.bias, h)
        return GRUUpdate.apply(kappa, xi, self.bias, h)
