# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The neural ODE: exact solutions, Runge-Kutta on the whole state, Jacobians against autograd."""

import math

import pytest
import torch
from motion_samples import B, H, M, N, make_ode, make_start

from models import ModelConfig
from models.neural_ode import NeuralODE
from mtpgo_training.benchmark.reference_mtp_go import ReferenceMotion


@pytest.mark.parametrize("static", [False, True])
@pytest.mark.parametrize("layers", [1, 2, 3])
@pytest.mark.parametrize("integrator", ["euler", "heun", "rk4"])
@pytest.mark.parametrize("order", [1, 2])
def test_step_and_jacobian(order, integrator, layers, static):
    config, ode = make_ode(order, integrator, layers, static)
    start, classes = make_start(), torch.randn(B, N, 3).double()
    states = 10.0 * torch.randn(H, B, N, M, 2 * order).double()
    controls = torch.randn(H, B, N, M, 2).double()
    network = ode.prepare(classes)
    inputs = [ode.command(control, start.velocity) for control in controls]
    slopes = [ode(states[h], inputs[h], network, True)[1] for h in range(H)]
    of_q, of_position = ode.jacobian(slopes, [B, N, M])
    oracle = ReferenceMotion(config, {f"motion.{k}": v for k, v in ode.state_dict().items()})
    for index in ((0, 0, 0, 0), (3, 1, 2, 4), (1, 1, 0, 3)):
        h, b, n, m = index
        moved = ode(states[h], inputs[h], network, False)[0][b, n, m]
        u = controls[index] + (start.velocity[b, n] if order == 1 else 0.0)
        torch.testing.assert_close(moved, oracle.step(states[index], u, classes[b, n]))
        full = torch.func.jacrev(oracle.step)(states[index], u, classes[b, n])
        torch.testing.assert_close(of_q[:, :, h, b, n, m], full[-2:, -2:])
        if order == 2:
            torch.testing.assert_close(of_position[:, :, h, b, n, m], full[:2, 2:])
            torch.testing.assert_close(full[:2, :2], torch.eye(2).double())
            torch.testing.assert_close(full[2:, :2], torch.zeros(2, 2).double())


def test_constant_command_is_constant_acceleration():
    """The exact solution, which every integrator of order two and up must meet."""
    _, ode = make_ode(order=2, wild=False)
    start = make_start()
    network = ode.prepare(torch.zeros(B, N, 3).double())
    command = torch.tensor([0.7, -0.3]).double().expand(B, N, 1, 2)
    state = torch.cat((start.position, start.velocity), dim=-1).unsqueeze(2)
    for _ in range(10):
        state, _ = ode(state, ode.command(command, start.velocity), network, False)
    time = 2.0
    velocity = start.velocity + command[:, :, 0] * time
    position = start.position + start.velocity * time + 0.5 * command[:, :, 0] * time**2
    torch.testing.assert_close(state[:, :, 0], torch.cat((position, velocity), dim=-1))


def test_first_order_moves_at_the_velocity_of_t():
    _, ode = make_ode(order=1, wild=False)
    start = make_start()
    network = ode.prepare(torch.zeros(B, N, 3).double())
    u = ode.command(torch.zeros(B, N, 1, 2).double(), start.velocity)
    state, _ = ode(start.position.unsqueeze(2), u, network, False)
    torch.testing.assert_close(state[:, :, 0], start.position + 0.2 * start.velocity)


@pytest.mark.parametrize(("integrator", "order_of_error"), [("euler", 1), ("heun", 2), ("rk4", 4)])
@torch.no_grad()
def test_order_of_convergence(integrator, order_of_error):
    """dv/dt = -v, which one linear unit gives exactly: halve the step and compare."""
    errors = []
    for dt in (0.2, 0.1):
        config = ModelConfig(integrator=integrator, ode_hidden=2, dt_s=dt)
        ode = NeuralODE(config).double()
        with torch.no_grad():
            ode.first.zero_()
            ode.first_bias.zero_()
            for axis in range(2):  # positive v only reaches the linear side of ELU
                ode.first[axis, 0, axis] = 10.0
                ode.last[axis, 0] = -1.0
        network = ode.prepare(torch.zeros(B, N, 8).double())
        state = torch.tensor([0.0, 0.0, 3.0, 2.0]).double().expand(B, N, 1, 4)
        for _ in range(round(1.0 / dt)):
            state, _ = ode(state, torch.zeros(B, N, 1, 2).double(), network, False)
        exact = torch.tensor([3.0, 2.0]).double()
        velocity_error = (state[0, 0, 0, 2:] - exact * math.exp(-1.0)).norm()
        position_error = (state[0, 0, 0, :2] - exact * (1.0 - math.exp(-1.0))).norm()
        errors.append((float(velocity_error), float(position_error)))
    for coarse, fine in zip(*errors, strict=True):
        assert math.log2(coarse / fine) == pytest.approx(order_of_error, abs=0.35)
