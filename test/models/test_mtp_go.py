# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The whole model, eager and as exported, against the reference implementation."""

import pytest
import torch
from model_samples import (
    BEYOND_PAPER,
    constant_velocity,
    frozen,
    inputs_for,
    make_model,
    make_scene,
    make_trails,
    save_and_load,
)

from models.inference import deployable
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
    "static features in the encoder": {"static_features": True, "static_inputs": "all"},
    "trails": {"trail_branches": 3},
    "trails, twelve steps": {"trail_branches": 2, "horizon_steps": 12},
    "held": {"hold_standing": True},
    "held, scene frame": {"hold_standing": True, "agent_frame": False},
    "settles": {"settle_standing": True},
    "settles, first order": {"settle_standing": True, "hold_standing": True, "order": 1},
    "settles, scene frame": {"settle_standing": True, "agent_frame": False},
    "favours staying": {"stay_bias": 0.6},
    "favours staying, first order": {"stay_bias": 2.0, "order": 1},
    "favours staying, scene frame": {"stay_bias": 0.6, "agent_frame": False},
    "heaviest moved": {"heaviest_kernels": (0.0, 2.0)},
    "heaviest moved, first order": {"heaviest_kernels": (0.7, 1.5), "order": 1},
    "heaviest moved, no ODE": {"heaviest_kernels": (0.0, 2.0), "ekf": False, "ode": False},
    "beyond the paper": BEYOND_PAPER,
    "beyond the paper, first order": {**BEYOND_PAPER, "order": 1},
    "beyond the paper, no ODE": {**BEYOND_PAPER, "ekf": False, "ode": False},
}
SCRIPTED = (
    "default",
    "first order",
    "gat+, two heads, two layers",
    "static, deep ODE",
    "no ODE",
    "favours staying, scene frame",
    "heaviest moved",
    "heaviest moved, first order",
    "beyond the paper",
    "beyond the paper, first order",
    "beyond the paper, no ODE",
)


@pytest.mark.parametrize("name", VARIANTS)
@torch.no_grad()
def test_agrees_with_the_reference(name):
    model = make_model(**VARIANTS[name])
    scene = make_scene(2, 7, steps=6, size=model.config.feature_size)
    inputs = inputs_for(model, scene)
    results = [model(*inputs)]
    if name in SCRIPTED:
        results.append(frozen(model)(*inputs))
    reference = ReferenceMTPGO(model.config, model.state_dict())
    expected = reference(*scene.inputs(), trails=inputs[-1])
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


@pytest.mark.parametrize("choices", [{"order": 1}, {"order": 2}, BEYOND_PAPER], ids=str)
@torch.no_grad()
def test_exported_file_equals_eager_in_float32_at_any_size(choices, tmp_path):
    model = make_model(torch.float32, **choices)
    loaded = save_and_load(frozen(model), tmp_path / "model.pt")
    for batch, agents in ((1, 1), (1, 9), (3, 4)):
        scene = make_scene(batch, agents, steps=6, dtype=torch.float32)
        inputs = inputs_for(model, scene)
        for got, want in zip(loaded(*inputs), model(*inputs), strict=True):
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


def of_another_class(static):
    """The same static features, every road user of the class after its own."""
    return static.roll(1, dims=-1)


@torch.no_grad()
def test_a_class_changes_nothing_where_the_network_has_no_static_features():
    model, scene = make_model(), make_scene(1, 5, steps=6)
    before = model(*scene.inputs())
    after = model(scene.features, scene.valid, of_another_class(scene.static))
    torch.testing.assert_close(after, before, rtol=0.0, atol=0.0)


