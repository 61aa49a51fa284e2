# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Motion models: exact solutions, Runge-Kutta on the whole state, Jacobians against autograd."""

import math

import pytest
import torch
from reference import Reference

from models import ModelConfig
from models.own_frame.agent_frames import Start
from models.neural_ode import DirectStates, NeuralODE

H, B, N, M = 4, 2, 3, 5


def make_ode(order, integrator="rk4", layers=1, static=False, wild=True):
    config = ModelConfig(
        order=order,
        integrator=integrator,
        ode_layers=layers,
        ode_hidden=6,
        static_features=static,
        static_size=3,
    )
    ode = NeuralODE(config).double()
    if wild:
        with torch.no_grad():
            for parameter in ode.parameters():
                parameter.normal_(0.0, 1.0)
    return config, ode


def make_start():
    direction = torch.tensor([1.0, 0.0]).double().expand(B, N, 2)
    position = torch.randn(B, N, 2).double()
    return Start(position, direction, position, 8.0 * torch.randn(B, N, 2).double())


@pytest.mark.parametrize("static", [False, True])
@pytest.mark.parametrize("layers", [1, 2, 3])
@pytest.mark.parametrize("integrator", ["euler", "heun", "rk4"])
@pytest.mark.parametrize("order", [1, 2])
def test_step_and_jacobian(order, integrator, layers, static):
    config, ode = make_ode(order, integrator, layers, static)
    start, classes = make_start(), torch.randn(B, N, 3).double()
    states = 10.0 * torch.randn(H, B, N, M, 2 * order).double()
    controls = torch.randn(H, B, N, M, 2).double()
    field = ode.prepare(classes, start)
    slopes = [ode.move(states[h], controls[h], h, start, field, True)[1] for h in range(H)]
    of_q, of_position = ode.jacobian(slopes, [B, N, M])
    oracle = Reference(config, {f"motion.{k}": v for k, v in ode.state_dict().items()})
    for index in ((0, 0, 0, 0), (3, 1, 2, 4), (1, 1, 0, 3)):
        h, b, n, m = index
        moved = ode(states[h], controls[h], h, start, field)[b, n, m]
        u = controls[index] + (start.velocity[b, n] if order == 1 else 0.0)
        torch.testing.assert_close(moved, oracle.step(states[index], u, classes[b, n]))
        full = torch.func.jacrev(oracle.step)(states[index], u, classes[b, n])
        torch.testing.assert_close(of_q[:, :, h, b, n, m], full[-2:, -2:])
        if order == 2:
            torch.testing.assert_close(of_position[:, :, h, b, n, m], full[:2, 2:])
            torch.testing.assert_close(full[:2, :2], torch.eye(2).double())
            torch.testing.assert_close(full[2:, :2], torch.zeros(2, 2).double())


@pytest.mark.parametrize("with_slopes", [False, True])
@pytest.mark.parametrize("static", [False, True])
@pytest.mark.parametrize("integrator", ["euler", "heun", "rk4"])
@pytest.mark.parametrize("order", [1, 2])
def test_the_step_by_hand_has_the_values_and_gradients_of_autograd(
    monkeypatch, order, integrator, static, with_slopes
):
    _, ode = make_ode(order, integrator, static=static)
    start, classes = make_start(), torch.randn(B, N, 3).double()
    state = 10.0 * torch.randn(B, N, M, 2 * order).double().requires_grad_()
    controls = torch.randn(H, B, N, M, 2).double().requires_grad_()
    draw = torch.Generator().manual_seed(1)
    results = []
    for by_hand in (True, False):
        monkeypatch.setattr(NeuralODE, "_steps_by_hand", lambda *_, answer=by_hand: answer)
        field = ode.prepare(classes, start)
        now, slopes = state, []
        for h in range(H):
            now, slope = ode.move(now, controls[h], h, start, field, with_slopes)
            slopes.append(slope)
        parts = [now]
        if with_slopes:
            parts += ode.jacobian(slopes, [B, N, M])[: 1 if order == 1 else 2]
        draw.manual_seed(1)
        value = sum((torch.randn(p.shape, generator=draw).double() * p).sum() for p in parts)
        of = [state, controls, *ode.parameters()]
        grads = torch.autograd.grad(value, of, allow_unused=True)
        results.append([*parts, *(g for g in grads if g is not None)])
    for mine, expected in zip(*results, strict=True):
        torch.testing.assert_close(mine, expected)


def test_the_step_by_hand_serves_training_and_no_other_networks():
    start, classes = make_start(), torch.randn(B, N, 3).double()
    state, control = torch.randn(B, N, M, 4).double(), torch.randn(B, N, M, 2).double()
    for layers in (1, 2):
        _, ode = make_ode(2, layers=layers)
        ode.requires_grad_(True)
        moved, _ = ode.move(state, control, 0, start, ode.prepare(classes, start), False)
        assert (moved.grad_fn.name() == "OdeStepBackward") == (layers == 1)


def test_constant_command_is_constant_acceleration():
    """The exact solution, which every integrator of order two and up must meet."""
    _, ode = make_ode(order=2, wild=False)
    start = make_start()
    field = ode.prepare(torch.zeros(B, N, 3).double(), start)
    command = torch.tensor([0.7, -0.3]).double().expand(B, N, 1, 2)
    state = torch.cat((start.position, start.velocity), dim=-1).unsqueeze(2)
    for k in range(10):
        state = ode(state, command, k, start, field)
    time = 2.0
    velocity = start.velocity + command[:, :, 0] * time
    position = start.position + start.velocity * time + 0.5 * command[:, :, 0] * time**2
    torch.testing.assert_close(state[:, :, 0], torch.cat((position, velocity), dim=-1))


def test_first_order_moves_at_the_velocity_of_t():
    _, ode = make_ode(order=1, wild=False)
    start = make_start()
    field = ode.prepare(torch.zeros(B, N, 3).double(), start)
    state = ode(start.position.unsqueeze(2), torch.zeros(B, N, 1, 2).double(), 0, start, field)
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
        start = make_start()
        field = ode.prepare(torch.zeros(B, N, 8).double(), start)
        state = torch.tensor([0.0, 0.0, 3.0, 2.0]).double().expand(B, N, 1, 4)
        for k in range(round(1.0 / dt)):
            state = ode(state, torch.zeros(B, N, 1, 2).double(), k, start, field)
        exact = torch.tensor([3.0, 2.0]).double()
        velocity_error = (state[0, 0, 0, 2:] - exact * math.exp(-1.0)).norm()
        position_error = (state[0, 0, 0, :2] - exact * (1.0 - math.exp(-1.0))).norm()
        errors.append((float(velocity_error), float(position_error)))
    for coarse, fine in zip(*errors, strict=True):
        assert math.log2(coarse / fine) == pytest.approx(order_of_error, abs=0.35)


@pytest.mark.parametrize("order", [1, 2])
def test_direct_states_are_differences_from_uniform_motion(order):
    direct = DirectStates(ModelConfig(order=order, ekf=False, ode=False))
    start = make_start()
    control = torch.randn(B, N, M, 2 * order).double()
    field = direct.prepare(torch.zeros(B, N, 8).double(), start)
    state = direct(control, control, 4, start, field)
    uniform = start.position + start.velocity * 1.0
    if order == 2:
        uniform = torch.cat((uniform, start.velocity), dim=-1)
    torch.testing.assert_close(state - uniform.unsqueeze(2), control)
