# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Relative states of all pairs of agents: offset, velocity and heading in one's own frame."""

import torch
from torch import Tensor

from models.own_frame.agent_frames import to_own

RELATIONS = 6
"""Channels of a relation."""

OFFSET_M = 30.0
"""Scale of the neighbours' offsets (m; chosen: as for positions)."""

RELATIVE_MPS = 10.0
"""Scale of the neighbours' relative velocities (m/s; chosen: as for velocities)."""


def neighbour_relations(
    features: Tensor,
    heading: Tensor,
    direction: Tensor,
    offset_m: float = OFFSET_M,
    relative_mps: float = RELATIVE_MPS,
) -> Tensor:
    """Return [B, N, N, RELATIONS] the state of agent j (last) relative to agent i, in i's frame.

    Args:
        features: [B, N, F] at one step; they begin with x, y (m), vx, vy (m/s).
        heading: [B, N, 2] cosine and sine of the agents' headings in the scene frame.
        direction: [B, N, 2] cosine and sine of the agents' frames.
        offset_m: scale of the offsets (m).
        relative_mps: scale of the relative velocities (m/s).
    """
    place, velocity = features[..., :2], features[..., 2:4]
    axes = direction.unsqueeze(2)
    offset = to_own(place.unsqueeze(1) - place.unsqueeze(2), axes) / offset_m
    relative = to_own(velocity.unsqueeze(1) - velocity.unsqueeze(2), axes) / relative_mps
    return torch.cat((offset, relative, to_own(heading.unsqueeze(1), axes)), dim=-1)
