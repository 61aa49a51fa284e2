# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Validation of a network whose errors are known, the calibration by hand, the best epoch."""

import math

import pytest
import torch
from tiny_run import CONFIG, new_run, with_options
from traffic import braking_cars

from mtpgo_training.data.splits import NamedRecording, Splits
from mtpgo_training.training.data_loading import prepare_scenes
from mtpgo_training.training.validation import (
    EWTA_PENALTY_M,
    CovarianceCalibration,
    validate,
    validate_epoch,
)

RADIUS_90 = -2.0 * math.log(0.1)
"""Squared radius of the ellipse that holds 90 % of a Gaussian in the plane."""


def known_batch(squared, weight=None, primary=None):
    """Fields, and an output whose heaviest mode is at the given squared distances [N, H]."""
    squared = torch.as_tensor(squared, dtype=torch.float32)
    n, h = squared.shape
    mean = torch.full((1, n, 2, h, 4), 99.0)  # the lighter mode is far away
    mean[:, :, 1] = 0.0
    mean[0, :, 1, :, 1] = (0.25 * squared).sqrt()
    covariance = torch.eye(4).mul(0.25).expand(1, n, 2, h, 4, 4)
    fields = {
        "target": torch.zeros(1, n, h, 4),
        "weight": torch.ones(1, n, h) if weight is None else torch.tensor([weight]),
        "primary": torch.ones(1, n, dtype=bool) if primary is None else torch.tensor([primary]),
    }
    log_weight = torch.tensor([0.3, 0.7]).log().expand(1, n, 2)
    return fields, log_weight, mean, covariance


def scale(*batches, level=0.9):
    calibration = CovarianceCalibration()
    for batch in batches:
        calibration.add(*batch)
    return calibration.scale(level)


def test_the_scale_is_that_of_the_ellipse_that_holds_the_level():
    distances = [[float(d)] for d in (3, 10, 1, 8, 5, 6, 7, 4, 9, 2)]
    assert scale(known_batch(distances)) == pytest.approx(9.0 / RADIUS_90, rel=1e-5)
    half = -2.0 * math.log(0.5)
    assert scale(known_batch(distances), level=0.5) == pytest.approx(5.0 / half, rel=1e-5)


def test_every_agent_counts_the_same_over_its_observed_steps():
    # The three steps of the first agent have a share of 1/3 each, the others' single steps 1.
    weight = [[1.0, 1.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
    given = known_batch([[0.2, 0.4, 0.6], [0.8, 99.0, 99.0], [99.0, 1.0, 99.0]], weight)
    for level, distance in ((0.2, 0.4), (0.5, 0.8), (0.9, 1.0)):
        radius = -2.0 * math.log(1.0 - level)
        assert scale(given, level=level) == pytest.approx(max(0.25, distance / radius), rel=1e-5)


def test_agents_that_are_not_primary_do_not_count():
    given = known_batch([[5.0], [90.0], [90.0]], primary=[True, False, False])
    assert scale(given) == pytest.approx(5.0 / RADIUS_90, rel=1e-5)


@pytest.mark.parametrize(("squared", "limit"), [(1e-4, 0.25), (1e4, 4.0)])
def test_the_scale_is_limited(squared, limit):
    assert scale(known_batch([[squared]])) == limit


def test_merged_calibrations_are_those_of_all_batches():
    one, other = known_batch([[1.0], [2.0], [7.0]]), known_batch([[3.0], [6.0]])
    first, second = CovarianceCalibration(), CovarianceCalibration()
    first.add(*one)
    second.add(*other)
    first.merge(second)
    assert first.scale() == scale(one, other)


class Beside(torch.nn.Module):
    """Predicts for every agent its present position and a certain distance to the left."""

    def __init__(self, distance_m):
        super().__init__()
        self.distance_m = torch.nn.Parameter(torch.tensor(distance_m))

    def forward(self, x, valid, static):
        b, n = x.shape[:2]
        mean = torch.zeros(b, n, 1, 3, 4)
        mean[..., :2] = x[:, :, -1, None, None, :2]
        mean[..., 1] += self.distance_m
        return torch.zeros(b, n, 1), mean, torch.eye(4).expand(b, n, 1, 3, 4, 4)


def standing_agents():
    """A batch of three agents that stand: the centre, another, and one without a future."""
    x = torch.zeros(1, 3, 16, 6)
    x[0, :, :, 0] = torch.tensor([0.0, 10.0, 20.0])[:, None]
    target = torch.zeros(1, 3, 3, 4)
    target[..., 0] = x[:, :, -1, None, 0]
    weight = torch.ones(1, 3, 3)
    weight[0, 2] = 0.0
    baselines = target[:, :, None, :, :2].repeat(1, 1, 3, 1, 1).clone()
    baselines[:, :, 1, :, 0] += 3.0
    return {
        "x": x,
        "valid": torch.ones(1, 3, 16, dtype=bool),
        "static": torch.zeros(1, 3, 2),
        "target": target,
        "weight": weight,
        "primary": torch.ones(1, 3, dtype=bool),
        "centre": torch.tensor([[True, False, False]]),
        "baselines": baselines,
    }


def test_scores_are_those_of_the_known_errors():
    scores, calibration = validate(Beside(1.5), [standing_agents()] * 2)
    averages = scores.averages()
    assert averages["model"]["all"]["ade"] == pytest.approx(1.5)
    assert (averages["model"]["all"]["n"], averages["model"]["centre"]["n"]) == (4, 2)
    assert averages["cv"]["all"]["ade"] == pytest.approx(0.0)
    assert averages["ca"]["all"]["ade"] == pytest.approx(3.0)
    assert calibration.scale() == pytest.approx(1.5**2 / RADIUS_90, rel=1e-5)


def test_the_scaled_covariance_covers_what_the_unscaled_one_does_not():
    distance = math.sqrt(1.1 * RADIUS_90)
    plain, scaled = (
        validate(Beside(distance), [standing_agents()], factor)[0].averages()["model"]["all"]
        for factor in (1.0, 1.2)
    )
    assert (plain["coverage_90"], scaled["coverage_90"]) == (0.0, 1.0)
    assert plain["ade"] == scaled["ade"]


@pytest.fixture(scope="module")
def scenes():
    train, validation = (
        (NamedRecording("cars", braking_cars(name, tracks=3, seconds=3.0)),)
        for name in ("01", "02")
    )
    return prepare_scenes(CONFIG, Splits(train, validation, ()), 5, progress=False).validation


@pytest.mark.parametrize(("keep", "later"), [("best", 4), ("last", 6)])
def test_an_epoch_with_an_ewta_loss_is_the_best_only_until_one_without(scenes, keep, later):
    run = new_run(with_options(keep=keep))
    row, better = validate_epoch(run, scenes, 0, 1)
    assert better
    assert run.state.best == pytest.approx(EWTA_PENALTY_M + row["all_ade"], abs=1e-3)
    run.state.epoch = 3  # of 8, and on the likelihood alone
    _, better = validate_epoch(run, scenes, 0, 1)
    assert better
    assert run.state.best_epoch == 4
    assert run.state.best == pytest.approx(row["all_ade"], abs=1e-3)
    run.state.epoch = 5
    again, better = validate_epoch(run, scenes, 0, 1)
    assert again == row
    assert better == (keep == "last")
    assert run.state.best_epoch == later
    assert run.state.metrics["model"]["all"]["n"] == 8
