# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What the network sees of trails, by hand."""

import pytest
import torch

from models.network_config import NetworkConfig
from models.own_frame.trail_input import LARGEST_M, TrailInput


def make_input(branches, steps=25):
    torch.manual_seed(0)
    return TrailInput(NetworkConfig(hidden=6, horizon_steps=steps), branches)


def test_columns_of_a_path_by_hand():
    """Place / (5, 2) m, velocity / (3, 1) m/s, share; no velocity where the path is unknown."""
    trails = torch.zeros(1, 1, 2, 3, 3)
    trails[0, 0, 0] = torch.tensor([[0.0, 0.2, 0.7], [-0.6, 0.8, 0.7], [0.0, 0.0, 0.0]])
    columns, _ = make_input(2, 3)(trails)
    assert columns.shape == (3, 1, 1, 10)
    expected = torch.tensor(
        [[0.0, 0.1, 0.0, 1.0, 0.7], [-0.12, 0.4, -1.0, 3.0, 0.7], [0.0, 0.0, 0.0, 0.0, 0.0]]
    )
    torch.testing.assert_close(columns[:, 0, 0, :5], expected)
    assert not columns[..., 5:].any()  # a path of which nothing is known


def test_far_places_are_cut_off():
    near, far = torch.zeros(2, 1, 1, 1, 2, 3)
    near[..., :2], far[..., :2] = LARGEST_M, 900.0
    near[..., 2] = far[..., 2] = 1.0
    inputs = make_input(1, 2)
    torch.testing.assert_close(inputs(far), inputs(near), rtol=0.0, atol=0.0)


def test_agents_and_branches_stay_apart():
    trails = torch.randn(2, 3, 2, 4, 3)
    inputs = make_input(2, 4)
    columns, summary = inputs(trails)
    changed = trails.clone()
    changed[1, 2, 1] += 1.0
    other, of_other = inputs(changed)
    differs = (other != columns).any(0)  # [B, N, R * 5]
    assert differs.nonzero()[:, :2].unique(dim=0).tolist() == [[1, 2]]
    assert not differs[1, 2, :5].any()
    assert (of_other != summary).any(-1).nonzero().tolist() == [[1, 2]]


@pytest.mark.parametrize(
    ("steps", "seen"),
    [(25, [4, 9, 14, 19, 24]), (12, [1, 3, 5, 7, 9, 11]), (3, [0, 1, 2]), (1, [0])],
)
def test_the_summary_sees_steps_spread_over_the_horizon(steps, seen):
    inputs = make_input(1, steps)
    trails = torch.zeros(1, 1, 1, steps, 3, requires_grad=True)
    # The share is a column of its own step alone.
    inputs(trails)[1].sum().backward()
    assert trails.grad[0, 0, 0, :, 2].nonzero().flatten().tolist() == seen


def test_untrained_it_adds_little():
    """A hundredth of an ordinary layer, so that an untrained network moves agents uniformly."""
    inputs = make_input(3)
    columns, summary = inputs(torch.randn(1, 4, 3, 25, 3))
    assert 0.0 < inputs.embed(columns).abs().max() < 0.2
    assert 0.0 < summary.abs().max() < 0.1
    nothing, of_nothing = inputs(torch.zeros(1, 4, 3, 25, 3))
    assert not inputs.embed(nothing).any()
    assert of_nothing.abs().max() < 0.01


def test_missing_trails_are_an_error():
    with pytest.raises(ValueError, match="is given no trails, expected"):
        make_input(3)(None)
