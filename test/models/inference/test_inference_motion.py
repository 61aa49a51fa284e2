# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The motion on deviations from uniform motion against the neural ODE on whole states."""

import pytest
import torch
from motion_samples import B, H, M, N, make_ode

from models.inference.inference_motion import FastMotion

DT_S = 0.2


@pytest.mark.parametrize("static", [False, True])
@pytest.mark.parametrize("integrator", ["euler", "heun", "rk4"])
@torch.no_grad()
def test_states_and_jacobians_are_those_of_the_neural_ode(integrator, static):
    _, ode = make_ode(2, integrator, static=static)
    fast = FastMotion(ode, M).double()
    classes = torch.nn.functional.one_hot(torch.arange(N) % 3, 3).double().expand(B, -1, -1)
    position, velocity = torch.randn(B, N, 2).double(), 8.0 * torch.randn(B, N, 2).double()
    network, constants = ode.prepare(classes), fast.prepare(classes, velocity)
    state = torch.cat((position, velocity), -1).unsqueeze(2).expand(-1, -1, M, -1)
    deviation = torch.zeros(B * N * M, 4).double()
    slopes, units = [], []
    for step in range(H):
        control = torch.randn(B, N, M, 2).double()
        state, slope = ode(state, ode.command(control, velocity), network, True)
        deviation, unit = fast(deviation, control.view(-1, 2), constants)
        slopes.append(slope)
        units.append(unit)
        moved = position + (step + 1) * DT_S * velocity
        uniform = torch.cat((moved, velocity), -1).unsqueeze(2)
        got = deviation.view(B, N, M, 4) + uniform
        torch.testing.assert_close(got, state, rtol=1e-10, atol=1e-10)
    got = fast.jacobian(torch.cat(units))
    for found, wanted in zip(got, ode.jacobian(slopes, [B, N, M]), strict=True):
        torch.testing.assert_close(found.view(wanted.shape), wanted, rtol=1e-10, atol=1e-10)


@torch.no_grad()
def test_a_constant_acceleration_by_hand():
    """Without networks: d' = d + dt w + dt^2/2 u, w' = w + dt u, and F of constant velocity."""
    _, ode = make_ode(2, wild=False)
    fast = FastMotion(ode, 1).double()
    constants = fast.prepare(torch.zeros(1, 1, 3).double(), torch.randn(1, 1, 2).double())
    state = torch.tensor([[1.0, -1.0, 2.0, 3.0]]).double()
    control = torch.tensor([[0.5, -1.0]]).double()
    got, units = fast(state, control, constants)
    expected = [[1.0 + 0.4 + 0.01, -1.0 + 0.6 - 0.02, 2.0 + 0.1, 3.0 - 0.2]]
    torch.testing.assert_close(got, torch.tensor(expected).double())
    of_q, of_position = fast.jacobian(units)
    torch.testing.assert_close(of_q.view(2, 2), torch.eye(2).double())
    torch.testing.assert_close(of_position.view(2, 2), DT_S * torch.eye(2).double())
