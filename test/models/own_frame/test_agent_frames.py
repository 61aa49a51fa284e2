# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Each agent's own frame by hand."""

import torch

from models.own_frame.agent_frames import heading, last_seen, to_own, to_scene


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
