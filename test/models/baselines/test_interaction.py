# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The three interactions against obvious slow loops, and the grid by hand."""

import math

import pytest
import torch
from baseline_samples import close

from models.baselines.baseline_config import GraphConfig, GridConfig
from models.baselines.cs_lstm import ConvolutionalPooling
from models.baselines.gnn_rnn import GraphInteraction
from models.baselines.interaction import NoInteraction
from models.baselines.s_lstm import SocialPooling
from models.baselines.social_grid import Grid

GRID = GridConfig(hidden=4, embedding=3, rows=7, columns=3, cell_length_m=6.0, cell_width_m=4.0)


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


def test_the_grid_by_hand():
    """The agent heads along y: seven metres ahead is one row on, five to its left a column."""
    position = torch.tensor([[[0.0, 0.0], [0.0, 7.0], [-5.0, 0.0], [2.0, -4.0], [0.0, 22.0]]])
    direction = torch.tensor([0.0, 1.0]).expand(1, 5, 2)
    present = torch.ones(1, 5, dtype=torch.bool)
    cell = Grid(GRID)(position, direction, present)
    middle = 3 * 3 + 1
    assert cell[0, 0].tolist() == [21, middle + 3, middle + 1, middle - 3, 21]


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


@torch.no_grad()
def test_the_graph_is_that_of_the_present_agents():
    interaction = GraphInteraction(GraphConfig(hidden=4, embedding=3, bandwidth_m=10.0)).double()
    h, position, direction, present = crowd()
    features = interaction(h, interaction.prepare(position, direction, present))
    for b in range(2):
        here = present[b]
        fewer = (position[b : b + 1, here], direction[b : b + 1, here], present[b : b + 1, here])
        close(
            (features[b, here],),
            (interaction(h[b : b + 1, here], interaction.prepare(*fewer))[0],),
        )


@torch.no_grad()
def test_a_near_neighbour_counts_differently_from_a_far_one():
    """The edge weights reach the graph network."""
    interaction = GraphInteraction(GraphConfig(hidden=4, embedding=3, bandwidth_m=10.0)).double()
    h, position, direction, present = crowd(3, 1)
    near = interaction(h, interaction.prepare(position, direction, present))
    far = interaction(h, interaction.prepare(3.0 * position, direction, present))
    assert not torch.allclose(near, far)


def test_without_interaction_there_are_no_features():
    h, *where = crowd()
    interaction = NoInteraction()
    assert interaction(h, interaction.prepare(*where)).shape == (2, 9, 0)
