# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A tiny network adapted to a site where cars brake, end to end."""

import dataclasses
import signal

import pytest
import torch
from site_data import base_checkpoint, site, write_base

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.options import from_dict
from mtpgo_core.task.calibration import Calibration
from mtpgo_training.adapt import adaptation as module
from mtpgo_training.adapt.adapt_options import AdaptOptions
from mtpgo_training.adapt.adapt_report import coverage_warning, report_text, require_better
from mtpgo_training.adapt.adaptation import adapt, adapted_config
from mtpgo_training.adapt.adaptation_scores import SiteScores
from mtpgo_training.export.exporter import load_model
from mtpgo_training.training.data_loading import Scenes
from mtpgo_training.training.interruption import Interruption
from mtpgo_training.training.networks import weights_hash
from mtpgo_training.training.run_folder import load_checkpoint
from mtpgo_training.training.trial.epoch_cost import EpochCost

OPTIONS = AdaptOptions(epochs=4, learning_rate=1e-2, num_threads=1)


@pytest.fixture(scope="module")
def base(tmp_path_factory):
    return write_base(tmp_path_factory.mktemp("base") / "run")


@pytest.fixture(scope="module")
def adapted(base):
    return adapt(base, site(), OPTIONS, name="mine")


def test_it_is_better_on_a_site_with_another_behaviour(adapted):
    assert adapted.before.ade_m == pytest.approx(adapted.before.constant_velocity_ade_m, rel=0.02)
    assert adapted.after.ade_m < 0.8 * adapted.before.ade_m
    assert adapted.after.nll < adapted.before.nll
    require_better(adapted)


def test_the_checkpoint_says_where_it_comes_from(adapted, base):
    checkpoint = adapted.checkpoint
    origin = checkpoint["adapted_from"]
    assert origin["name"] == "tiny"
    assert origin["weights_sha256"] == weights_hash(load_model(load_checkpoint(base)))
    assert origin["share"] == adapted.share
    assert origin["validation"]["after"]["ade_m"] == adapted.after.ade_m
    assert checkpoint["config"]["name"] == "mine"
    uses = {(r["source"], r["name"]): r["split"] for r in checkpoint["splits"]}
    assert uses["home", "01"] == "train"  # what the base model has seen is seen
    assert uses["site", "01"] == "train"
    assert uses["site", "06"] == "validation"
    scores = checkpoint["metrics"]["model"]["all"]
    assert scores["moving_n"] > 0
    assert from_dict(Calibration, checkpoint["calibration"], "here").sites[0].name == "site/test"


def test_the_same_seed_gives_the_same_weights(adapted, base):
    again = adapt(base, site(), OPTIONS, name="mine").checkpoint
    assert again["calibration"] == adapted.checkpoint["calibration"]
    for name, value in adapted.checkpoint["average"].items():
        assert torch.equal(again["average"][name], value)


def test_the_report_has_three_lines_with_the_figures(adapted):
    lines = report_text(adapted, 1.5).splitlines()
    assert len(lines) == 3
    assert f"{adapted.before.ade_m:.3f} -> {adapted.after.ade_m:.3f} m (-" in lines[0]
    assert "at 1/3/5 s" in lines[1]
    assert "4 recording(s), 32 road users, 4 epochs" in lines[2]
    assert "in 1.5 min" in lines[2]


@pytest.mark.parametrize(
    ("epochs", "best", "received_signal", "said"),
    [
        (4, 3, None, "4 epochs, best 3, "),
        (1, 1, None, "1 of 4 epochs fitted into --minutes, best 1, "),
        (1, 2, None, "1 of 4 epochs fitted into --minutes, best 2 (not completed), "),
        (0, 0, None, "0 of 4 epochs fitted into --minutes, those within the first kept, "),
        (1, 1, signal.SIGINT, "1 epochs, best 1, "),
    ],
)
def test_the_report_says_if_the_time_was_short(adapted, epochs, best, received_signal, said):
    changes = {"epochs": epochs, "best_epoch": best, "received_signal": received_signal}
    lines = report_text(dataclasses.replace(adapted, **changes), 1.5).splitlines()
    assert len(lines) == 3
    assert f" road users, {said}" in lines[2]


def test_the_time_may_end_within_the_first_epoch(base, monkeypatch):
    """Then the weights within it are validated, as those of an epoch are."""
    limit = "mtpgo_training.training.trial.time_limit.TimeLimit.is_up"
    monkeypatch.setattr(limit, lambda self, measure: True)
    found = adapt(base, site(), OPTIONS, name="mine")
    assert (found.epochs, found.best_epoch, found.wanted_epochs) == (0, 0, 4)


def test_ellipses_that_are_too_small_are_told_with_what_to_do(adapted):
    def warning(**coverage):
        shares = {float(name.removeprefix("at_")): share for name, share in coverage.items()}
        after = dataclasses.replace(adapted.after, coverage_90=shares)
        return coverage_warning(dataclasses.replace(adapted, after=after))

    assert warning(at_1=0.85, at_3=0.9, at_5=float("nan")) == ""
    said = warning(at_1=0.84, at_3=0.9, at_5=0.7)
    assert "hold 0.84/0.70 of the moving road users 1/5 s ahead, expected at least 0.85" in said
    assert said.endswith("adapt with more recordings or more --minutes")


@pytest.mark.parametrize("changes", [{"ade_m": 99.0}, {"nll": 99.0}])
def test_a_model_that_became_worse_is_refused_with_the_figures(adapted, changes):
    worse = dataclasses.replace(adapted, after=dataclasses.replace(adapted.after, **changes))
    with pytest.raises(ConfigurationError, match=r"is worse than .* -> .*99\.000.*--force") as got:
        require_better(worse)
    assert "\n" not in str(got.value)