@pytest.mark.parametrize(("seen_by", "in_the_encoder"), [("motion", False), ("all", True)])
@torch.no_grad()
def test_a_class_changes_the_prediction_through_the_parts_that_see_it(seen_by, in_the_encoder):
    model = make_model(static_features=True, static_inputs=seen_by)
    scene = make_scene(1, 5, steps=6, odd=False)
    other = scene.features, scene.valid, of_another_class(scene.static)
    before, after = model(*scene.inputs()), model(*other)
    assert not torch.allclose(after[1], before[1])
    # The mode weights come from the encoder.
    assert torch.equal(after[0], before[0]) != in_the_encoder
    model.motion.first[:, :, 3:] = 0.0  # the classes' columns of the neural ODE
    before, after = model(*scene.inputs()), model(*other)
    for one, two in zip(before, after, strict=True):
        assert torch.equal(one, two) != in_the_encoder


@torch.no_grad()
def test_the_class_of_one_agent_reaches_its_neighbours_through_the_encoder():
    scene = make_scene(1, 3, steps=6, odd=False)
    static = scene.static.clone()
    static[0, 1] = static[0, 1].roll(1)
    for seen_by, reached in (("motion", False), ("all", True)):
        model = make_model(static_features=True, static_inputs=seen_by)
        before, after = model(*scene.inputs()), model(scene.features, scene.valid, static)
        assert not torch.allclose(after[1][0, 1], before[1][0, 1])
        # Its motion is seen by the neighbours' decoders in either case, so not their means.
        assert torch.equal(after[0][0, 0], before[0][0, 0]) != reached


@torch.no_grad()
def test_an_untrained_network_hardly_follows_trails():
    """Its first mode is within decimetres of constant velocity, whatever the trails are."""
    sizes = {"modes": 8, "hidden": 32, "horizon_steps": 25}
    plain = make_model(torch.float32, wild=False, **sizes)
    model = make_model(torch.float32, wild=False, trail_branches=3, **sizes)
    missing, unexpected = model.load_state_dict(plain.state_dict(), strict=False)
    assert not unexpected
    assert {name.split(".")[0] for name in missing} == {"trail"}
    scene = make_scene(2, 7, steps=6, dtype=torch.float32)
    trails = make_trails(2, 7, 3, 25, torch.float32)
    here = scene.present
    without = plain(*scene.inputs())
    for some in (torch.zeros_like(trails), trails):
        given = model(*scene.inputs(), None, some)
        difference = (given[1] - without[1]).abs()[here]
        assert 0.0 < difference.max() < 0.2
        torch.testing.assert_close(given[0][here], without[0][here], rtol=0.0, atol=0.01)
        off = (given[1][:, :, 0, :, :2] - constant_velocity(scene, 25)).norm(dim=-1)
        assert off[here].max() < 0.3


@torch.no_grad()
def test_trails_of_an_agent_change_its_prediction_and_weights():
    model = make_model(trail_branches=2)
    scene = make_scene(1, 4, steps=6, odd=False)
    trails = make_trails(1, 4, 2, 5)
    other = trails.clone()
    other[0, 2, 0, :, 1] += 3.0
    before, after = model(*scene.inputs(), None, trails), model(*scene.inputs(), None, other)
    for one, two in zip(before, after, strict=True):
        assert not torch.allclose(one[0, 2], two[0, 2])
    # The weights of the others come from the encoder, which sees no trails.
    torch.testing.assert_close(after[0][0, :2], before[0][0, :2], rtol=0.0, atol=0.0)


@pytest.mark.parametrize("form", [lambda model: model, deployable, frozen])
def test_a_network_that_takes_trails_says_so_when_it_gets_none(form):
    model = form(make_model(trail_branches=3))
    with pytest.raises(Exception, match=r"is given no trails, expected \[B, N, R, H, 3\]"):
        model(*make_scene(1, 2, steps=6).inputs())


