# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Each agent's own frame at t, and rotations between it and the scene frame."""

from typing import NamedTuple

import torch
from torch import Tensor


class Start(NamedTuple):
    """Frame and state of all agents at t, from which the roll-out starts.

    Attributes:
        origin: [B, N, 2] origin of the agent's frame in the scene frame (m).
        direction: [B, N, 2] cosine and sine of the frame's heading in the scene frame.
        position: [B, N, 2] at t, in the agent's frame (m).
        velocity: [B, N, 2] at t, in the agent's frame (m/s).
    """

    origin: Tensor
    direction: Tensor
    position: Tensor
    velocity: Tensor


def to_own(vector: Tensor, direction: Tensor) -> Tensor:
    """Return [..., 2] scene vectors in frames with (cos, sin) ``direction`` [..., 2]."""
    x, y = vector.unbind(-1)
    cos, sin = direction.unbind(-1)
    return torch.stack((cos * x + sin * y, cos * y - sin * x), dim=-1)


def to_scene(vector: Tensor, direction: Tensor) -> Tensor:
    """Return [..., 2] vectors in the scene frame; the inverse of :func:`to_own`."""
    x, y = vector.unbind(-1)
    cos, sin = direction.unbind(-1)
    return torch.stack((cos * x - sin * y, sin * x + cos * y), dim=-1)


def states_to_scene(states: Tensor, start: Start) -> Tensor:
    """Return [H, B, N, M, S] states in the scene frame, from the agents' frames."""
    shape = [states.size(0), -1, -1, states.size(3), -1]
    direction = start.direction.unsqueeze(2).unsqueeze(0).expand(shape)
    # Split, not indexed: the gradient of an index fills the whole array with zeros.
    parts = states.split(2, dim=-1)
    position = to_scene(parts[0], direction) + start.origin.unsqueeze(2)
    if len(parts) == 1:
        return position
    return torch.cat((position, to_scene(parts[1], direction)), dim=-1)


def states_to_own(states: Tensor, start: Start) -> Tensor:
    """Return [B, N, H, S] states in the agents' frames, from the scene frame."""
    direction = start.direction.unsqueeze(2).expand(-1, -1, states.size(2), -1)
    position = to_own(states[..., :2] - start.origin.unsqueeze(2), direction)
    if states.size(-1) == 2:
        return position
    return torch.cat((position, to_own(states[..., 2:4], direction)), dim=-1)


def heading(velocity: Tensor, yaw: Tensor) -> Tensor:
    """Return [..., 2] unit direction of motion, or the yaw's where the agent hardly moves.

    The limits on the speed are chosen: a velocity estimated below them has no usable direction.

    Args:
        velocity: [..., 2] (m/s); alone from 1 m/s on, without effect below 0.5 m/s.
        yaw: [..., 2] cosine and sine of the box heading, zero where unknown.
    """
    speed = torch.linalg.vector_norm(velocity, dim=-1, keepdim=True)
    moving = (2.0 * speed - 1.0).clamp(0.0, 1.0)
    blend = moving * velocity / speed.clamp(min=0.5) + (1.0 - moving) * yaw
    length = torch.linalg.vector_norm(blend, dim=-1, keepdim=True)
    # Two opposite directions may cancel, and both may be missing.
    ahead = torch.zeros_like(blend)
    ahead[..., 0] = 1.0
    return torch.where(length > 0.1, blend / length.clamp(min=0.1), ahead)


def start_in_own_frames(position: Tensor, velocity: Tensor, yaw: Tensor) -> Start:
    """Return the start in the agents' own frames.

    Args:
        position: [B, N, 2] at t, in the scene frame (m).
        velocity: [B, N, 2] at t, in the scene frame (m/s).
        yaw: [B, N, 2] cosine and sine of the box heading, see :func:`heading`.
    """
    direction = heading(velocity, yaw)
    return Start(position, direction, torch.zeros_like(position), to_own(velocity, direction))


def hold_first_mode(states: Tensor, start: Start, dt_s: float) -> Tensor:
    """Return [H, B, N, M, S] states whose first mode is uniform motion for standing agents.

    Args:
        states: [H, B, N, M, S] in the agents' frames.
        start: see :class:`Start`.
        dt_s: step of the horizon (s).
    """
    time = dt_s * torch.arange(1, states.size(0) + 1, device=states.device, dtype=states.dtype)
    velocity = start.velocity.expand(states.size(0), -1, -1, -1)
    uniform = start.position + velocity * time.view(-1, 1, 1, 1)
    if states.size(-1) == 4:
        uniform = torch.cat((uniform, velocity), dim=-1)
    uniform = uniform.unsqueeze(3)
    first, others = states[..., :1, :], states[..., 1:, :]
    first = uniform + motion_share(start.velocity)[..., None, None] * (first - uniform)
    return torch.cat((first, others), dim=3)


def motion_share(velocity: Tensor) -> Tensor:
    """Return [B, N] 0 for agents that stand, 1 for those that move, of velocities [B, N, 2] (m/s).

    0 up to 0.3 m/s, because a tracker's standing road users have speeds of some 0.1 to 0.2 m/s
    (chosen); 1 from 0.5 m/s on, ``MOVING_MPS`` of :mod:`mtpgo_core.schema`.
    """
    speed = torch.linalg.vector_norm(velocity, dim=-1)
    return ((speed - 0.3) / 0.2).clamp(0.0, 1.0)


def last_seen(features: Tensor, valid: Tensor) -> tuple[Tensor, Tensor]:
    """Return the last valid sample of each agent.

    Args:
        features: [B, N, T, F].
        valid: [B, N, T].

    Returns:
        The sample [B, N, F] (the first one where none is valid) and its index [B, N].
    """
    steps = torch.arange(valid.size(2), device=valid.device)
    index = (steps * valid).amax(dim=-1)
    gather = index[:, :, None, None].expand(-1, -1, 1, features.size(-1))
    return features.gather(2, gather).squeeze(2), index