@pytest.mark.parametrize(
    ("found", "share"),
    [
        ({0.25: (0.9, 1.0), 0.5: (0.7, 1.0), 0.75: (0.6, 1.0), 1.0: (0.8, 1.0)}, 0.75),
        ({0.25: (0.9, 1.0), 0.5: (0.7, 1.0), 0.75: (0.6, 2.1), 1.0: (0.5, 2.1)}, 0.5),
        ({0.25: (1.1, 2.1), 0.5: (1.2, 2.1), 0.75: (1.3, 2.1), 1.0: (1.4, 2.1)}, 0.25),
    ],
)
def test_the_share_with_the_smallest_ade_is_kept_if_its_likelihood_is_no_worse(
    monkeypatch, found, share
):
    """ADE (m) and NLL by share are given; before it was 1.0 m and 2.0."""
    given = iter(found.values())
    before = SiteScores(100, 1.0, 1.0, 2.0, {})

    def known_scores(predictions):
        ade_m, nll = next(given)
        return dataclasses.replace(before, ade_m=ade_m, nll=nll)

    predicted = iter(found)
    monkeypatch.setattr(module, "predict_site", lambda model, scenes: next(predicted))
    monkeypatch.setattr(module, "cross_calibrated", lambda predictions, calibration: None)
    monkeypatch.setattr(module, "score_site", known_scores)
    base = base_checkpoint()
    tuned = {name: value + 1.0 for name, value in base["average"].items()}
    chosen, weights, predictions, scores = module._best_share(base, tuned, Scenes([], []), before)
    assert chosen == predictions == share
    assert (scores.ade_m, scores.nll) == found[share]
    for name, value in base["average"].items():
        torch.testing.assert_close(weights[name], value + share)


def test_epochs_that_would_take_too_long_are_left_out(base, monkeypatch):
    monkeypatch.setattr(
        module, "measure_epoch", lambda run, scenes, clock: EpochCost(1.0, 100.0, 20.0, 10)
    )
    options = dataclasses.replace(OPTIONS, epochs=20, minutes=10.0)
    # Of 120 s, in 85 % of ten minutes, and one of the covariances.
    assert adapt(base, site(), options, name="mine").epochs == 3


def test_an_interrupt_keeps_the_best_weights_so_far(base, monkeypatch):
    steps = []

    class Interrupting(Interruption):
        def requested(self):
            steps.append(1)
            if len(steps) == 8:  # in the second epoch, which begins with the sixth
                signal.raise_signal(signal.SIGINT)
            return super().requested()

    monkeypatch.setattr("mtpgo_training.training.trainer.Interruption", Interrupting)
    found = adapt(base, site(), dataclasses.replace(OPTIONS, epochs=20), name="mine")
    assert found.received_signal == signal.SIGINT
    assert found.epochs == found.best_epoch == 1
    assert found.after.ade_m < found.before.ade_m


def test_an_interrupt_in_the_first_epoch_keeps_what_was_trained(base, monkeypatch):
    class Interrupting(Interruption):
        def requested(self):
            signal.raise_signal(signal.SIGINT)
            return super().requested()

    monkeypatch.setattr("mtpgo_training.training.trainer.Interruption", Interrupting)
    found = adapt(base, site(), OPTIONS, name="mine")
    assert (found.epochs, found.best_epoch) == (0, 0)
    assert found.checkpoint["step"] == 1


@pytest.mark.parametrize(
    ("recordings", "options", "sentence"),
    [
        (site(count=1), OPTIONS, "is left for data.validation out of 1 recordings"),
        (site(tracks=1), OPTIONS, "moving agents, counted every 1 s, expected at least 50"),
        (site(), dataclasses.replace(OPTIONS, minutes=0.01), "--minutes is 0.01, expected at lea"),
    ],
)
def test_recordings_or_time_that_do_not_suffice_are_one_sentence(
    base, recordings, options, sentence
):
    with pytest.raises(ConfigurationError, match=sentence):
        adapt(base, recordings, options, name="mine")


def test_the_training_keeps_the_task_and_draws_a_part_of_many_scenes(base):
    checkpoint = base_checkpoint()
    few = adapted_config(checkpoint, site(), AdaptOptions(epoch_scenes=1000), "mine")
    assert few.data.source_weight == {"site": 1.0}
    part = adapted_config(checkpoint, site(), AdaptOptions(epoch_scenes=20), "mine")
    assert 0.05 < part.data.source_weight["site"] < 0.5
    assert part.scene == few.scene
    assert part.model == checkpoint["config"]["model"]
    assert part.optimisation.warm_up_share == 0.0


def test_the_training_has_no_epochs_for_the_covariances_which_have_a_training_of_their_own(base):
    checkpoint = base_checkpoint()
    checkpoint["config"]["optimisation"] |= {"epochs": 6, "calibration_epochs": 1}
    config = adapted_config(checkpoint, site(), AdaptOptions(epochs=1), "mine")
    assert (config.optimisation.epochs, config.optimisation.main_epochs) == (1, 1)


def test_the_training_is_of_all_parts_with_the_likelihood_alone(base):
    """Whatever the last stage of the base model was."""
    checkpoint = base_checkpoint()
    last = {"train_only": ["noise"], "warm_up_share": 0.0, "consistency_weight": 10.0}
    checkpoint["config"]["optimisation"] |= last
    options = adapted_config(checkpoint, site(), AdaptOptions(), "mine").optimisation
    assert options.train_only == ()
    assert options.consistency_weight == 0.0


def test_options_out_of_range_are_refused():
    with pytest.raises(ConfigurationError, match=r"adapt\.minutes is 0, expected more than 0"):
        AdaptOptions(minutes=0)
