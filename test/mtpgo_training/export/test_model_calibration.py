# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The calibration of an exported file, and the refusal of ellipses that do not hold the truth."""

import dataclasses

import numpy as np
import pytest
import torch
from calibration_sets import random_samples, with_distance

from models.mtp_go import MTPGO
from models.mtp_go_config import ModelConfig
from mtpgo_core.errors import ConfigurationError
from mtpgo_core.prediction.model_runner import load_task
from mtpgo_core.quality.metrics import radius_squared
from mtpgo_core.task.calibration import Calibration
from mtpgo_training import cli
from mtpgo_training.calibration.calibration_fit import LEVEL, WIDENED_LEVEL, fit_calibration
from mtpgo_training.calibration.calibration_report import moving_scores
from mtpgo_training.calibration.calibration_samples import SampledRecording
from mtpgo_training.evaluation.training_overlap import uses_of
from mtpgo_training.export.model_calibration import check_coverage
from mtpgo_training.training.run_folder import RunFolder
from mtpgo_training.training.training_config import TrainingConfig

WIDENED = radius_squared(WIDENED_LEVEL) / radius_squared(LEVEL)
"""What widening needs of the factor at which the ellipse would hold 90 % of a Gaussian."""

OPTIONS = {"hidden": 8, "modes": 3, "horizon_steps": 25, "ode_hidden": 4}


def metrics(share, agents=50):
    scores = {"moving_n": agents, "coverage_90_moving_1s": 0.5, "coverage_90_moving_5s": share}
    return {"model": {"all": scores}}


@pytest.mark.parametrize("share", [0.8, 0.9, 0.98])
def test_ellipses_that_hold_about_their_level_are_accepted(share):
    assert check_coverage(metrics(share)) == ""


@pytest.mark.parametrize(("share", "text"), [(0.79, "79.0%"), (0.985, "98.5%")])
def test_ellipses_that_hold_too_few_or_too_many_are_refused_unless_forced(share, text):
    sentence = f"hold {text} of the moving validation road users 5 s ahead .50 predictions.,"
    with pytest.raises(ConfigurationError, match=sentence):
        check_coverage(metrics(share))
    assert text in check_coverage(metrics(share), force=True)


@pytest.mark.parametrize(("share", "agents"), [(0.1, 49), (None, 0)])
def test_with_few_agents_there_is_a_warning_only(share, agents):
    assert f"has only {agents} predictions" in check_coverage(metrics(share, agents))


@pytest.mark.parametrize(
    "given", [{}, {"model": {"all": {"ade": 0.5, "coverage_90_moving_5s": None}}}, metrics(None)]
)
def test_what_is_not_known_is_not_checked(given):
    assert "were not checked" in check_coverage(given)


@pytest.fixture(scope="module")
def network():
    torch.manual_seed(4)
    return MTPGO(ModelConfig(**OPTIONS)).eval()


@pytest.fixture
def make_run(network, tmp_path):
    """Write a run with validation samples, calibrated by the fit to them or not."""

    def make(samples, calibration=None):
        calibration = fit_calibration(samples) if calibration is None else calibration
        folder = RunFolder(tmp_path / "run")
        scores = {"ade": 0.5, "anll": 1.5, **moving_scores(samples.calibrated(calibration))}
        checkpoint = {
            "config": dataclasses.asdict(TrainingConfig(name="tiny", model=OPTIONS)),
            "model_config": network.config.to_dict(),
            "average": network.state_dict(),
            "calibration": dataclasses.asdict(calibration),
            "epoch": 1,
            "step": 1,
            "metrics": {"model": {"all": scores}},
            "splits": [],
        }
        folder.save(checkpoint, best=True)
        samples.save(folder.samples)
        return folder.path

    return make


def test_the_file_has_the_calibration_of_the_checkpoint(make_run, tmp_path, capsys):
    samples = random_samples(1, sites=("here",), n=1000, growth=6.0)
    assert cli.main(["export", str(make_run(samples)), "-o", str(tmp_path / "m.pt")]) == 0
    task = load_task(tmp_path / "m.pt")
    assert task.calibration == fit_calibration(samples)
    assert task.metrics["validation"]["model"]["all"]["anll"] == 1.5
    out, err = capsys.readouterr()
    assert "calibrated fitted to validation recordings: here (1000)" in out
    assert "coverage   validation: " in out
    assert err == ""


def test_an_uncalibrated_model_with_narrow_ellipses_is_refused(make_run, tmp_path, capsys):
    run = make_run(random_samples(1, n=1000, growth=6.0))
    command = ["export", str(run), "-o", str(tmp_path / "m.pt"), "--uncalibrated"]
    assert cli.main(command) == 2
    error = capsys.readouterr().err
    assert "mtpgo: the 90 % ellipses hold 3" in error
    assert "(1000 predictions), expected 80% to 98% (--force exports" in error
    assert error.count("\n") == 1
    assert not (tmp_path / "m.pt").exists()
    assert cli.main([*command, "--force"]) == 0
    assert "mtpgo: warning: the 90 % ellipses hold 3" in capsys.readouterr().err
    task = load_task(tmp_path / "m.pt")
    assert task.calibration == Calibration()
    scores = task.metrics["validation"]["model"]["all"]
    assert (scores["ade"], scores["anll"]) == (0.5, None)
    assert scores["coverage_90_moving_5s"] < 0.4


