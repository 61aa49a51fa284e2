# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The unicycle against its published closed form, a fine integration and automatic derivatives."""

import pytest
import torch
from torch.func import jacrev

from models.baselines.latent.unicycle import quotients, unicycle_step

DT_S = 0.2


def step(state, control):
    return unicycle_step(state, control, DT_S, False)[0]


def published(state, control):
    """The closed form that divides by the turn rate."""
    x, y, angle, v = state.unbind(-1)
    w, a = control.unbind(-1)
    after = angle + w * DT_S
    dx = (v / w) * (after.sin() - angle.sin()) + a * DT_S / w * after.sin()
    dy = -(v / w) * (after.cos() - angle.cos()) - a * DT_S / w * after.cos()
    dx = dx + a / w**2 * (after.cos() - angle.cos())
    dy = dy + a / w**2 * (after.sin() - angle.sin())
    return torch.stack((x + dx, y + dy, after, v + a * DT_S), dim=-1)


def some(count=50):
    torch.manual_seed(1)
    state = torch.randn(count, 4).double() * torch.tensor([20.0, 20.0, 2.0, 10.0])
    return state, torch.randn(count, 2).double() * torch.tensor([0.8, 3.0])


def test_it_is_the_published_closed_form():
    state, control = some()
    torch.testing.assert_close(
        step(state, control), published(state, control), rtol=1e-7, atol=1e-7
    )


def test_without_turning_it_is_straight_motion():
    state = torch.tensor([1.0, 2.0, 0.0, 10.0]).double()
    control = torch.tensor([0.0, 2.0]).double()
    assert step(state, control).tolist() == pytest.approx([1.0 + 2.0 + 0.04, 2.0, 0.0, 10.4])


def test_a_quarter_of_a_circle():
    """At 10 m/s with half a radian each second the radius is 20 m."""
    state = torch.tensor([0.0, 0.0, 0.0, 10.0]).double()
    control = torch.tensor([0.5, 0.0]).double()
    end = unicycle_step(state, control, torch.pi, False)[0]
    assert end.tolist() == pytest.approx([20.0, 20.0, torch.pi / 2, 10.0])


def test_the_jacobians_are_those_of_automatic_differentiation():
    state, control = some()
    control[0, 0], control[1, 0] = 0.0, 1e-5
    _, of_state, of_control = unicycle_step(state, control, DT_S, True)
    for i in range(len(state)):
        by_state, by_control = jacrev(step, argnums=(0, 1))(state[i], control[i])
        torch.testing.assert_close(of_state[i], by_state)
        torch.testing.assert_close(of_control[i], by_control)


def test_series_and_quotients_meet():
    half = torch.tensor([0.0499999, 0.0500001, -0.0499999, -0.0500001]).double()
    for value in quotients(half):
        torch.testing.assert_close(value[::2], value[1::2], rtol=1e-5, atol=1e-8)
    sinc, g, slope = quotients(torch.zeros(1))
    assert (float(sinc), float(g), float(slope)) == pytest.approx((1.0, 0.0, 1.0 / 3.0))
