# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Regions of equal size around the endpoints."""

import torch

from models.baselines.transformers.endpoint_regions import balanced_centres


def test_separate_groups_of_equal_size_have_their_means_as_centres():
    torch.manual_seed(0)
    groups = torch.tensor([[10.0, 0.0], [50.0, 0.0], [50.0, 30.0], [90.0, 0.0]])
    points = (groups.unsqueeze(1) + 0.5 * torch.randn(4, 25, 2)).view(-1, 2)
    centres = balanced_centres(points[torch.randperm(100)], 4)
    distance = torch.cdist(groups, centres).amin(dim=1)
    assert distance.max() < 0.5


def test_a_crowded_place_is_divided():
    """Nine in ten endpoints are near one place; two of three centres are there."""
    torch.manual_seed(0)
    points = torch.cat((torch.randn(90, 2) + 20.0, torch.randn(10, 2) + 80.0))
    centres = balanced_centres(points, 3)
    assert (torch.linalg.vector_norm(centres - 20.0, dim=-1) < 5.0).sum() == 2


def test_standing_agents_do_not_fill_regions():
    points = torch.cat((torch.zeros(50, 2), torch.tensor([[10.0, 0.0], [20.0, 0.0]])))
    assert balanced_centres(points, 2).tolist() == [[10.0, 0.0], [20.0, 0.0]]


def test_too_few_endpoints_give_one_place_to_all_regions():
    assert balanced_centres(torch.zeros(1, 2), 3).tolist() == [[0.0, 0.0]] * 3
