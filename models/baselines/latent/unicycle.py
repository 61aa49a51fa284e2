# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Dynamics that Trajectron++ integrates: unicycle and single integrator, with their Jacobians.

Both are exact for controls that are constant within a step (T. Salzmann et al., "Trajectron++",
ECCV 2020, Sec. 4 and its appendix on the dynamically extended unicycle). The published form of the
unicycle divides by the turn rate; here the same integrals are written about the middle of the
step, where the quotients are smooth functions of half the angle turned.
"""

import torch
from torch import Tensor

SERIES_RAD = 0.05
"""Half angle below which the quotients are computed by their series (rad).

Chosen: the first term left out is then below float32's rounding."""


def quotients(half: Tensor, series_rad: float = SERIES_RAD) -> tuple[Tensor, Tensor, Tensor]:
    """Return sin(a) / a, g(a) = (sin(a) - a cos(a)) / a^2 and dg/da of half angles (rad)."""
    small = half.abs() < series_rad
    safe = torch.where(small, torch.ones_like(half), half)
    square = half * half
    sinc = torch.sin(safe) / safe
    g = (torch.sin(safe) - safe * torch.cos(safe)) / (safe * safe)
    slope = sinc - 2.0 * g / safe
    return (
        torch.where(small, 1.0 - square / 6.0 + square * square / 120.0, sinc),
        torch.where(small, half * (1.0 / 3.0 - square / 30.0 + square * square / 840.0), g),
        torch.where(small, 1.0 / 3.0 - square / 10.0 + square * square / 168.0, slope),
    )


def unicycle_step(
    state: Tensor, control: Tensor, dt_s: float, jacobians: bool
) -> tuple[Tensor, Tensor, Tensor]:
    """Move unicycles by one step.

    Args:
        state: [..., 4] x, y (m), heading (rad), speed (m/s).
        control: [..., 2] turn rate (rad/s), acceleration (m/s^2).
        dt_s: length of the step (s).
        jacobians: also return them; else they are empty.

    Returns:
        The next state [..., 4], and its derivatives with respect to the state [..., 4, 4] and the
        controls [..., 4, 2].
    """
    x, y, angle, speed = state.unbind(-1)
    turn, acceleration = control.unbind(-1)
    h = 0.5 * dt_s
    sinc, g, slope = quotients(h * turn)
    middle = angle + h * turn
    cos, sin = middle.cos(), middle.sin()
    # Of x: integral of (v + a s) cos(angle + turn s) over s in [0, dt], and y with the sine.
    along = dt_s * sinc * (speed + h * acceleration)
    across = 2.0 * h * h * g * acceleration
    dx = along * cos - across * sin
    dy = along * sin + across * cos
    moved = (x + dx, y + dy, angle + dt_s * turn, speed + dt_s * acceleration)
    after = torch.stack(moved, dim=-1)
    if not jacobians:
        none = torch.empty(0, dtype=state.dtype, device=state.device)
        return after, none, none
    zero, one = torch.zeros_like(x), torch.ones_like(x)
    reach = dt_s * sinc
    of_state = torch.stack(
        (
            torch.stack((one, zero, -dy, reach * cos), dim=-1),
            torch.stack((zero, one, dx, reach * sin), dim=-1),
            torch.stack((zero, zero, one, zero), dim=-1),
            torch.stack((zero, zero, zero, one), dim=-1),
        ),
        dim=-2,
    )
    # The derivative of sin(a) / a is -g(a); the half angle grows by h with the turn rate.
    along_turn = -dt_s * g * h * (speed + h * acceleration)
    across_turn = 2.0 * h * h * h * slope * acceleration
    along_push, across_push = h * reach, 2.0 * h * h * g
    of_control = torch.stack(
        (
            torch.stack(
                (
                    along_turn * cos - across_turn * sin - h * dy,
                    along_push * cos - across_push * sin,
                ),
                dim=-1,
            ),
            torch.stack(
                (
                    along_turn * sin + across_turn * cos + h * dx,
                    along_push * sin + across_push * cos,
                ),
                dim=-1,
            ),
            torch.stack((dt_s * one, zero), dim=-1),
            torch.stack((zero, dt_s * one), dim=-1),
        ),
        dim=-2,
    )
    return after, of_state, of_control
