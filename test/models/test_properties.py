# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Properties that hold for any weights: masks, permutations, causality, definiteness."""

import pytest
import torch
from model_samples import (
    BEYOND_PAPER,
    check_mixed_precision,
    constant_velocity,
    inputs_for,
    make_model,
    make_scene,
)

from models.gaussian_mixture import mixture_nll, position_nll

ORDERS = pytest.mark.parametrize("order", [1, 2])
LAYERS = pytest.mark.parametrize("layer", ["graphconv", "gcn", "gat", "gat+"])


def close(results, others, tolerance=1e-9):
    for one, other in zip(results, others, strict=True):
        torch.testing.assert_close(one, other, rtol=tolerance, atol=tolerance)


def pick(results, index):
    return tuple(result[:, index] for result in results)


@LAYERS
@torch.no_grad()
def test_permuting_agents_permutes_the_output(layer):
    model = make_model(layer=layer)
    scene = make_scene(2, 7, steps=6)
    order = torch.randperm(7)
    moved = model(*(x[:, order] for x in scene.inputs()))
    close(moved, pick(model(*scene.inputs()), order))


@LAYERS
@torch.no_grad()
def test_padding_changes_no_result(layer):
    model = make_model(layer=layer)
    scene = make_scene(2, 5, steps=6)
    pad = (torch.full((2, 3, 6, 8), 1e6), torch.zeros(2, 3, 6).bool(), torch.ones(2, 3, 8))
    padded = model(*(torch.cat((x, p), dim=1) for x, p in zip(scene.inputs(), pad, strict=True)))
    close(pick(padded, slice(0, 5)), model(*scene.inputs()))
    assert all(torch.isfinite(x).all() for x in padded)


@torch.no_grad()
def test_scenes_of_a_batch_are_independent():
    model = make_model()
    scene = make_scene(3, 5, steps=6)
    whole = model(*scene.inputs())
    alone = model(*(x[1:2] for x in scene.inputs()))
    close(alone, tuple(x[1:2] for x in whole))


@torch.no_grad()
def test_invalid_samples_do_not_matter():
    model = make_model()
    scene = make_scene(2, 7, steps=6)
    hole = ~scene.valid.unsqueeze(-1)
    for value in (1e9, float("nan"), float("inf")):
        filled = torch.where(hole, value, scene.features)
        close(model(filled, scene.valid, scene.static), model(*scene.inputs()))


@torch.no_grad()
def test_a_late_agent_is_as_if_the_window_began_with_it():
    """Its first state is the learned one whenever it appears; attention ignores earlier steps."""
    model = make_model()
    scene = make_scene(1, 1, steps=6, odd=False)
    valid = scene.valid.clone()
    valid[:, :, :3] = False
    states = model.encoder(torch.randn(1, 1, 6, 18).double(), scene.features[..., :2], valid)
    close((states[0, 0, 2],), (model.encoder.initial,))
    changed = states.clone()
    changed[0, 0, :3] = 77.0
    bias = torch.where(valid, 0.0, float("-inf")).double()
    h, x = torch.randn(1, 1, 8).double(), torch.randn(1, 1, 8).double()
    attention = model.decoder.attention
    close((attention(h, x, changed, bias),), (attention(h, x, states, bias),))


@torch.no_grad()
def test_an_absent_agent_keeps_its_state_and_is_no_neighbour():
    model = make_model()
    scene = make_scene(1, 3, steps=6, odd=False)
    scene.valid[0, 1, 4:] = False  # agent 1 leaves
    inputs = torch.randn(1, 3, 6, 18).double()
    states = model.encoder(inputs, scene.features[..., :2], scene.valid)
    close((states[0, 1, 4], states[0, 1, 5]), (states[0, 1, 3], states[0, 1, 3]))
    inputs[0, 1, 4:] = 50.0
    close((model.encoder(inputs, scene.features[..., :2], scene.valid),), (states,))


@ORDERS
@torch.no_grad()
def test_one_agent_with_one_sample(order):
    model = make_model(order=order)
    scene = make_scene(1, 1, steps=6)
    scene.valid[:, :, :-1] = False
    assert all(torch.isfinite(x).all() for x in model(*scene.inputs()))


