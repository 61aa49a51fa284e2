# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The whole model, eager and as exported, against the reference implementation."""

import pytest
import torch
from model_samples import frozen, make_model, make_scene, save_and_load

from mtpgo_training.benchmark.reference_mtp_go import ReferenceMTPGO

VARIANTS = {
    "default": {},
    "first order": {"order": 1},
    "graphconv, two layers": {"layer": "graphconv", "gnn_layers": 2},
    "gcn": {"layer": "gcn"},
    "gat, three heads, first order": {"layer": "gat", "heads": 3, "order": 1},
    "gat+, two heads, two layers": {"heads": 2, "gnn_layers": 2},
    "untied": {"tied": False, "heads": 2},
    "static, deep ODE": {"static_features": True, "ode_layers": 3},
    "static, deep ODE, first": {"static_features": True, "ode_layers": 2, "order": 1},
    "heun, paper's G": {"integrator": "heun", "noise_input": "velocity"},
    "euler, configured P_0": {"integrator": "euler", "initial_covariance": "configured"},
    "scene frame": {"agent_frame": False},
    "scene frame, first order": {"agent_frame": False, "order": 1},
    "context": {"feature_size": 11},
    "no encoder GNN": {"encoder_gnn": False},
    "no decoder GNN": {"decoder_gnn": False},
    "no EKF": {"ekf": False},
    "no EKF, first order": {"ekf": False, "order": 1},
    "no ODE": {"ekf": False, "ode": False},
    "no ODE, first order": {"ekf": False, "ode": False, "order": 1},
    "calibrated": {"observation_std_m": 0.2, "observation_std_mps": 0.3, "covariance_scale": 1.3},
}
SCRIPTED = ("default", "first order", "gat+, two heads, two layers", "static, deep ODE", "no ODE")


@pytest.mark.parametrize("name", VARIANTS)
@torch.no_grad()
def test_agrees_with_the_reference(name):
    model = make_model(**VARIANTS[name])
    scene = make_scene(2, 7, steps=6, size=model.config.feature_size)
    results = [model(*scene.inputs())]
    if name in SCRIPTED:
        results.append(frozen(model)(*scene.inputs()))
    expected = ReferenceMTPGO(model.config, model.state_dict())(*scene.inputs())
    here = scene.present
    for result in results:
        for got, want in zip(result, expected, strict=True):
            torch.testing.assert_close(got[here], want[here], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("order", [1, 2])
@torch.no_grad()
def test_given_initial_covariance_and_teacher(order):
    model = make_model(order=order)
    scene = make_scene(1, 4, steps=6, odd=False)
    s = 2 * order
    root = torch.randn(1, 4, s, s).double()
    initial = root @ root.transpose(-1, -2) + torch.eye(s)
    teacher = 10.0 * torch.randn(1, 4, 5, s).double()
    reference = ReferenceMTPGO(model.config, model.state_dict())
    known = torch.ones(1, 4, 5, dtype=torch.bool)
    result = model.roll_out(*scene.inputs(), initial, True, teacher, known)
    expected = reference(*scene.inputs(), initial, teacher)
    for got, want in zip(result, expected, strict=True):
        torch.testing.assert_close(got, want, rtol=1e-9, atol=1e-9)


@torch.no_grad()
def test_an_unknown_initial_covariance_is_the_models_own():
    model = make_model()
    scene = make_scene(1, 3, steps=6, odd=False)
    given = torch.eye(4).double().expand(1, 3, 4, 4).clone()
    given[0, 1, 2, 2] = float("nan")
    own, mixed = model(*scene.inputs()), model(*scene.inputs(), given)
    torch.testing.assert_close(mixed[2][0, 1], own[2][0, 1])
    assert not torch.allclose(mixed[2][0, 0], own[2][0, 0])
    assert not torch.allclose(mixed[2][0, 2], own[2][0, 2])


@pytest.mark.parametrize("order", [1, 2])
@torch.no_grad()
def test_exported_file_equals_eager_in_float32_at_any_size(order, tmp_path):
    model = make_model(torch.float32, order=order)
    loaded = save_and_load(frozen(model), tmp_path / "model.pt")
    for batch, agents in ((1, 1), (1, 9), (3, 4)):
        scene = make_scene(batch, agents, steps=6, dtype=torch.float32)
        for got, want in zip(loaded(*scene.inputs()), model(*scene.inputs()), strict=True):
            assert got.dtype == torch.float32
            torch.testing.assert_close(got, want, rtol=1e-4, atol=1e-4)


@torch.no_grad()
def test_shapes_and_weights():
    model = make_model(torch.float32)
    scene = make_scene(2, 3, steps=6, dtype=torch.float32)
    log_weight, mean, covariance = model(*scene.inputs())
    assert log_weight.shape == (2, 3, 3)
    assert mean.shape == (2, 3, 3, 5, 4)
    assert covariance.shape == (2, 3, 3, 5, 4, 4)
    torch.testing.assert_close(log_weight.exp().sum(-1), torch.ones(2, 3))


@torch.no_grad()
def test_covariance_is_left_out_on_demand():
    model = make_model(torch.float32)
    scene = make_scene(2, 3, steps=6, dtype=torch.float32)
    with_it = model(*scene.inputs())
    without = model.roll_out(*scene.inputs(), None, False, None, None)
    assert without[2].numel() == 0
    torch.testing.assert_close(without[:2], with_it[:2])


@torch.no_grad()
def test_covariance_scale_multiplies_the_covariance_only():
    plain = make_model(observation_std_m=0.1)
    scaled = make_model(observation_std_m=0.1, covariance_scale=1.7)
    scaled.load_state_dict(plain.state_dict())
    inputs = make_scene(1, 3, steps=6).inputs()
    torch.testing.assert_close(scaled(*inputs)[:2], plain(*inputs)[:2])
    torch.testing.assert_close(scaled(*inputs)[2], 1.7 * plain(*inputs)[2])


@torch.no_grad()
@pytest.mark.parametrize("order", [1, 2])
def test_observation_noise_is_added_to_every_covariance(order):
    plain = make_model(order=order)
    noisy = make_model(order=order, observation_std_m=0.3, observation_std_mps=0.5)
    noisy.load_state_dict(plain.state_dict())
    inputs = make_scene(1, 3, steps=6).inputs()
    expected = torch.tensor([0.09, 0.09, 0.25, 0.25][: 2 * order], dtype=torch.float64).diag()
    added = noisy(*inputs)[2] - plain(*inputs)[2]
    torch.testing.assert_close(added, expected.expand_as(added), atol=1e-7, rtol=0.0)
