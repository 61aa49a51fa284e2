# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Convolutional social pooling against the social tensor, formed agent by agent."""

import pytest
import torch
from baseline_samples import GRID, close, crowd, social_tensor

from models.baselines.baseline_config import GridConfig
from models.baselines.cs_lstm import ConvolutionalPooling


@torch.no_grad()
def test_convolutional_pooling_sees_the_social_tensor():
    pooling = ConvolutionalPooling(GRID).double()
    h, *where = crowd()
    tensor = social_tensor(h, *where, GRID).permute(0, 1, 4, 2, 3).flatten(0, 1)
    links = pooling.prepare(*where)
    close((pooling.tensor(h, links),), (tensor,))
    features = pooling(h, links)
    assert features.shape == (2, 9, pooling.size)
    assert pooling.size == 16 * 2 * 1


@pytest.mark.parametrize(("rows", "columns", "size"), [(13, 3, 80), (5, 3, 16), (9, 5, 144)])
def test_the_published_grid_gives_the_published_size(rows, columns, size):
    """13 x 3 cells give 80 channels, as in Deo and Trivedi."""
    pooling = ConvolutionalPooling(GridConfig(hidden=4, rows=rows, columns=columns))
    h, *where = crowd()
    assert pooling.size == size
    assert pooling(h.float(), pooling.prepare(*where)).shape[-1] == size