def test_a_model_is_calibrated_on_left_out_sites(make_run, tmp_path, capsys):
    run = make_run(random_samples(1, sites=("here",), n=1000, growth=4.0))
    away = [
        random_samples(seed, sites=(name,), n=2000, growth=6.0)
        for seed, name in ((2, "x"), (3, "y"))
    ]
    recording = SampledRecording("01", "x", "ind", 64 * "a")
    away[0] = dataclasses.replace(away[0], recordings=(recording,))
    for samples in away:
        samples.save(tmp_path / "folds" / samples.sites[0] / "calibration.npz")
    command = ["export", str(run), "-o", str(tmp_path / "m.pt"), "--calibration"]
    assert cli.main([*command, str(tmp_path / "folds")]) == 0
    task = load_task(tmp_path / "m.pt")
    assert task.calibration.left_out
    assert uses_of(task.training, 64 * "a") == ["calibration"]
    assert [(site.name, site.agents) for site in task.calibration.sites] == [
        ("x", 2000),
        ("y", 2000),
    ]
    np.testing.assert_allclose(task.calibration.factor_table[:, -1], 6.0 * WIDENED, rtol=0.1)
    here, there = (task.metrics[name]["model"]["all"] for name in ("validation", "left-out sites"))
    # An ellipse of 5.5 holds 1 - 0.1^(5.5 / 4) of an error of 4.
    assert here["coverage_90_moving_5s"] == pytest.approx(0.958, abs=0.02)
    assert there["coverage_90_moving_5s"] == pytest.approx(WIDENED_LEVEL, abs=0.02)
    assert there["moving_n"] == 4000
    out = capsys.readouterr().out
    assert "each site without and with the calibration fitted to the other sites:" in out
    assert "moving, x" in out


def test_samples_of_another_model_are_one_sentence(make_run, tmp_path, capsys):
    run = make_run(random_samples(1, n=1000))
    random_samples(2, n=100, steps=5).save(tmp_path / "calibration.npz")
    command = ["export", str(run), "-o", str(tmp_path / "m.pt"), "--calibration"]
    assert cli.main([*command, str(tmp_path / "calibration.npz")]) == 2
    error = capsys.readouterr().err
    assert "5 steps of 0.2 s" in error
    assert error.count("\n") == 1
    assert not (tmp_path / "m.pt").exists()


def test_the_check_is_of_all_road_users_not_of_the_mean_of_sites(make_run, tmp_path, capsys):
    """One site of a thousand with right ellipses, and one of three that are all outside."""
    samples = random_samples(1, sites=("here", "corner"), n=(1000, 3))
    distance = np.where(samples.site[:, None] == 0, samples.distance, 99.0)
    run = make_run(with_distance(samples, distance), Calibration())
    assert cli.main(["export", str(run), "-o", str(tmp_path / "m.pt")]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    scores = load_task(tmp_path / "m.pt").metrics["validation"]["model"]["all"]
    assert scores["coverage_90_moving_5s"] == pytest.approx(0.9, abs=0.03)
    assert scores["sites_coverage_90_moving_5s"] == pytest.approx(0.45, abs=0.015)
    assert "of moving road users are inside" in out
    assert f"in the mean of the sites {scores['sites_coverage_90_moving_1s']:.3f} / 0.4" in out


def test_the_check_of_a_checkpoint_of_an_earlier_version_counts_its_samples(make_run, tmp_path):
    """Its scores have the mean of the sites in place of the share of all road users."""
    samples = random_samples(1, sites=("here", "corner"), n=(1000, 3))
    distance = np.where(samples.site[:, None] == 0, samples.distance, 99.0)
    run = RunFolder(make_run(with_distance(samples, distance), Calibration()))
    checkpoint = torch.load(run.best, weights_only=True)
    scores = checkpoint["metrics"]["model"]["all"]
    for time_s in (1, 3, 5):
        share = scores.pop(f"sites_coverage_90_moving_{time_s}s")
        scores[f"coverage_90_moving_{time_s}s"] = share
    torch.save(checkpoint, run.best)
    assert cli.main(["export", str(run.path), "-o", str(tmp_path / "m.pt")]) == 0


def test_the_samples_of_the_best_checkpoint_are_not_those_of_the_last(make_run, tmp_path, capsys):
    samples = random_samples(1, n=1000, growth=6.0)
    run = make_run(samples)
    last = RunFolder(run).last
    command = ["export", str(last), "-o", str(tmp_path / "m.pt"), "--uncalibrated"]
    assert cli.main(command) == 0
    assert "were not checked" in capsys.readouterr().err


def test_a_single_left_out_site_is_fitted_without_a_comparison(make_run, tmp_path, capsys):
    samples = random_samples(1, n=1000, growth=6.0)
    run = make_run(samples)
    same = with_distance(samples, samples.distance)
    same.save(tmp_path / "calibration.npz")
    command = ["export", str(run), "-o", str(tmp_path / "m.pt"), "--calibration"]
    assert cli.main([*command, str(tmp_path / "calibration.npz")]) == 0
    assert "each site without" not in capsys.readouterr().out