@ORDERS
@torch.no_grad()
def test_the_teacher_is_seen_only_where_valid_and_only_later(order):
    model = make_model(order=order)
    scene = make_scene(1, 3, steps=6, odd=False)
    teacher = torch.randn(1, 3, 5, 2 * order).double()
    silent = torch.zeros(1, 3, 5, dtype=torch.bool)
    free = model(*scene.inputs())
    forced_by = lambda t, v: model.roll_out(*scene.inputs(), None, True, t, v)  # noqa: E731
    close(forced_by(teacher, silent), free)
    close(forced_by(torch.full_like(teacher, float("nan")), silent), free)
    known = ~silent
    forced = forced_by(teacher, known)
    assert not torch.allclose(forced[1], free[1])
    later = teacher.clone()
    later[:, :, 2:] += 5.0  # the truth from the third step on
    changed = forced_by(later, known)
    close(
        (changed[1][..., :3, :], changed[2][..., :3, :, :]),
        (forced[1][..., :3, :], forced[2][..., :3, :, :]),
    )
    assert not torch.allclose(changed[1][..., 3:, :], forced[1][..., 3:, :])


@torch.no_grad()
def test_the_decoder_keeps_the_last_graph():
    """Where the agents go in the future changes no edge: presence and distance are those of t."""
    model = make_model()
    scene = make_scene(1, 3, steps=6, odd=False)
    edges = model.decoder.prepare(scene.features[:, :, -1, :2], scene.present)
    before = [tuple(part.clone() for part in layer) for stack in edges for layer in stack]
    model(*scene.inputs())
    after = model.decoder.prepare(scene.features[:, :, -1, :2], scene.present)
    for one, other in zip(before, (layer for stack in after for layer in stack), strict=True):
        close(one, other)


@ORDERS
@pytest.mark.parametrize("ode", [True, False])
@torch.no_grad()
def test_untrained_is_constant_velocity(order, ode):
    model = make_model(
        torch.float32, wild=False, order=order, ode=ode, ekf=ode, modes=8, horizon_steps=25
    )
    scene = make_scene(4, 7, steps=6, dtype=torch.float32)
    log_weight, mean, covariance = model(*scene.inputs())
    uniform = constant_velocity(scene, 25)
    here = scene.present
    assert (log_weight.argmax(-1)[here] == 0).all()
    off = (mean[..., :2] - uniform.unsqueeze(2)).norm(dim=-1)[here]  # [agents, M, H]
    assert off[:, 0].max() < 0.15
    assert off.max() < 1.7
    ends = mean[..., -1, :2][here]  # the modes differ from the first, and from each other
    apart = torch.cdist(ends, ends) + 1e3 * torch.eye(8)
    assert apart.min() > 0.03
    deviation = covariance[here].diagonal(dim1=-2, dim2=-1).sqrt()
    assert (deviation[:, :, 1:, 0] > deviation[:, :, :-1, 0]).all()  # increasingly uncertain


@ORDERS
@torch.no_grad()
def test_predictions_rotate_with_the_scene_if_only_the_own_frame_is_seen(order):
    """Without scene-frame inputs, predictions rotate and shift with the scene."""
    model = make_model(order=order, agent_frame=True)
    model.condition.input_std[:8] = 1e12
    scene = make_scene(2, 5, steps=6)
    c, s = 0.28, 0.96
    turn = torch.tensor([[c, -s], [s, c]]).double()
    full = torch.block_diag(*[turn] * 4)
    shift = torch.tensor([30.0, -20.0]).double()
    features = scene.features @ full.t()
    features[..., :2] += shift
    w0, m0, p0 = model(*scene.inputs())
    w1, m1, p1 = model(features, scene.valid, scene.static)
    block = full[: 2 * order, : 2 * order]
    want = m0 @ block.t()
    want[..., :2] += shift
    here = scene.present
    close(
        (w1[here], m1[here], p1[here]),
        (w0[here], want[here], (block @ p0 @ block.t())[here]),
        1e-6,
    )


