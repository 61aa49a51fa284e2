# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The switches to the paper's equations, each against its equation written out."""

import math

import pytest
import torch
from model_samples import frozen, inputs_for, make_model, make_scene
from motion_samples import B, M, N, make_start

from models import MTPGO, ModelConfig
from models.ablations.direct_covariance import DirectCovariance
from models.inference import FastMTPGO, deployable
from models.neural_ode import NeuralODE

PAPER = {
    "tied": False,
    "agent_frame": False,
    "conditioned": False,
    "motion_input": "network",
    "noise_input": "velocity",
    "initial_covariance": "configured",
    "initial_std_m": 0.00316,
    "initial_std_mps": 0.00316,
    "covariance_inflation": 0.0,
    "noise_floor": 0.0,
    "correlation_limit": 1.0,
}


def layer_by_layer(ode, q, u):
    """f_1(q, u_1) and f_2(q, u_2) as two networks."""
    rates = []
    for i in (0, 1):
        given = torch.cat((q / ode.q_scale, u[..., i : i + 1] / ode.u_scale), dim=-1)
        hidden = torch.nn.functional.elu(given @ ode.first[i].t() + ode.first_bias[i])
        rates.append(hidden @ ode.last[i] + ode.last_bias[i])
    return torch.stack(rates, dim=-1)


@pytest.mark.parametrize("choice", ["added", "network"])
@pytest.mark.parametrize("order", [1, 2])
def test_the_rate_is_f_alone_or_with_the_input_added(order, choice):
    config = ModelConfig(order=order, motion_input=choice, integrator="euler", ode_hidden=6)
    ode = NeuralODE(config).double()
    with torch.no_grad():
        for parameter in ode.parameters():
            parameter.normal_()
    start, control = make_start(), torch.randn(B, N, M, 2).double()
    state = torch.randn(B, N, M, 2 * order).double()
    u = ode.command(control, start.velocity)
    expected_u = control
    if choice == "added" and order == 1:
        expected_u = control + start.velocity.unsqueeze(2)
    torch.testing.assert_close(u, expected_u)
    following, _ = ode(state, u, ode.prepare(torch.zeros(B, N, 0).double()), False)
    q = state[..., -2:]
    rate = layer_by_layer(ode, q, u) + (u if choice == "added" else 0.0)
    torch.testing.assert_close(following[..., -2:], q + 0.2 * rate)


def test_the_network_as_rate_has_gradients_of_its_input_from_the_start():
    """With a last layer of zeros the decoder could not move anything."""
    ode = NeuralODE(ModelConfig(motion_input="network", order=1))
    u = torch.zeros(B, N, M, 2, requires_grad=True)
    state, _ = ode(torch.zeros(B, N, M, 2), u, ode.prepare(torch.zeros(B, N, 0)), False)
    state.sum().backward()
    assert u.grad.abs().min() > 0.0


@torch.no_grad()
def test_first_order_covariance_of_one_step():
    """P_1 = F P_0 F^T + Ts^2 Q with nothing added, F the numerical Jacobian (eq. 21b and 22)."""
    model = make_model(order=1, integrator="euler", **PAPER)
    scene = make_scene(1, 1, steps=6, odd=False)
    covariance = model(*inputs_for(model, scene))[2]
    features = scene.features
    edges = model.decoder.prepare(features[:, :, -1, :2], scene.valid[:, :, -1])
    x = features[:, :, -1, None, :2].expand(-1, -1, 3, -1)
    seen = (x - model.condition.state_mean) / model.condition.state_std
    inputs = (features - model.condition.input_mean) / model.condition.input_std
    encoded = model.encoder(inputs, features[..., :2], scene.valid)
    h = encoded[:, :, -1] + model.decoder.initial
    h = model.decoder(h, seen.flatten(2), encoded, torch.zeros(1, 1, 6).double(), edges)
    u = model.control(h)
    noise = model.noise(h.unsqueeze(0))[:, :, 0, 0, 0]  # [2, 2, M]
    for m in range(3):
        jacobian = torch.autograd.functional.jacobian(
            lambda q, m=m: q + 0.2 * layer_by_layer(model.motion, q, u[0, 0, m]), x[0, 0, m]
        )
        p0 = 0.00316**2 * torch.eye(2).double()
        expected = jacobian @ p0 @ jacobian.t() + 0.2**2 * noise[:, :, m]
        torch.testing.assert_close(covariance[0, 0, m, 0], expected, rtol=1e-6, atol=1e-12)


