# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Headings of the agents in the scene frame, whatever the columns and frames of the inputs."""

import torch
from torch import Tensor

from models.own_frame.agent_frames import heading, last_seen


def yaw_vectors(features: Tensor, as_angle: bool) -> Tensor:
    """Return [..., 2] cosine and sine of the box headings in features [..., F].

    Args:
        features: they have the yaw after x, y, vx, vy, ax, ay.
        as_angle: it is one column (rad), as in the paper; else two, cosine and sine.
    """
    if as_angle:
        yaw = features[..., 6]
        return torch.stack((yaw.cos(), yaw.sin()), dim=-1)
    return features[..., 6:8]


def headings_at_t(features: Tensor, valid: Tensor, as_angle: bool) -> Tensor:
    """Return [B, N, 2] cosine and sine of the agents' headings at t.

    With own frames these are the directions of the frames; without them the frames are not turned,
    and the agents still have headings.

    Args:
        features: [B, N, T, F], zero where not valid.
        valid: [B, N, T].
        as_angle: see :func:`yaw_vectors`.
    """
    last, _ = last_seen(features, valid)
    return heading(last[..., 2:4], yaw_vectors(last, as_angle))