@pytest.mark.parametrize("order", [1, 2])
@torch.no_grad()
def test_the_first_mode_of_a_standing_agent_is_uniform_motion_whatever_the_weights(order):
    """Agent 6 has 0.2 m/s; all others, and the other modes, are as they are without the option."""
    plain = make_model(order=order)
    model = make_model(order=order, hold_standing=True)
    model.load_state_dict(plain.state_dict())
    scene = make_scene(2, 7, steps=6, odd=False)
    given, free = model(*scene.inputs()), plain(*scene.inputs())
    uniform = constant_velocity(scene, 5)[:, 6]
    torch.testing.assert_close(given[1][:, 6, 0, :, :2], uniform, rtol=0.0, atol=1e-12)
    assert (free[1][:, 6, 0, :, :2] - uniform).abs().max() > 0.01
    if order == 2:
        velocity = scene.features[:, 6, -1:, 2:4].expand(-1, 5, -1)
        torch.testing.assert_close(given[1][:, 6, 0, :, 2:], velocity, rtol=0.0, atol=1e-12)
    for got, want in ((given[1][:, :6], free[1][:, :6]), (given[1][:, 6, 1:], free[1][:, 6, 1:])):
        torch.testing.assert_close(got, want, rtol=1e-10, atol=1e-10)
    torch.testing.assert_close((given[0], given[2]), (free[0], free[2]), rtol=0.0, atol=0.0)


@torch.no_grad()
def test_modes_in_which_a_standing_agent_hardly_moves_settle_and_no_others():
    """Agent 6 has 0.2 m/s."""
    plain = make_model()
    model = make_model(settle_standing=True)
    model.load_state_dict(plain.state_dict())
    scene = make_scene(2, 7, steps=6, odd=False)
    given, free = model(*scene.inputs()), plain(*scene.inputs())
    torch.testing.assert_close(given[1][:, :6], free[1][:, :6], rtol=0.0, atol=1e-12)
    torch.testing.assert_close((given[0], given[2]), (free[0], free[2]), rtol=0.0, atol=0.0)
    place, velocity = scene.features[:, 6, None, -1, :2], scene.features[:, 6, None, -1, 2:4]
    time = 0.2 * torch.arange(1, 6, dtype=place.dtype).view(1, -1, 1)
    uniform = torch.cat((place + velocity * time, velocity.expand(-1, 5, -1)), dim=-1).unsqueeze(1)
    away = free[1][:, 6] - uniform
    near = torch.exp(-2.0 * away[:, :, -1, :2].square().sum(-1))
    expected = uniform + (1.0 - near)[..., None, None] * away
    torch.testing.assert_close(given[1][:, 6], expected)
    assert (given[1][:, 6] - free[1][:, 6]).abs().max() > 0.01


@torch.no_grad()
def test_the_stay_bias_changes_the_weights_of_standing_agents_alone():
    """Agent 6 has 0.2 m/s, and its first mode is held, so that it ends 5 * 0.04 m away."""
    plain = make_model(hold_standing=True)
    model = make_model(hold_standing=True, stay_bias=0.6)
    model.load_state_dict(plain.state_dict())
    scene = make_scene(2, 7, steps=6, odd=False)
    given, free = model(*scene.inputs()), plain(*scene.inputs())
    torch.testing.assert_close(given[0][:, :6], free[0][:, :6], rtol=0.0, atol=1e-12)
    torch.testing.assert_close(given[1:], free[1:], rtol=0.0, atol=0.0)
    place = scene.features[:, 6, None, -1, :2]
    squared = (free[1][:, 6, :, -1, :2] - place).square().sum(-1)
    weight = free[0][:, 6].exp() * torch.exp(0.6 * torch.exp(-2.0 * squared))
    torch.testing.assert_close(given[0][:, 6].exp(), weight / weight.sum(-1, keepdim=True))
    assert (given[0][:, 6, 0] > free[0][:, 6, 0]).all()


def test_a_held_mode_trains_no_motion_and_the_modes_of_moving_agents_do():
    model = make_model(hold_standing=True)
    scene = make_scene(1, 7, steps=6, odd=False)
    for agents, trained in ((slice(6, 7), False), (slice(0, 6), True)):
        mean = model(*scene.inputs())[1]
        gradient = torch.autograd.grad(mean[:, agents, 0].square().sum(), model.control.out.weight)
        assert bool(gradient[0].any()) == trained
