# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The graph of each time step: its edges, and their weights from the distances."""

import math

import torch
from torch import Tensor, nn


def squared_distances(position: Tensor) -> Tensor:
    """Return [..., N, N] squared Euclidean distances of [..., N, 2] positions (m^2)."""
    # By component, because sums over two numbers are slow; contiguous, so that the result is.
    x, y = position.contiguous().unbind(-1)
    dx = x.unsqueeze(-1) - x.unsqueeze(-2)
    dy = y.unsqueeze(-1) - y.unsqueeze(-2)
    return torch.addcmul(dx * dx, dy, dy)


def complete_graph(present: Tensor) -> Tensor:
    """Return [..., N, N] true where there is an edge, from presence [..., N].

    All present agents are linked with each other and with themselves (docs/design.md, decision 3).
    An absent agent keeps its own loop only (decision 2), so that its unused row of the attention
    stays finite.
    """
    own = torch.eye(present.size(-1), dtype=torch.bool, device=present.device)
    return (present.unsqueeze(-1) & present.unsqueeze(-2)) | own


class GaussianKernel(nn.Module):
    """Edge weight e = exp(-(d / sigma)^2) with a learned bandwidth sigma (eq. 13).

    Args:
        bandwidth_m: first value of the bandwidth (m); its logarithm is learned.
    """

    def __init__(self, bandwidth_m: float):
        super().__init__()
        self.log_bandwidth = nn.Parameter(torch.tensor(math.log(bandwidth_m)))

    def forward(self, squared_distance: Tensor) -> Tensor:
        """Return [..., N, N] weights in (0, 1] of squared distances (m^2)."""
        return torch.exp(-squared_distance * torch.exp(-2.0 * self.log_bandwidth))
