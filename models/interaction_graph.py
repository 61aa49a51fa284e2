# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The graph of each instant, dense: who is linked to whom, and how far apart they stand."""

import math

import torch
from torch import Tensor, nn


def squared_distances(position: Tensor) -> Tensor:
    """[..., N, N] squared Euclidean distances of [..., N, 2] positions (m^2)."""
    # Apart, because sums over two numbers are slow; contiguous, so that all that follows is.
    x, y = position.contiguous().unbind(-1)
    dx = x.unsqueeze(-1) - x.unsqueeze(-2)
    dy = y.unsqueeze(-1) - y.unsqueeze(-2)
    return torch.addcmul(dx * dx, dy, dy)


def complete_graph(present: Tensor) -> Tensor:
    """[..., N, N] true where two agents are linked, from presence [..., N] (design D2, D3).

    All present agents are linked with each other and with themselves. An absent agent keeps its
    own loop only, so that its (unused) row of the attention stays finite.
    """
    own = torch.eye(present.size(-1), dtype=torch.bool, device=present.device)
    return (present.unsqueeze(-1) & present.unsqueeze(-2)) | own


class GaussianKernel(nn.Module):
    """Edge weight exp(-(d / sigma)^2) with a learned bandwidth sigma (eq. edge_weight).

    Args:
        bandwidth_m: first value of the bandwidth (m); its logarithm is learned.
    """

    def __init__(self, bandwidth_m: float):
        super().__init__()
        self.log_bandwidth = nn.Parameter(torch.tensor(math.log(bandwidth_m)))

    def forward(self, squared_distance: Tensor) -> Tensor:
        """[..., N, N] weights in (0, 1] of squared distances (m^2)."""
        return torch.exp(-squared_distance * torch.exp(-2.0 * self.log_bandwidth))
