# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Properties of all baselines that hold for any weights."""

import warnings

import pytest
import torch
from baseline_samples import ALL, close, make_baseline
from model_samples import check_mixed_precision, constant_velocity, make_scene, save_and_load

from models.gaussian_mixture import mixture_nll


@ALL
@torch.no_grad()
def test_untrained_is_constant_velocity(name):
    model = make_baseline(name, torch.float32, wild=False, modes=8, horizon_steps=25)
    scene = make_scene(4, 7, steps=6, dtype=torch.float32)
    log_weight, mean, covariance = model(*scene.inputs())
    here = scene.present
    assert (log_weight.argmax(-1)[here] == 0).all()
    off = (mean - constant_velocity(scene, 25).unsqueeze(2)).norm(dim=-1)[here]  # [agents, M, H]
    assert off[:, 0].max() < 0.15
    assert off.max() < 1.0
    ends = mean[..., -1, :][here]  # the modes differ, or no loss could separate them
    assert (torch.cdist(ends, ends) + 1e3 * torch.eye(8)).min() > 0.03
    deviation = covariance[here].diagonal(dim1=-2, dim2=-1).sqrt()
    assert (deviation[:, :, 1:] > deviation[:, :, :-1]).all()  # increasingly uncertain


@ALL
@torch.no_grad()
def test_shapes_weights_and_omitted_covariances(name):
    model = make_baseline(name, torch.float32, static_features=True)
    scene = make_scene(2, 4, steps=6, dtype=torch.float32)
    log_weight, mean, covariance = model(*scene.inputs())
    assert log_weight.shape == (2, 4, 3)
    assert mean.shape == (2, 4, 3, 5, 2)
    assert covariance.shape == (2, 4, 3, 5, 2, 2)
    torch.testing.assert_close(log_weight.exp().sum(-1), torch.ones(2, 4))
    assert torch.linalg.cholesky_ex(covariance).info.eq(0).all()
    without = model.roll_out(*scene.inputs(), None, False, None, None)
    assert without[2].numel() == 0
    close(without[:2], (log_weight, mean))


@ALL
@torch.no_grad()
def test_permuting_agents_permutes_the_output(name):
    model, scene, order = make_baseline(name), make_scene(2, 7, steps=6), torch.randperm(7)
    moved = model(*(x[:, order] for x in scene.inputs()))
    close(moved, (x[:, order] for x in model(*scene.inputs())))


@ALL
@torch.no_grad()
def test_padding_and_invalid_samples_change_nothing(name):
    model, scene = make_baseline(name), make_scene(2, 7, steps=6)
    expected = model(*scene.inputs())
    pad = (torch.full((2, 3, 6, 8), 1e6), torch.zeros(2, 3, 6).bool(), torch.ones(2, 3, 8))
    padded = model(*(torch.cat((x, p), dim=1) for x, p in zip(scene.inputs(), pad, strict=True)))
    close((x[:, :7] for x in padded), expected)
    assert all(torch.isfinite(x).all() for x in padded)
    for value in (1e9, float("nan"), float("inf")):
        filled = torch.where(scene.valid.unsqueeze(-1), scene.features, value)
        close(model(filled, scene.valid, scene.static), expected)


@ALL
@torch.no_grad()
def test_an_agent_that_was_never_present_is_not_a_neighbour(name):
    """The others are predicted as if agent 1 did not exist."""
    model, scene = make_baseline(name), make_scene(1, 4, steps=6, odd=False)
    scene.valid[:, 1] = False
    others = [0, 2, 3]
    alone = model(*(x[:, others] for x in scene.inputs()))
    close((x[:, others] for x in model(*scene.inputs())), alone)


@ALL
@torch.no_grad()
def test_scenes_of_a_batch_are_independent(name):
    model, scene = make_baseline(name), make_scene(3, 5, steps=6)
    alone = model(*(x[1:2] for x in scene.inputs()))
    close(alone, (x[1:2] for x in model(*scene.inputs())))


@pytest.mark.parametrize(
    ("name", "depends"),
    [("seq2seq", False), ("s-lstm", True), ("cs-lstm", True), ("gnn-rnn", True)],
)
@torch.no_grad()
def test_which_networks_depend_on_a_neighbour(name, depends):
    model, scene = make_baseline(name), make_scene(1, 2, steps=6, odd=False)
    scene.features[0, 1, :, :2] = scene.features[0, 0, :, :2] + 5.0
    before = model(*scene.inputs())
    scene.features[0, 1, :, 2:4] += 3.0  # its past speed
    after = model(*scene.inputs())
    assert torch.allclose(before[1][0, 0], after[1][0, 0]) is not depends


@ALL
@torch.no_grad()
def test_a_late_agent_is_as_if_the_window_began_with_it(name):
    model, scene = make_baseline(name), make_scene(2, 3, steps=6, odd=False)
    scene.valid[:, :, :4] = False
    short = model(scene.features[:, :, 4:], scene.valid[:, :, 4:], scene.static)
    close(model(*scene.inputs()), short)


@ALL
@torch.no_grad()
def test_an_agent_in_a_gap_keeps_its_memory(name):
    model, scene = make_baseline(name), make_scene(1, 1, steps=6, odd=False)
    scene.valid[:, :, 3] = False
    course = model.condition.start(scene.features, scene.valid).direction
    inputs = torch.randn(1, 1, 6, model.condition.input_size).double()
    gone = [0, 1, 2, 4, 5]
    position = scene.features[..., :2]
    with_gap = model.encode(inputs, position, scene.valid, course)
    without = model.encode(
        inputs[:, :, gone], position[:, :, gone], scene.valid[:, :, gone], course
    )
    close(with_gap, without)


