# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Trajectron++: who moves by which dynamics, how, and whom each encoder sees."""

import torch
from model_samples import make_scene

from models.baselines import TrajectronConfig, TrajectronPlusPlus
from models.baselines.latent.trajectron_encoder import AdditiveAttention

SMALL = {"history_steps": 6, "horizon_steps": 5, "modes": 3, "hidden": 8, "edge_hidden": 4}


def small(**options):
    torch.manual_seed(0)
    return TrajectronPlusPlus(TrajectronConfig(**SMALL, wheeled_columns=(0, 1), **options)).eval()


def wild(**options):
    model = small(**options)
    with torch.no_grad():
        for parameter in model.parameters():
            parameter.add_(0.3 * torch.randn_like(parameter))
    return model


@torch.no_grad()
def test_only_agents_with_wheels_follow_their_heading():
    """A walker may move sideways at once; a vehicle cannot move sideways from rest."""
    model = wild(observation_std_m=0.0)
    features = torch.zeros(1, 2, 6, 8)
    features[..., 6] = 1.0  # at rest, looking along x
    valid, static = torch.ones(1, 2, 6, dtype=torch.bool), torch.zeros(1, 2, 8)
    static[0, 0, 0] = 1.0  # the other one is of no class
    _, mean, _ = model(features, valid, static)
    first = mean[0, :, :, 0]  # [2, M, 2]
    assert (first[0, :, 1].abs() < 0.1 * first[1, :, 1].abs()).all()


@torch.no_grad()
def test_untrained_is_nearly_constant_velocity():
    model, scene = small(), make_scene(2, 5, steps=6, dtype=torch.float32, odd=False)
    log_weight, mean, covariance = model(*scene.inputs())
    velocity = scene.features[:, :, -1, 2:4]
    time = 0.2 * torch.arange(1, 6).unsqueeze(-1)
    path = scene.features[:, :, -1, :2].unsqueeze(2) + velocity.unsqueeze(2) * time
    off = (mean[:, :, 0] - path).norm(dim=-1)
    assert off.max() < 0.05
    assert (log_weight.argmax(dim=-1) == 0).all()
    spread = covariance.diagonal(dim1=-2, dim2=-1).sum(dim=-1)
    assert (spread[..., 1:] > spread[..., :-1]).all()


def test_the_latent_enters_as_in_one_layer_with_the_context():
    """Its weights are no larger than those of a layer that takes both."""
    torch.manual_seed(0)
    model = TrajectronPlusPlus(TrajectronConfig(modes=5, hidden=32))
    reach = (model.encoder.size + 5) ** -0.5
    for weights in (model.of_latent, model.first_of_latent):
        assert 0.9 * reach < float(weights.detach().abs().max()) < reach


@torch.no_grad()
def test_without_covariances_the_means_are_the_same():
    model, scene = wild(), make_scene(2, 5, steps=6, dtype=torch.float32)
    whole = model(*scene.inputs())
    short = model.roll_out(*scene.inputs(), None, False, None, None)
    torch.testing.assert_close(short[:2], whole[:2])
    assert torch.linalg.cholesky_ex(whole[2]).info.eq(0).all()


@torch.no_grad()
def test_edges_are_sums_over_neighbours_by_kind():
    """Agent 0 has a vehicle 30 m ahead and 30 m behind, and a walker 30 m to the left."""
    model = small(bandwidth_m=30.0)
    features = torch.zeros(1, 5, 8)
    features[0, 1, 0], features[0, 2, 0], features[0, 3, 1] = 30.0, -30.0, 30.0
    features[0, 1, 2] = 10.0
    features[0, 4, 0] = 1.0  # absent
    present = torch.tensor([[True, True, True, True, False]])
    wheeled = torch.tensor([[True, True, True, False, True]])
    direction = torch.tensor([1.0, 0.0]).expand(1, 5, 2)
    vehicles, walkers = model.encoder.edges(features, present, wheeled, direction)
    e = 0.36787944  # exp(-1)
    expected = torch.tensor([2 * e, 0.0, 0.0, e, 0.0, 0.0, 0.0, 1.0])
    torch.testing.assert_close(vehicles[0, 0], expected)
    expected = torch.tensor([e, 0.0, e, 0.0, 0.0, 0.0, 0.0, 1.0])
    torch.testing.assert_close(walkers[0, 0], expected)


@torch.no_grad()
def test_additive_attention_by_hand():
    attention = AdditiveAttention(2, 2)
    query, keys = torch.randn(3, 2), torch.randn(3, 4, 2)
    for i in range(3):
        energy = [
            attention.energy(torch.tanh(attention.of_query(query[i]) + attention.of_key(key)))
            for key in keys[i]
        ]
        weight = torch.softmax(torch.cat(energy), dim=0)
        torch.testing.assert_close(attention(query, keys)[i], weight @ keys[i])


def test_the_posterior_sees_the_future_and_only_what_is_observed():
    model, scene = wild(), make_scene(1, 3, steps=6, dtype=torch.float32, odd=False)
    context, start = model.encode(*scene.inputs())
    target = torch.randn(1, 3, 5, 2)
    known = torch.tensor([True, True, True, False, False]).expand(1, 3, 5)
    value = model.log_posterior(context, start, target, known)
    hidden, seen = target.clone(), target.clone()
    hidden[:, :, 3:] = 1e3
    seen[:, :, 1] += 5.0
    torch.testing.assert_close(model.log_posterior(context, start, hidden, known), value)
    assert not torch.allclose(model.log_posterior(context, start, seen, known), value)
