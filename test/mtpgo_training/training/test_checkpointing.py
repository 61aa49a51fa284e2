# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Checkpoints: what is restored from one, and the sentence for one that does not fit."""

import copy
import dataclasses

import numpy as np
import pytest
import torch
from calibration_sets import random_samples
from lightning_fabric.plugins import Precision
from tiny_run import CONFIG, new_run

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.options import from_dict
from mtpgo_core.task.calibration import (
    GROUPS,
    Calibration,
    CalibrationSite,
    GroupCalibration,
)
from mtpgo_core.task.task_description import HistoryConfig, SceneConfig
from mtpgo_training.calibration.calibration_samples import CalibrationSamples
from mtpgo_training.evaluation.training_overlap import is_known
from mtpgo_training.training.checkpointing import (
    all_recordings,
    restore_optimiser,
    resume_from,
    save_checkpoint,
    start_from,
)
from mtpgo_training.training.run_folder import RunFolder, load_checkpoint

CALIBRATION = Calibration(
    groups=tuple(GroupCalibration(name=name, factors=(1.0, 1.25)) for name in GROUPS),
    sites=(CalibrationSite("cars/1", 7),),
)

SPLITS = [{"name": "01", "sha256": "ab", "split": "train"}]


@pytest.fixture(scope="module")
def samples():
    return random_samples(1, sites=("cars/1",), n=7)


def assert_weights(model, other):
    for name, value in model.state_dict().items():
        torch.testing.assert_close(value, other.state_dict()[name], rtol=0.0, atol=0.0)


@pytest.fixture(scope="module")
def saved(samples, tmp_path_factory):
    """A run in its third epoch, whose average differs from its weights, and its folder."""
    run = new_run(seed=5)
    with torch.no_grad():
        for value in run.average.parameters():
            value.mul_(0.5)
    run.state.count_step(1.5, 8.0)
    run.state.finish_epoch({"epoch": 1, "loss": 1.5})
    run.state.count_step(0.5, 8.0)
    run.state.best, run.state.best_epoch = 0.75, 1
    run.state.calibration = dataclasses.asdict(CALIBRATION)
    run.samples = samples
    folder = RunFolder(tmp_path_factory.mktemp("run"))
    save_checkpoint(run, folder, SPLITS, optimiser={"a": 1}, precision={}, best=True)
    return run, folder


def test_a_resumed_run_has_the_same_weights_and_state(saved):
    run, folder = saved
    again = new_run(seed=6)
    resume_from(again, load_checkpoint(folder.last), folder.last)
    assert_weights(again.model, run.model)
    assert_weights(again.average, run.average)
    assert again.state == run.state
    assert (folder.path / "log.csv").read_text().startswith("epoch,loss,total_seconds\n1,1.5,")


def test_the_best_checkpoint_describes_itself_and_cannot_be_resumed(saved):
    run, folder = saved
    best = load_checkpoint(folder.best)
    described = {name: best[name] for name in ("network", "epoch", "step")}
    assert described == {"network": "mtp-go", "epoch": 1, "step": 2}
    assert from_dict(Calibration, best["calibration"], "calibration") == CALIBRATION
    assert best["splits"] == SPLITS
    assert best["model_config"] == run.model.config.to_dict()
    with pytest.raises(ConfigurationError, match=r"best\.pt does not fit the configured network"):
        resume_from(new_run(), best, folder.best)


def test_the_samples_of_the_validation_are_beside_the_best_checkpoint(saved, samples):
    _, folder = saved
    stored = CalibrationSamples.load(folder.samples)
    assert stored.sites == samples.sites
    np.testing.assert_array_equal(stored.distance, samples.distance)


