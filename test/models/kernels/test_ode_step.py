# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""One step of the neural ODE: the kernel against the plain function, and when it applies."""

import pytest
import torch
from motion_samples import B, H, M, N, make_ode, make_start

import models.kernels.ode_step as module
from models.kernels.ode_step import OdeStep


@pytest.mark.parametrize("with_slopes", [False, True])
@pytest.mark.parametrize("static", [False, True])
@pytest.mark.parametrize("integrator", ["euler", "heun", "rk4"])
@pytest.mark.parametrize("order", [1, 2])
def test_the_kernel_has_the_values_and_gradients_of_autograd(
    monkeypatch, order, integrator, static, with_slopes
):
    _, ode = make_ode(order, integrator, static=static)
    start, classes = make_start(), torch.randn(B, N, 3).double()
    state = 10.0 * torch.randn(B, N, M, 2 * order).double().requires_grad_()
    controls = torch.randn(H, B, N, M, 2).double().requires_grad_()
    draw = torch.Generator().manual_seed(1)
    results = []
    for kernel in (True, False):
        monkeypatch.setattr(module, "kernel_covers", lambda *_, answer=kernel: answer)
        network = ode.prepare(classes)
        now, slopes = state, []
        for h in range(H):
            u = ode.command(controls[h], start.velocity)
            now, slope = ode(now, u, network, with_slopes)
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


@pytest.mark.parametrize("motion_input", ["added", "network"])
@pytest.mark.parametrize("order", [1, 2])
def test_gradient_is_the_numerical_one(order, motion_input):
    _, ode = make_ode(order, motion_input=motion_input)
    network = ode.prepare(torch.zeros(1, 2, 3).double())
    given = [torch.randn(1, 2, 2, 2 * order).double(), torch.randn(1, 2, 2, 2).double()]
    given += [
        network.state_weight,
        network.input_weight,
        network.first_bias,
        network.output_weight,
        network.output_bias,
        network.unit_slope,
    ]
    given = [x.detach().clone().requires_grad_() for x in given]
    assert torch.autograd.gradcheck(lambda *x: OdeStep.apply(*x, ode.method, True), given)


def test_the_kernel_serves_training_and_no_other_networks():
    start, classes = make_start(), torch.randn(B, N, 3).double()
    state, control = torch.randn(B, N, M, 4).double(), torch.randn(B, N, M, 2).double()
    for layers in (1, 2):
        _, ode = make_ode(2, layers=layers)
        ode.requires_grad_(True)
        u = ode.command(control, start.velocity)
        moved, _ = ode(state, u, ode.prepare(classes), False)
        assert (moved.grad_fn.name() == "OdeStepBackward") == (layers == 1)
