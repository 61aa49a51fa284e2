# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Small baselines, and scenes with their social tensors, for the tests."""

import math

import pytest
import torch

from models.baselines import (
    ConvolutionalSocialLSTM,
    GraphConfig,
    GraphRNN,
    GridConfig,
    RecurrentConfig,
    Seq2Seq,
    SocialLSTM,
)

KINDS = {
    "seq2seq": (Seq2Seq, RecurrentConfig),
    "s-lstm": (SocialLSTM, GridConfig),
    "cs-lstm": (ConvolutionalSocialLSTM, GridConfig),
    "gnn-rnn": (GraphRNN, GraphConfig),
}
ALL = pytest.mark.parametrize("name", KINDS)
SMALL = {"history_steps": 6, "horizon_steps": 5, "modes": 3, "hidden": 8, "embedding": 6}
GRID = GridConfig(hidden=4, embedding=3, rows=7, columns=3, cell_length_m=6.0, cell_width_m=4.0)


def make_baseline(name, dtype=torch.float64, wild=True, **choices):
    """Return a small baseline; ``wild`` gives every weight and scale a random value."""
    network, config = KINDS[name]
    model = network(config.from_dict({**SMALL, **choices})).eval()
    if wild:
        with torch.no_grad():
            for parameter in model.parameters():
                if parameter.dim() > 0:  # not the bandwidths
                    parameter.normal_(0.0, 0.5)
            condition = model.condition
            condition.input_mean.normal_()
            condition.input_std.uniform_(2.0, 9.0)
            condition.state_mean.normal_()
            condition.state_std.uniform_(3.0, 9.0)
    return model.to(dtype)


def close(results, others, tolerance=1e-9):
    for one, other in zip(results, others, strict=True):
        torch.testing.assert_close(one, other, rtol=tolerance, atol=tolerance)


def crowd(agents=9, batch=2):
    """States, positions mostly in each other's grids, headings, and a presence with gaps."""
    h = torch.randn(batch, agents, 4).double()
    position = 4.0 * torch.randn(batch, agents, 2).double()
    position[:, 1] = position[:, 0] + 0.1  # two in one cell
    angle = 3.0 * torch.randn(batch, agents).double()
    present = torch.rand(batch, agents) > 0.2
    present[:, :2] = True
    return h, position, torch.stack((angle.cos(), angle.sin()), dim=-1), present


def social_tensor(h, position, direction, present, config):
    """[B, N, rows, columns, D] agent by agent."""
    batch, agents, hidden = h.shape
    tensor = torch.zeros(batch, agents, config.rows, config.columns, hidden).double()
    for b in range(batch):
        for i in range(agents):
            for j in range(agents):
                if i == j or not (present[b, i] and present[b, j]):
                    continue
                dx, dy = (position[b, j] - position[b, i]).tolist()
                cos, sin = direction[b, i].tolist()
                row = math.floor((cos * dx + sin * dy) / config.cell_length_m + config.rows / 2)
                column = math.floor(
                    (cos * dy - sin * dx) / config.cell_width_m + config.columns / 2
                )
                if 0 <= row < config.rows and 0 <= column < config.columns:
                    tensor[b, i, row, column] += h[b, j]
    return tensor
