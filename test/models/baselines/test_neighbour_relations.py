# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""How every agent sees the others."""

import torch

from models.baselines.neighbour_relations import neighbour_relations


def test_a_neighbour_is_seen_from_the_agents_own_frame():
    # The first drives north from (0, 0), the second east from (0, 30): ahead, and to the right.
    features = torch.tensor([[[0.0, 0.0, 0.0, 10.0], [0.0, 30.0, 10.0, 0.0]]])
    direction = torch.tensor([[[0.0, 1.0], [1.0, 0.0]]])
    seen = neighbour_relations(features, direction, direction)
    torch.testing.assert_close(seen[0, 0, 1], torch.tensor([1.0, 0.0, -1.0, -1.0, 0.0, -1.0]))
    torch.testing.assert_close(seen[0, 1, 0], torch.tensor([0.0, -1.0, -1.0, 1.0, 0.0, 1.0]))
    torch.testing.assert_close(seen[0, 0, 0], torch.tensor([0.0, 0.0, 0.0, 0.0, 1.0, 0.0]))