@torch.no_grad()
def test_noise_bounds():
    model = make_model(noise_floor=0.0, correlation_limit=1.0)
    h = torch.randn(1, 1, 1, 8).double()
    body = torch.nn.functional.elu(model.noise.body(h))
    s1 = torch.nn.functional.softplus(model.noise.sigma_1(body))
    s2 = torch.nn.functional.softplus(model.noise.sigma_2(body))
    rho = torch.nn.functional.softsign(model.noise.rho(body))
    q = model.noise(h)
    torch.testing.assert_close(q[0, 0], s1**2)
    torch.testing.assert_close(q[0, 1], rho * s1 * s2)


@torch.no_grad()
def test_without_conditioning_features_enter_as_they_are():
    model = MTPGO(ModelConfig(conditioned=False, agent_frame=False))
    scene = make_scene(2, 3, dtype=torch.float32)
    model.fit_statistics(scene.features, scene.valid)
    start = model.condition.start(scene.features, scene.valid)
    given = model.condition(scene.features, scene.valid, start)
    torch.testing.assert_close(given, scene.features)
    states = torch.randn(2, 3, 8, 4)
    torch.testing.assert_close(model.condition.scale_states(states, start, 3), states.flatten(2))
    assert model.motion.q_scale == model.motion.u_scale == 1.0
    assert not model.decoder.initial.requires_grad
    # Usual weights: of the size 1 / sqrt(hidden), a hundred times the conditioned ones.
    for layer in (model.control.out, model.noise.sigma_1, model.mixture.out):
        assert float(layer.weight.abs().max()) > 0.5 / math.sqrt(64)
    conditioned = MTPGO(ModelConfig())
    assert float(conditioned.control.out.weight.abs().max()) < 0.05 / math.sqrt(64)


def test_without_conditioning_the_ablations_give_their_output_itself():
    q = torch.rand(2, 2, 5, 1, 2, 3)
    (given, *_) = DirectCovariance(ModelConfig(conditioned=False, ekf=False))(q)
    torch.testing.assert_close(given, q)
    model = make_model(ode=False, ekf=False, conditioned=False)
    control = torch.randn(1, 2, 3, 4).double()
    start = make_start()
    assert model.direct_states(control, start, 4) is control


@pytest.mark.parametrize("order", [1, 2])
@torch.no_grad()
def test_the_papers_model_is_exported_as_it_is(order):
    model = make_model(torch.float32, wild=False, order=order, **PAPER)
    scene = make_scene(2, 4, steps=6, dtype=torch.float32)
    assert deployable(model) is model
    for got, want in zip(
        frozen(model)(*inputs_for(model, scene)), model(*inputs_for(model, scene)), strict=True
    ):
        torch.testing.assert_close(got, want)


@pytest.mark.parametrize(
    "switch",
    [
        {"motion_input": "network"},
        {"covariance_inflation": 0.0},
        {"noise_floor": 0.0, "correlation_limit": 1.0},
        {"conditioned": False},
        {name: value for name, value in PAPER.items() if name != "agent_frame"},
    ],
    ids=lambda switch: ", ".join(list(switch)[:3]),
)
@torch.no_grad()
def test_the_fast_form_has_each_switch(switch):
    model = make_model(**switch)
    scene = make_scene(2, 5, steps=6)
    fast = deployable(model)
    assert isinstance(fast, FastMTPGO)
    inputs, here = inputs_for(model, scene), scene.present
    for got, want in zip(fast(*inputs), model(*inputs), strict=True):
        torch.testing.assert_close(got[here], want[here], rtol=1e-8, atol=1e-9)


def test_one_yaw_column_needs_scene_frames():
    MTPGO(ModelConfig(feature_size=7, agent_frame=False))
    with pytest.raises(Exception, match="feature_size is 7, expected at least 8 with agent_frame"):
        ModelConfig(feature_size=7)
