# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Validation of a network whose errors are known, its samples, the best epoch."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from tiny_run import CONFIG, new_run, with_options
from traffic import braking_cars

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.options import from_dict
from mtpgo_core.task.calibration import GROUPS, Calibration, GroupCalibration
from mtpgo_training.calibration.calibration_fit import fit_calibration
from mtpgo_training.data.splits import NamedRecording, Splits
from mtpgo_training.training.data_loading import prepare_scenes
from mtpgo_training.training.validation import (
    EWTA_PENALTY_M,
    validate,
    validate_epoch,
)

RADIUS_90 = -2.0 * math.log(0.1)
"""Squared radius of the ellipse that holds 90 % of a Gaussian in the plane."""


class Beside(torch.nn.Module):
    """Predicts for every agent its present position and a certain distance to the left."""

    def __init__(self, distance_m):
        super().__init__()
        self.distance_m = torch.nn.Parameter(torch.tensor(distance_m))
        self.config = SimpleNamespace(dt_s=0.2, least_mode_spread=0.0)

    def forward(self, x, valid, static, initial_covariance=None, trails=None):
        b, n = x.shape[:2]
        mean = torch.zeros(b, n, 1, 3, 4)
        mean[..., :2] = x[:, :, -1, None, None, :2]
        mean[..., 1] += self.distance_m
        return torch.zeros(b, n, 1), mean, torch.eye(4).expand(b, n, 1, 3, 4, 4)


class Around(Beside):
    """Predicts three modes: the present position, and a distance to the left and to the right."""

    def __init__(self, distance_m, least_mode_spread):
        super().__init__(distance_m)
        self.config.least_mode_spread = least_mode_spread

    def forward(self, x, valid, static, initial_covariance=None, trails=None):
        _, mean, covariance = super().forward(x, valid, static)
        mean = mean.repeat(1, 1, 3, 1, 1)
        mean[:, :, 0, :, 1] -= self.distance_m
        mean[:, :, 2, :, 1] -= 2.0 * self.distance_m
        log_weight = torch.tensor([0.5, 0.25, 0.25]).log().expand(*mean.shape[:3])
        return log_weight, mean, covariance.repeat(1, 1, 3, 1, 1, 1)


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
        "group": torch.tensor([[1, 0, 0]], dtype=torch.uint8),
    }


def same_factor(factor):
    groups = (GroupCalibration(name=name, factors=(factor,) * 3) for name in GROUPS)
    return Calibration(groups=tuple(groups))


def test_scores_are_those_of_the_known_errors():
    scores, _ = validate(Beside(1.5), [standing_agents()] * 2)
    averages = scores.averages()
    assert averages["model"]["all"]["ade"] == pytest.approx(1.5)
    assert (averages["model"]["all"]["n"], averages["model"]["centre"]["n"]) == (4, 2)
    assert averages["cv"]["all"]["ade"] == pytest.approx(0.0)
    assert averages["ca"]["all"]["ade"] == pytest.approx(3.0)


def test_the_samples_are_those_of_the_primary_agents_without_a_calibration():
    fields = standing_agents() | {"site": torch.tensor([[1, 0, 0]])}
    _, samples = validate(Beside(1.5), [fields, fields], same_factor(2.0), sites=("a", "b"))
    assert samples.sites == ("a", "b")
    assert samples.site.tolist() == [1, 0, 1, 0]
    assert samples.group.tolist() == [1, 0, 1, 0]
    np.testing.assert_allclose(samples.distance, np.full((4, 3), 1.5**2), rtol=1e-5)
    np.testing.assert_allclose(samples.mode_error, np.full((4, 1), 1.5), rtol=1e-5)
    assert samples.step_s == 0.2


def test_modes_are_scored_and_sampled_where_they_are_published():
    # Spread 0.1 sqrt(0.5) m, root of the trace sqrt(2) m: a tenth of it is twice as much.
    scores, samples = validate(Around(0.1, 0.1), [standing_agents()])
    # By 4/3, 5/3 and 2 at the three steps.
    np.testing.assert_allclose(samples.mode_error, [[0.0, 0.5 / 3, 0.5 / 3]] * 2, rtol=1e-5)
    assert scores.averages()["model"]["all"]["ade"] == 0.0
    _, samples = validate(Around(0.1, 0.0), [standing_agents()])
    np.testing.assert_allclose(samples.mode_error, [[0.0, 0.1, 0.1]] * 2, rtol=1e-5)


def test_the_calibrated_covariance_covers_what_the_plain_one_does_not():
    distance = math.sqrt(1.1 * RADIUS_90)
    plain, scaled = (
        validate(Beside(distance), [standing_agents()], calibration)[0]
        for calibration in (Calibration(), same_factor(1.2))
    )
    plain, scaled = (scores.averages()["model"]["all"] for scores in (plain, scaled))
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
    assert run.state.metrics["model"]["all"]["moving_n"] == 5  # known at the last step
    times = {key for key in run.state.metrics["model"]["all"] if "_moving_" in key}
    assert times == {
        "coverage_90_moving_1s",
        "sites_coverage_90_moving_1s",
    }  # as far as the horizon reaches
    stored = from_dict(Calibration, run.state.calibration, "calibration")
    assert stored == fit_calibration(run.samples)
    assert run.samples.sites == ("cars/test",)


def test_a_process_without_a_validation_scene_has_the_scores_of_the_others(scenes, monkeypatch):
    """One scene and two processes: the second has nothing to validate, but takes part."""
    sent = []

    def gather_in_the_first(shares, own):
        sent.append(own)
        shares[:] = [own, None]

    def gather_in_the_second(shares, own):
        shares[:] = [sent.pop(0), own]

    monkeypatch.setattr(torch.distributed, "all_gather_object", gather_in_the_first)
    expected = validate_epoch(new_run(), scenes[:1], 0, 2)
    monkeypatch.setattr(torch.distributed, "all_gather_object", gather_in_the_second)
    assert str(validate_epoch(new_run(), scenes[:1], 1, 2)) == str(expected)
    assert not sent


def test_a_training_that_has_diverged_says_so():
    named = (NamedRecording("cars", braking_cars("01", tracks=3, seconds=4.0)),)
    scenes = prepare_scenes(CONFIG, Splits(named, named, ()), 5, progress=False)
    run = new_run()
    for value in run.average.parameters():
        value.detach().fill_(math.nan)
    with pytest.raises(ConfigurationError, match="not finite after epoch 1, the training has div"):
        validate_epoch(run, scenes.validation, 0, 1)
