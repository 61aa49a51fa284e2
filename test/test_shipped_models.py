# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The shipped model loads by name, carries its description and beats kinematic baselines."""

import dataclasses
import itertools
from pathlib import Path

import numpy as np
import pytest

from mtpgo_core.frames import Pose2, to_fixed_frame
from mtpgo_core.history.track_history import TrackHistory
from mtpgo_core.prediction.model_runner import ModelRunner
from mtpgo_core.prediction.prediction_queries import to_frame
from mtpgo_core.prediction.scene_predictor import PredictorOptions, ScenePredictor
from mtpgo_core.scene.lane_map import LaneMap
from mtpgo_core.schema import AgentClass, Source
from mtpgo_core.task.model_file import find_checkpoint, find_model, load_task, model_card
from mtpgo_training.calibration.calibration_text import moving_coverage
from mtpgo_training.data.readers import load_recordings
from mtpgo_training.data.recording import Recording
from mtpgo_training.evaluation.evaluator import evaluate
from mtpgo_training.evaluation.offline_predictor import make_predictor
from mtpgo_training.export.exporter import load_model
from mtpgo_training.export.model_calibration import check_coverage, own_calibration
from mtpgo_training.scenes.history_replay import replay
from mtpgo_training.training.networks import build_network, weights_hash
from mtpgo_training.training.run_folder import load_checkpoint
from mtpgo_training.training.training_config import load_config

ROOT = Path(__file__).parents[1]
RECIPES = sorted((ROOT / "config/training").glob("*.yaml"))
SHIPPED = sorted(path.stem for path in (ROOT / "resource/weights").glob("*.pt"))
CHECKPOINTS = sorted(path.stem for path in (ROOT / "resource/weights").glob("*.ckpt"))


@pytest.fixture(scope="module")
def motorway() -> Recording:
    (recording,) = load_recordings(ROOT / "resource/recordings/highway", "highd")
    return recording


def test_the_default_is_shipped_with_its_checkpoint_and_a_model_that_uses_lanes():
    assert SHIPPED == ["default", "road"]
    assert [name for name in SHIPPED if load_task(find_model(name)).scene.uses_lanes] == ["road"]
    assert CHECKPOINTS == ["default"]
    assert [path.stem for path in RECIPES] == ["default", "own_recordings", "road"]


@pytest.mark.parametrize("recipe", RECIPES, ids=lambda path: path.stem)
def test_a_recipe_builds_its_network(recipe: Path):
    config = load_config(recipe)
    assert config.name == recipe.stem
    network = build_network(config.network, config.model, config.history, config.scene)
    assert sum(p.numel() for p in network.parameters()) > 10_000
    used = [*config.data.train, *config.data.validation, *config.data.test]
    assert len(used) == len(set(used)), "a recording has two uses"
    assert config.licence
    assert config.attribution


@pytest.mark.parametrize("name", SHIPPED)
def test_a_model_is_small_and_carries_its_description(name: str):
    path = find_model(name)
    assert path.stat().st_size < 5e6
    task = load_task(path)
    assert task.name == name
    assert task.training["licence"]
    assert "NGSIM" in task.training["attribution"]
    uses = {"train": set(), "validation": set(), "test": set(), "calibration": set()}
    for recording in task.training["recordings"]:
        uses[recording["split"]].add(recording["sha256"])
    assert uses["train"]
    assert uses["validation"]
    assert uses["test"]
    assert not uses["train"] & (uses["validation"] | uses["test"])
    assert not uses["calibration"] & uses["test"]
    assert uses["calibration"] or name != "default"
    card = model_card(path)
    assert card is not None
    assert card.startswith(f"# Model card: `{name}`")


@pytest.mark.parametrize("name", CHECKPOINTS)
def test_a_checkpoint_is_small_and_has_the_weights_of_its_model(name: str):
    path = find_checkpoint(name)
    assert path.stat().st_size < 2e6
    checkpoint, task = load_checkpoint(path), load_task(find_model(name))
    assert weights_hash(load_model(checkpoint)) == task.weights_sha256
    assert own_calibration(checkpoint) == task.calibration
    assert checkpoint["config"]["name"] == name


@pytest.mark.parametrize("name", SHIPPED)
def test_a_model_matches_its_recipe(name: str):
    config = load_config(ROOT / "config/training" / f"{name}.yaml")
    task = load_task(find_model(name))
    assert task.scene == config.scene
    assert task.history == config.history
    for use in ("train", "validation"):
        found = {
            f"{r['source']}/{r['name']}" for r in task.training["recordings"] if r["split"] == use
        }
        # The file of a model that starts from another one's weights names those recordings, too.
        own = set(getattr(config.data, use))
        assert found == own if name == "default" else found > own


def test_the_default_beats_kinematic_baselines_on_the_shipped_recording(motorway: Recording):
    table = evaluate(
        {"default": ModelRunner.load(find_model("default"))},
        [motorway],
        stride_s=4.0,
        centre=False,
    )
    scores = {model: protocols["all"] for model, protocols in table.items()}
    best_baseline = min(scores[baseline]["ade"] for baseline in ("cv", "ca", "ctrv"))
    assert scores["default"]["ade"] < best_baseline
    assert 0.8 < scores["default"]["coverage_90"] <= 1.0
    assert np.isfinite(scores["default"]["anll"])


