# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Scaled inputs in the agents' frames."""

import pytest
import torch
from model_samples import make_model, make_scene


def test_uniform_motion_has_no_deviation():
    """Of an agent at constant velocity in any direction, only the speed remains."""
    model = make_model()
    time = (torch.arange(6) - 5).double() * 0.2
    velocity = torch.tensor([3.0, -4.0]).double()
    features = torch.zeros(1, 1, 6, 8).double()
    features[0, 0, :, :2] = torch.tensor([7.0, 2.0]) + velocity * time.unsqueeze(1)
    features[0, 0, :, 2:4] = velocity
    features[0, 0, :, 6:8] = velocity / 5.0
    valid = torch.ones(1, 1, 6, dtype=torch.bool)
    start = model.condition.start(features, valid)
    own = model.condition.own_inputs(features, valid, start)
    want = torch.tensor([0.0, 0.0, 5.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0]).double()
    torch.testing.assert_close(own[0, 0], want.expand(6, 10), rtol=0, atol=1e-12)


def test_fitted_statistics_standardise_the_inputs():
    scene = make_scene(8, 7, steps=6)
    for agent_frame in (True, False):
        model = make_model(agent_frame=agent_frame)
        model.fit_statistics(scene.features, scene.valid)
        start = model.condition.start(scene.features, scene.valid)
        inputs = model.condition(scene.features, scene.valid, start)
        seen = inputs[scene.valid]
        torch.testing.assert_close(seen.mean(0), torch.zeros_like(seen[0]), rtol=0, atol=1e-9)
        torch.testing.assert_close(seen.std(0), torch.ones_like(seen[0]))
        assert not inputs[~scene.valid].any()


def test_static_features_are_repeated_at_every_sample_that_is_known():
    condition = make_model().condition
    inputs = torch.arange(12.0).view(1, 2, 3, 2)
    static = torch.tensor([[[5.0], [6.0]]])
    valid = torch.tensor([[[True, True, True], [False, True, False]]])
    whole = condition.append_static(inputs, static, valid)
    torch.testing.assert_close(whole[..., :2], inputs)
    assert whole[0, :, :, 2].tolist() == [[5.0, 5.0, 5.0], [0.0, 6.0, 0.0]]


def test_set_statistics_fills_what_is_given():
    model = make_model(agent_frame=True, wild=False)
    before = model.condition.input_std[8:].clone()
    model.set_statistics(torch.arange(8.0), torch.full((8,), 0.001))
    torch.testing.assert_close(model.condition.input_mean[:8], torch.arange(8.0).double())
    # A constant feature is not amplified.
    assert model.condition.input_std[:8].tolist() == pytest.approx([0.02] * 8)
    torch.testing.assert_close(model.condition.input_std[8:], before)
    plain = make_model(agent_frame=False, wild=False)
    plain.set_statistics(torch.arange(8.0), torch.full((8,), 3.0))
    assert plain.condition.state_mean.tolist() == [0.0, 1.0, 2.0, 3.0]
    assert plain.condition.state_std.tolist() == [3.0, 3.0, 3.0, 3.0]
