# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A GNN: layers of one kind, one after the other."""

from itertools import pairwise

from torch import Tensor, nn

from models.gnn_layers.gat import GAT
from models.gnn_layers.gat_plus import GATPlus
from models.gnn_layers.gcn import GCN
from models.gnn_layers.gnn_layer import Edges, GNNLayer, NodeOnly
from models.gnn_layers.graph_conv import GraphConv
from models.gnn_layers.interaction_graph import GaussianKernel

EdgeList = list[Edges]
"""What each layer of a GNN needs of a graph."""

_PLAIN: dict[str, type[NodeOnly] | type[GraphConv] | type[GCN]] = {
    "none": NodeOnly,
    "graphconv": GraphConv,
    "gcn": GCN,
}
_ATTENTION: dict[str, type[GAT]] = {"gat": GAT, "gat+": GATPlus}


def make_layer(
    name: str, size_in: int, size_out: int, heads: int = 1, tied: bool = True
) -> GNNLayer:
    """Return the layer called ``name``; ``none`` is the layer without edges.

    Raises:
        ValueError: no layer has this name.
    """
    if name in _PLAIN:
        return _PLAIN[name](size_in, size_out)
    if name in _ATTENTION:
        return _ATTENTION[name](size_in, size_out, heads, tied)
    valid = ", ".join(repr(n) for n in (*_PLAIN, *_ATTENTION))
    raise ValueError(f"layer is {name!r}, expected one of {valid}")


class GraphNetwork(nn.Module):
    """A stack of GNN layers with ELU between them; each layer has its own edge bandwidth.

    Args:
        sizes: channels before, between and after the layers.
        layer: name of the layer type, see :func:`make_layer`.
        heads: attention heads.
        tied: see :class:`models.gnn_layers.gat.GAT`.
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
        """Return what each layer needs of L graphs: squared distances (m^2), links, [L, N, N]."""
        edges: list[tuple[Tensor, Tensor]] = []
        for layer, kernel in zip(self.layers, self.kernels):  # noqa: B905 (TorchScript)
            edges.append(layer.prepare(kernel(squared_distance), link))  # type: ignore[operator]
        return edges

    def forward(self, x: Tensor, edges: EdgeList) -> Tensor:
        """Return [L, N, out] of [L, N, in] and the prepared graphs."""
        for i, layer in enumerate(self.layers):
            if i > 0:
                x = nn.functional.elu(x)
            x = layer(x, edges[i])
        return x