def test_road_uses_its_lanes_and_runs_without(motorway: Recording):
    runner = ModelRunner.load(find_model("road"))
    instant = motorway.stamp_ns(50)  # after 2 s, when hardly a trail is known
    (window,) = replay(motorway, runner.task.history, [instant])
    given = {}
    for name, lanes in (("lanes", motorway.lanes), ("none", ())):
        predictor = make_predictor(runner, motorway)
        predictor.lanes = LaneMap(lanes)
        given[name] = predictor.predict(window)
        assert (given[name].source == Source.MODEL).sum() >= 5
        assert np.isfinite(given[name].mean).all()
    moved = given["lanes"].mean[..., :2] - given["none"].mean[..., :2]
    assert np.linalg.norm(moved, axis=-1).max() > 0.1


def test_predictions_of_the_default_turn_and_move_with_the_world(motorway: Recording):
    runner = ModelRunner.load(find_model("default"))
    pose = Pose2(4e5, 5e6, -0.7)
    plain, turned = TrackHistory(runner.task.history), TrackHistory(runner.task.history)
    # Each in a graph of its own: which agents cover the others may hang on the last digit.
    options = PredictorOptions(policy="each")
    here, there = (ScenePredictor(runner, options=options) for _ in range(2))
    for states in itertools.islice(motorway.states(), 0, 200, 5):  # 8 s at 5 Hz, with trails
        plain.update(states)
        turned.update(to_fixed_frame(states, pose, "utm"))
        for history, predictor in ((plain, here), (turned, there)):
            predictor.observe(history.window())
    expected = to_frame(here.predict(plain.window()), pose, "utm")
    given = there.predict(turned.window())
    assert (given.source == Source.MODEL).sum() >= 5
    np.testing.assert_array_equal(given.key, expected.key)
    np.testing.assert_allclose(given.mean, expected.mean, rtol=0.0, atol=1e-3)
    np.testing.assert_allclose(given.covariance, expected.covariance, rtol=1e-3, atol=1e-4)
    np.testing.assert_allclose(given.weight, expected.weight, atol=1e-4)


@pytest.mark.parametrize("other", [AgentClass.PEDESTRIAN, AgentClass.UNKNOWN])
def test_the_predictions_of_the_default_depend_on_the_class(
    motorway: Recording, other: AgentClass
):
    runner = ModelRunner.load(find_model("default"))
    predictor = make_predictor(runner, motorway)
    (window,) = replay(motorway, runner.task.history, [motorway.stamp_ns(200)])  # after 8 s
    cars = window.agent_class == AgentClass.CAR
    relabelled = dataclasses.replace(
        window, agent_class=np.where(cars, other, window.agent_class).astype(np.uint8)
    )
    before, after = predictor.predict(window), predictor.predict(relabelled)
    assert (before.key == after.key).all()
    served = (before.source == Source.MODEL) & (after.source == Source.MODEL)
    served &= before.agent_class == AgentClass.CAR
    served &= (
        np.hypot(before.initial[:, 2], before.initial[:, 3]) > 1.0
    )  # standing ones may be held
    assert served.sum() >= 5
    # The best guess: modes may change places, and rules of the output move few agents only.
    difference = before.mean[served, 0, :, :2] - after.mean[served, 0, :, :2]
    assert np.isfinite(difference).all()
    moved_m = np.linalg.norm(difference, axis=-1).max(axis=-1)
    assert (moved_m > 0.01).mean() > 0.8


def test_the_default_is_calibrated_on_the_sites_that_the_cross_validation_left_out():
    config = load_config(ROOT / "config/training/default.yaml")
    task = load_task(find_model("default"))
    calibration = task.calibration
    assert calibration.left_out
    assert calibration.horizon_steps == task.horizon_steps
    left_out = {site for sites in config.crossval.folds.values() for site in sites}
    assert {site.name for site in calibration.sites} == left_out
    assert all(site.agents > 0 for site in calibration.sites)
    groups = {group.name: group for group in calibration.groups}
    for name in ("vehicle_moving", "pedestrian_moving", "any_moving"):
        assert groups[name].sites >= 2, name


def test_the_pages_state_the_range_of_the_factors_of_the_default():
    table = load_task(find_model("default")).calibration.factor_table
    low, high = f"{table.min():.1f}", f"{table.max():.1f}"
    card = (ROOT / "resource/weights/default.md").read_text(encoding="utf-8")
    assert f"class group and motion ({low} to {high})" in card
    page = (ROOT / "docs/shipped_models.md").read_text(encoding="utf-8")
    assert f"the factors of the shipped file are between {low} and {high}" in page


def test_the_default_states_its_coverage_at_home_and_on_left_out_sites():
    metrics = load_task(find_model("default")).metrics
    for use in ("validation", "left-out sites"):
        shares = moving_coverage(metrics[use]["model"]["all"])
        assert list(shares) == [1.0, 3.0, 5.0], use
        assert all(share is not None and 0.0 < share < 1.0 for share in shares.values()), use
    assert check_coverage(metrics["validation"]) == ""
