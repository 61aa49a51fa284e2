# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The baselines learn; those that see their neighbours also learn to react to them."""

import pytest
import torch
from baseline_samples import ALL, make_baseline

STEPS, HORIZON = 4, 6


def driving(gap):
    """[B, 2, T, 8] and presence: a car, and another in the next lane, ``gap`` [B] metres ahead."""
    scenes = gap.numel()
    time = 0.2 * torch.arange(1 - STEPS, 1)
    features = torch.zeros(scenes, 2, STEPS, 8)
    features[..., 0] = 10.0 * time
    features[:, 1, :, 0] += gap.unsqueeze(-1)
    features[:, 1, :, 1] = 3.0
    features[..., 2], features[..., 6] = 10.0, 1.0
    return features, torch.ones(scenes, 2, STEPS, dtype=torch.bool), torch.zeros(scenes, 2, 8)


def learn(model, inputs, target, steps):
    """The first agent's mean squared error of the first mode (m^2) before and after each step."""
    optimiser = torch.optim.Adam(model.parameters(), 0.01)
    errors = []
    for _ in range(steps + 1):
        _, mean, _ = model.roll_out(*inputs, None, False, None, None)
        error = (mean[:, 0, 0] - target).square().sum(-1).mean()
        errors.append(float(error.detach()))
        optimiser.zero_grad()
        error.backward()
        optimiser.step()
    return errors


def small(name):
    return make_baseline(
        name, torch.float32, wild=False, history_steps=STEPS, horizon_steps=HORIZON, hidden=12
    )


@ALL
def test_all_learn_to_brake(name):
    inputs = driving(torch.full((8,), 12.0))
    time = 0.2 * torch.arange(1, HORIZON + 1)
    target = torch.stack((10.0 * time - 3.0 * time.square(), 0.0 * time), dim=-1)
    before, *_, after = learn(small(name), inputs, target.expand(8, -1, -1), 40)
    assert after < 0.1 * before


@pytest.mark.parametrize(
    ("name", "can"), [("seq2seq", False), ("s-lstm", True), ("cs-lstm", True), ("gnn-rnn", True)]
)
def test_only_networks_that_see_the_neighbour_learn_to_react_to_it(name, can):
    """Half of the cars have a neighbour 12 m ahead and brake, half one 28 m behind and do not."""
    gap = torch.where(torch.arange(16) % 2 == 0, 12.0, -28.0)
    time = 0.2 * torch.arange(1, HORIZON + 1)
    brake = torch.where(gap > 0, 4.0, 0.0).unsqueeze(-1) * time.square()
    target = torch.stack((10.0 * time - brake, torch.zeros_like(brake)), dim=-1)
    errors = learn(small(name), driving(gap), target, 200)
    # The best step, because single steps of so fast a training fail, and which ones depends on the
    # last digits of the CPU: with some seeds and threads the last step is one of them.
    before, best = errors[0], min(errors)
    # Without the neighbour the two halves look the same, and half of the error is left.
    assert (best < 0.2 * before) is can
    assert best >= 0.499 * before or can


@pytest.mark.parametrize(
    ("name", "can"), [("seq2seq", False), ("s-lstm", True), ("cs-lstm", True), ("gnn-rnn", True)]
)
def test_only_networks_that_see_the_neighbour_react_to_it_without_training(name, can):
    model = make_baseline(
        name, torch.float32, wild=True, history_steps=STEPS, horizon_steps=HORIZON, hidden=12
    )
    _, mean, _ = model.roll_out(*driving(torch.tensor([12.0, -28.0])), None, False, None, None)
    difference = (mean[0, 0] - mean[1, 0]).abs().max()
    assert difference > 1e-3 if can else difference == 0.0
