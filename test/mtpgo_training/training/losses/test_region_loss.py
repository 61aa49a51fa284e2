# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The losses of the region-based training by hand."""

import math

import pytest
import torch

from models.baselines import MMTransformer, TransformerConfig
from mtpgo_training.training.losses.region_loss import confidence_loss, region_loss

SIZES = {"history_steps": 4, "horizon_steps": 3, "modes": 4, "hidden": 8}


def batch(end):
    """One agent that drives along x, seen until ``end`` of three steps."""
    features = torch.zeros(1, 1, 4, 8)
    features[..., 0] = torch.tensor([-3.0, -2.0, -1.0, 0.0])
    features[..., 2], features[..., 6] = 5.0, 1.0
    target = torch.zeros(1, 1, 3, 2)
    target[0, 0, :, 0] = torch.tensor([1.0, 2.0, 3.0])
    weight = (torch.arange(3) < end).float().view(1, 1, 3)
    valid, static = torch.ones(1, 1, 4, dtype=torch.bool), torch.zeros(1, 1, 8)
    return {"x": features, "valid": valid, "static": static, "target": target, "weight": weight}


@pytest.fixture
def model():
    torch.manual_seed(0)
    network = MMTransformer(TransformerConfig(**SIZES, regions=2))
    network.centre.copy_(torch.tensor([[50.0, 0.0], [3.5, 0.0]]))
    return network


def test_the_confidence_by_hand():
    """Scores 0.1, 0.2, 0.3, 0.4, distances 0 and ln 3 m in the region of the last two."""
    score = torch.tensor([0.1, 0.2, 0.3, 0.4]).log()
    distance = torch.tensor([9.0, 9.0, 0.0, math.log(3.0)])
    mine = torch.tensor([False, False, True, True])
    wanted, given = (0.75, 0.25), (3.0 / 7.0, 4.0 / 7.0)
    expected = sum(w * math.log(w / g) for w, g in zip(wanted, given, strict=True))
    assert float(confidence_loss(score, distance, mine)) == pytest.approx(
        expected - math.log(0.7), rel=1e-5
    )


def test_proposals_are_dealt_to_the_regions_in_turn(model):
    given = batch(3)
    mine = model.in_region(given["x"], given["valid"], given["target"])
    assert mine.tolist() == [[[False, True, False, True]]]


@pytest.mark.parametrize("end", [3, 2])
def test_only_proposals_of_the_region_are_drawn_to_the_truth(model, end):
    """Or the nearest one, where the end is not observed."""
    region_loss(model, batch(end), progress=0.0).backward()
    touched = (model.first_path.grad.abs().sum(dim=-1) > 0.0).tolist()
    assert touched == ([False, True, False, True] if end == 3 else touched)
    assert sum(touched) == (2 if end == 3 else 1)
    assert all(torch.isfinite(p.grad).all() for p in model.parameters() if p.grad is not None)


def test_the_covariances_learn_alone(model):
    """They get a gradient, and without them the rest has the same one."""
    region_loss(model, batch(3), progress=0.0).backward()
    assert model.noise.sigma_1.weight.grad.abs().sum() > 0.0
    before = model.path.weight.grad.clone()
    with torch.no_grad():
        model.noise.sigma_1.bias.add_(1.0)
    model.zero_grad()
    region_loss(model, batch(3), progress=0.0).backward()
    torch.testing.assert_close(model.path.weight.grad, before)


def test_the_centres_come_from_the_futures_of_sample_scenes(model):
    given = batch(3)
    many = {name: value.expand(6, *value.shape[1:]).clone() for name, value in given.items()}
    many["target"][:3, :, -1, 0] = 20.0
    model.fit_futures(many["x"], many["valid"], many["target"], many["weight"])
    assert sorted(model.centre.tolist()) == [[3.0, 0.0], [20.0, 0.0]]