@pytest.mark.parametrize(
    "choices",
    [
        {},
        {"order": 1},
        {"static_features": True, "ode_layers": 2, "gnn_layers": 2, "heads": 2},
        {"layer": "graphconv"},
        {"ekf": False},
        {"ekf": False, "ode": False},
        {"encoder_gnn": False, "decoder_gnn": False},
        BEYOND_PAPER,
    ],
    ids=str,
)
def test_a_gradient_reaches_every_parameter(choices):
    model = make_model(**choices)
    scene = make_scene(2, 4, steps=6)
    log_weight, mean, covariance = model(*inputs_for(model, scene))
    target = constant_velocity(scene, 5) + 0.3
    target = torch.cat((target, torch.ones_like(target)), dim=-1)
    loss = mixture_nll if model.config.ekf else position_nll
    mask = scene.present.unsqueeze(-1).expand(-1, -1, 5)
    loss(log_weight, mean, covariance, target, mask).sum().backward()
    unused = {"encoder.cell.gnn_f.kernels", "encoder.cell.gnn_h.kernels"}
    unused |= {"decoder.cell.gnn_f.kernels", "decoder.cell.gnn_h.kernels"}
    for name, parameter in model.named_parameters():
        if not model.config.encoder_gnn and name.rsplit(".", 2)[0] in unused:
            continue  # a graph without edges has no edge weights
        if parameter.numel() == 0:
            continue
        assert parameter.grad is not None, name
        assert torch.isfinite(parameter.grad).all(), name
        assert parameter.grad.any(), name


def test_gradients_reach_the_layers_before_the_small_initial_heads():
    model = make_model(torch.float32, wild=False)
    scene = make_scene(2, 4, steps=6, dtype=torch.float32)
    _, mean, _ = model(*scene.inputs())
    (mean[..., :2] - 1.0 - constant_velocity(scene, 5).unsqueeze(2)).square().mean().backward()
    assert model.encoder.cell.gnn_f.layers[0].packed.weight.grad.abs().max() > 0


@ORDERS
@torch.no_grad()
def test_covariances_stay_definite_for_extreme_input(order):
    model = make_model(torch.float32, wild=False, order=order, horizon_steps=25)
    for parameter in (*model.noise.parameters(), *model.initial_covariance.parameters()):
        parameter.normal_(0.0, 30.0)
    model.motion.last.normal_()
    scene = make_scene(6, 7, steps=6, dtype=torch.float32)
    for scale in (1e-3, 1.0, 30.0, 1e3):
        _, _, p = model(scene.features * scale, scene.valid, scene.static)
        assert torch.isfinite(p).all()
        torch.testing.assert_close(p, p.transpose(-1, -2), rtol=0, atol=0)
        _, failed = torch.linalg.cholesky_ex(p)
        assert not failed.any()


def test_double_run_gives_the_same_numbers():
    model = make_model(torch.float32)
    scene = make_scene(2, 4, steps=6, dtype=torch.float32)
    close(model(*scene.inputs()), model(*scene.inputs()), 0.0)


@LAYERS
def test_mixed_precision_is_near_and_has_gradients(layer):
    check_mixed_precision(make_model(torch.float32, wild=False, layer=layer))


def test_mixed_precision_with_the_inputs_that_the_paper_does_not_have():
    check_mixed_precision(make_model(torch.float32, wild=False, **BEYOND_PAPER))


@torch.no_grad()
def test_the_order_of_agents_and_padding_do_not_matter_with_trails():
    model = make_model(**BEYOND_PAPER)
    scene = make_scene(2, 5, steps=6)
    *inputs, _, trails = inputs_for(model, scene)
    expected = model(*inputs, None, trails)
    order = torch.randperm(5)
    moved = model(*(x[:, order] for x in inputs), None, trails[:, order])
    close(moved, pick(expected, order))
    wide = [torch.cat((x, x.new_zeros(2, 2, *x.shape[2:])), dim=1) for x in (*inputs, trails)]
    close(pick(model(*wide[:3], None, wide[3]), slice(0, 5)), expected)
