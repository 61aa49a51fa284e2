# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Each agent's own frame by hand."""

import pytest
import torch

from models.own_frame.agent_frames import (
    Start,
    heading,
    hold_first_mode,
    last_seen,
    motion_share,
    to_own,
    to_scene,
)


def test_turning_there_and_back():
    vector = torch.randn(5, 2).double()
    angle = torch.randn(5).double()
    direction = torch.stack((angle.cos(), angle.sin()), dim=-1)
    torch.testing.assert_close(to_scene(to_own(vector, direction), direction), vector)
    north = torch.tensor([0.0, 1.0])
    assert to_own(torch.tensor([0.0, 3.0]), north).tolist() == [3.0, 0.0]
    assert to_own(torch.tensor([-2.0, 0.0]), north).tolist() == [0.0, 2.0]  # left of north


def test_heading():
    east, north = [1.0, 0.0], [0.0, 1.0]
    velocity = torch.tensor([[0.0, 5.0], [0.0, 0.4], [0.0, 0.75], [0.0, 0.0], [-0.75, 0.0]])
    yaw = torch.tensor([east, east, east, [0.0, 0.0], east])
    got = heading(velocity, yaw)
    half = [0.5**0.5, 0.5**0.5]
    want = torch.tensor([north, east, half, east, east])  # the last two directions cancel
    torch.testing.assert_close(got, want)


def test_last_seen():
    features = torch.arange(4.0).view(1, 1, 4, 1).expand(1, 3, 4, 1)
    valid = torch.tensor([[[1, 1, 1, 1], [0, 1, 0, 0], [0, 0, 0, 0]]]).bool()
    last, index = last_seen(features, valid)
    assert index.tolist() == [[3, 1, 0]]
    assert last.flatten().tolist() == [3.0, 1.0, 0.0]


def test_an_agent_stands_below_a_third_and_moves_from_half_a_metre_per_second_on():
    velocity = torch.tensor([[0.0, 0.0], [0.0, -0.3], [0.24, 0.32], [-0.5, 0.0], [20.0, 5.0]])
    share = motion_share(velocity.unsqueeze(0).double())
    torch.testing.assert_close(share, torch.tensor([[0.0, 0.0, 0.5, 1.0, 1.0]]).double())


def start_of(*speeds):
    """A scene of agents at (10, 20) m in their frames, that move along x at these speeds (m/s)."""
    velocity = torch.tensor([[[speed, 0.0] for speed in speeds]]).double()
    position = torch.tensor([10.0, 20.0]).double().expand_as(velocity)
    return Start(torch.zeros_like(velocity), torch.zeros_like(velocity), position, velocity)


@pytest.mark.parametrize("states", [2, 4])
def test_held_modes_by_hand(states):
    """One step of 0.2 s and a second: standing, half way, and moving; modes at 7 and at 9."""
    start = start_of(0.25, 0.4, 5.0)
    paths = torch.tensor([7.0, 9.0]).double().view(1, 1, 1, 2, 1).repeat(2, 1, 3, 1, states)
    held = hold_first_mode(paths, start, 0.2)
    standing = [[10.05, 20.0, 0.25, 0.0], [10.1, 20.0, 0.25, 0.0]]
    half = [[(10.08 + 7.0) / 2, 13.5, 3.7, 3.5], [(10.16 + 7.0) / 2, 13.5, 3.7, 3.5]]
    moving = [[7.0] * 4] * 2
    expected = torch.tensor([standing, half, moving]).double()[..., :states]
    torch.testing.assert_close(held[:, 0, :, 0], expected.transpose(0, 1))
    assert torch.equal(held[..., 1, :], paths[..., 1, :])


def test_a_held_mode_has_no_gradient_and_the_others_have():
    paths = torch.randn(3, 1, 2, 2, 4, requires_grad=True, dtype=torch.float64)
    hold_first_mode(paths, start_of(0.1, 3.0), 0.2).sum().backward()
    assert not paths.grad[:, 0, 0, 0].any()
    assert (paths.grad[:, 0, 0, 1] == 1.0).all()
    assert (paths.grad[:, 0, 1] == 1.0).all()