def test_a_run_starts_from_the_averaged_weights_of_another(saved):
    run, folder = saved
    new = new_run(seed=6)
    start_from(new, load_checkpoint(folder.best), folder.best)
    assert_weights(new.model, run.average)
    assert_weights(new.average, run.average)
    assert (new.state.epoch, new.state.step) == (0, 0)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        (
            {"network": "seq2seq", "model": {"hidden": 8}},
            "best.pt are of 'mtp-go', but the configured network is 'seq2seq', expected the same",
        ),
        ({"model": {**CONFIG.model, "hidden": 12}}, "best.pt do not fit the configured network: "),
        (
            {"scene": SceneConfig(max_neighbours=3, context="polar")},
            "trained on other inputs (frame centre_heading, context none, classes car, ",
        ),
        ({"history": HistoryConfig(dt_s=0.1)}, "16 steps of 0.2 s), expected those of the conf"),
    ],
)
def test_weights_of_another_network_or_other_inputs_are_refused(saved, changes, sentence):
    checkpoint, path = load_checkpoint(saved[1].best), saved[1].best
    new = new_run(dataclasses.replace(CONFIG, **changes))
    with pytest.raises(ConfigurationError) as caught:
        start_from(new, checkpoint, path)
    assert sentence in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_recordings_of_the_first_weights_are_recordings_of_the_run():
    own = {"name": "01", "sha256": "a", "split": "train"}
    earlier = [own, {**own, "split": "test"}, {"name": "07", "sha256": "b", "split": "train"}]
    assert all_recordings([own], {"splits": earlier}) == earlier
    assert all_recordings([own], None) == [own]


def test_other_times_of_a_recording_that_the_first_weights_have_seen_are_kept():
    own = {"name": "01@0-60s", "sha256": "a", "split": "train"}
    earlier = [{**own, "name": name} for name in ("01@0-60s", "01@60-120s", "01")]
    known = {"recordings": all_recordings([own], {"splits": earlier[:2]})}
    assert known["recordings"] == earlier[:2]
    assert is_known(known, "a", "01@70-80s")
    assert all_recordings([own], {"splits": earlier}) == earlier


@pytest.mark.parametrize(
    ("state", "reason"),
    [
        ({"rows": 3}, "state.rows is 3, expected list"),
        ({"epoch": "x"}, "state.epoch is 'x', expected int"),
        ({"colour": 1}, "state has the unknown field 'colour'"),
    ],
)
def test_a_damaged_state_is_one_sentence(saved, state, reason):
    checkpoint, path = load_checkpoint(saved[1].last), saved[1].last
    with pytest.raises(ConfigurationError, match=f"does not fit the configured .*{reason}"):
        resume_from(new_run(), {**checkpoint, "state": {**checkpoint["state"], **state}}, path)


def adam():
    """An optimiser of two weights that has done a step, and its state."""
    weights = [torch.nn.Parameter(torch.ones(size)) for size in (2, 3)]
    optimiser = torch.optim.AdamW(weights)
    sum(value.sum() for value in weights).backward()
    optimiser.step()
    return optimiser, copy.deepcopy(optimiser.state_dict())


def test_the_optimiser_is_restored(tmp_path):
    _, state = adam()
    state["state"][1]["exp_avg"] += 5.0
    optimiser, _ = adam()
    restore_optimiser(optimiser, Precision(), {"optimiser": state, "precision": {}}, tmp_path)
    restored = optimiser.state_dict()["state"][1]["exp_avg"]
    torch.testing.assert_close(restored, state["state"][1]["exp_avg"])


@pytest.mark.parametrize(
    "damage",
    [
        lambda state: state.clear(),
        lambda state: state.update(param_groups=[]),
        lambda state: state["state"].update({0: state["state"][1]}),
        lambda state: state["state"][0].pop("exp_avg_sq"),
        lambda state: state["state"][0].update(step="x"),
    ],
    ids=["empty", "no groups", "another shape", "half a moment", "no step"],
)
def test_a_damaged_optimiser_is_one_sentence(tmp_path, damage):
    optimiser, state = adam()
    damage(state)
    path, content = tmp_path / "last.pt", {"optimiser": state, "precision": {}}
    with pytest.raises(ConfigurationError, match=r"last\.pt does not fit the optimiser"):
        restore_optimiser(optimiser, Precision(), content, path)
