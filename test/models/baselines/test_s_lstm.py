# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Social pooling against a layer on the social tensor, formed agent by agent."""

import torch
from baseline_samples import GRID, close, crowd, social_tensor

from models.baselines.s_lstm import SocialPooling


@torch.no_grad()
def test_social_pooling_is_a_layer_on_the_social_tensor():
    pooling = SocialPooling(GRID).double()
    pooling.bias.normal_()
    h, *where = crowd()
    tensor = social_tensor(h, *where, GRID)
    assert (tensor.abs().sum(-1) > 0).sum() > 20  # the grids are not empty
    weight = pooling.contribution.weight.view(7, 3, 3, 4)  # rows, columns, out, D
    expected = torch.relu(torch.einsum("bnrcd,rcod->bno", tensor, weight) + pooling.bias)
    close((pooling(h, pooling.prepare(*where)),), (expected,))