@ALL
@torch.no_grad()
def test_one_agent_with_one_sample_or_none(name):
    model, scene = make_baseline(name), make_scene(1, 1, steps=6)
    scene.valid[:, :, :-1] = False
    assert all(torch.isfinite(x).all() for x in model(*scene.inputs()))
    scene.valid[:] = False
    assert all(torch.isfinite(x).all() for x in model(*scene.inputs()))


@ALL
@torch.no_grad()
def test_the_teacher_is_seen_only_where_valid_and_only_later(name):
    model, scene = make_baseline(name), make_scene(1, 3, steps=6, odd=False)
    teacher = scene.features[:, :, -1:, :2] + torch.randn(1, 3, 5, 2).double()
    silent = torch.zeros(1, 3, 5, dtype=torch.bool)
    free = model(*scene.inputs())
    forced_by = lambda t, v: model.roll_out(*scene.inputs(), None, True, t, v)  # noqa: E731
    close(forced_by(torch.full_like(teacher, float("nan")), silent), free)
    forced = forced_by(teacher, ~silent)
    assert not torch.allclose(forced[1], free[1])
    later = teacher.clone()
    later[:, :, 2:] += 5.0  # the truth from the third step on
    changed = forced_by(later, ~silent)
    close((changed[1][..., :3, :],), (forced[1][..., :3, :],))
    assert not torch.allclose(changed[1][..., 3:, :], forced[1][..., 3:, :])


@ALL
@torch.no_grad()
def test_predictions_turn_with_the_scene_if_only_the_own_frame_is_seen(name):
    """Grids turn with their agents; distances do not change."""
    model, scene = make_baseline(name), make_scene(2, 5, steps=6)
    model.condition.input_std[:8] = 1e12
    turn = torch.tensor([[0.28, -0.96], [0.96, 0.28]]).double()
    shift = torch.tensor([30.0, -20.0]).double()
    features = scene.features @ torch.block_diag(*[turn] * 4).t()
    features[..., :2] += shift
    w0, m0, p0 = model(*scene.inputs())
    w1, m1, p1 = model(features, scene.valid, scene.static)
    here = scene.present
    expected = (w0[here], (m0 @ turn.t() + shift)[here], (turn @ p0 @ turn.t())[here])
    close((w1[here], m1[here], p1[here]), expected, 1e-6)


@ALL
@torch.no_grad()
def test_observation_noise_is_added_and_the_scale_multiplies(name):
    plain = make_baseline(name)
    noisy = make_baseline(name, observation_std_m=0.3, covariance_scale=1.7)
    noisy.load_state_dict(plain.state_dict())
    inputs = make_scene(1, 3, steps=6).inputs()
    close(noisy(*inputs)[:2], plain(*inputs)[:2])
    expected = 1.7 * (plain(*inputs)[2] + 0.09 * torch.eye(2).double())
    close((noisy(*inputs)[2],), (expected,), 1e-7)


@ALL
@torch.no_grad()
def test_covariances_stay_definite_for_extreme_input(name):
    model = make_baseline(name, torch.float32, wild=False, horizon_steps=25)
    for parameter in model.noise.parameters():
        parameter.normal_(0.0, 30.0)
    scene = make_scene(6, 7, steps=6, dtype=torch.float32)
    for scale in (1e-3, 1.0, 1e3):
        _, mean, covariance = model(scene.features * scale, scene.valid, scene.static)
        assert torch.isfinite(mean).all()
        torch.testing.assert_close(covariance, covariance.mT, rtol=0, atol=0)
        assert not torch.linalg.cholesky_ex(covariance).info.any()


@ALL
@torch.no_grad()
def test_the_saved_file_computes_what_the_eager_network_computes(name, tmp_path):
    model = make_baseline(name, torch.float32, static_features=True)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        loaded = save_and_load(torch.jit.freeze(torch.jit.script(model)), tmp_path / "model.pt")
    for batch, agents in ((1, 1), (1, 9), (3, 4)):
        scene = make_scene(batch, agents, steps=6, dtype=torch.float32)
        close(loaded(*scene.inputs()), model(*scene.inputs()), 1e-4)
        unknown = torch.full((batch, agents, 2, 2), float("nan"))
        close(loaded(*scene.inputs(), unknown), model(*scene.inputs()), 1e-4)


@ALL
@pytest.mark.parametrize("wild", [True, False])
def test_a_gradient_reaches_every_parameter(name, wild):
    model = make_baseline(name, wild=wild)
    scene = make_scene(2, 6, steps=6)
    scene.features[..., :2] *= 0.5  # close enough for the grids
    target = constant_velocity(scene, 5) + 0.3
    mask = scene.present.unsqueeze(-1).expand(-1, -1, 5)
    mixture_nll(*model(*scene.inputs()), target, mask).sum().backward()
    for label, parameter in model.named_parameters():
        assert parameter.grad is not None, label
        assert torch.isfinite(parameter.grad).all(), label
        assert parameter.grad.any(), label


@ALL
def test_mixed_precision_is_near_and_has_gradients(name):
    check_mixed_precision(make_baseline(name, torch.float32, wild=False))
