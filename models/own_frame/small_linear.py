# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Layers whose initial output is nearly constant.

Their initial weights are a hundred times smaller than usual (docs/design.md, decision 16): the
untrained model hardly depends on its input, but gradients reach everything before these layers
from the first step on.
"""

import torch
from torch import nn

SMALL = 0.01
"""Factor on the initial weights (chosen: see above)."""


def small_linear(size_in: int, size_out: int, bias: float | None = 0.0) -> nn.Linear:
    """Return a linear layer whose initial output is nearly its bias, or 0 without a bias."""
    layer = nn.Linear(size_in, size_out, bias=bias is not None)
    with torch.no_grad():
        layer.weight.mul_(SMALL)
        if bias is not None:
            layer.bias.fill_(bias)
    return layer
