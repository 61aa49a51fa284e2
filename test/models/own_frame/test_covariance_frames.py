# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Covariances between the scene frame and the agents' frames."""

import torch
from motion_samples import B, N, definite

from models.own_frame.covariance_frames import initial_in_own_frame


def test_given_covariance_is_turned_into_the_agents_frame():
    given = definite(B, N, 4)
    given[0, 1, 0, 0] = float("inf")
    learned = torch.eye(4).double().view(4, 4, 1, 1).expand(4, 4, B, N)
    direction = torch.tensor([0.6, 0.8]).double().expand(B, N, 2)
    own = initial_in_own_frame(given, learned, direction)
    turn = torch.block_diag(*[torch.tensor([[0.6, -0.8], [0.8, 0.6]]).double()] * 2)
    torch.testing.assert_close(own[:, :, 1, 2], turn.t() @ given[1, 2] @ turn)
    torch.testing.assert_close(own[:, :, 0, 1], torch.eye(4).double())
