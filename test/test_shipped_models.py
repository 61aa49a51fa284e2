# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The shipped models load by name, carry their description and beat kinematic baselines."""

from pathlib import Path

import numpy as np
import pytest

from mtpgo_core.prediction.model_runner import ModelRunner
from mtpgo_core.task.model_file import find_checkpoint, find_model, load_task, model_card
from mtpgo_training.data.readers import load_recordings
from mtpgo_training.evaluation.evaluator import evaluate
from mtpgo_training.export.exporter import load_model
from mtpgo_training.export.model_calibration import own_calibration
from mtpgo_training.training.networks import build_network, weights_hash
from mtpgo_training.training.run_folder import load_checkpoint
from mtpgo_training.training.training_config import load_config

ROOT = Path(__file__).parents[1]
RECIPES = sorted((ROOT / "config/training").glob("*.yaml"))
SHIPPED = sorted(path.stem for path in (ROOT / "resource/weights").glob("*.pt"))
CHECKPOINTS = sorted(path.stem for path in (ROOT / "resource/weights").glob("*.ckpt"))


def test_the_documented_models_are_shipped():
    assert {"default", "highway", "urban"} <= set(SHIPPED)


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
    uses = {"train": set(), "validation": set(), "test": set()}
    for recording in task.training["recordings"]:
        uses[recording["split"]].add(recording["sha256"])
    assert uses["train"]
    assert uses["validation"]
    assert uses["test"]
    assert not uses["train"] & (uses["validation"] | uses["test"])
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
        assert found == set(getattr(config.data, use))


@pytest.mark.parametrize(
    ("name", "baselines"),
    [
        ("default", ("cv", "ca", "ctrv")),
        ("highway", ("cv", "ca", "ctrv")),
        ("urban", ("cv", "ctrv")),  # worse than ca on motorways, see its model card
    ],
)
def test_a_model_beats_kinematic_baselines_on_the_shipped_recording(name, baselines):
    (recording,) = load_recordings(ROOT / "resource/recordings/highway", "highd")
    table = evaluate(
        {name: ModelRunner.load(find_model(name))}, [recording], stride_s=4.0, centre=False
    )
    scores = {model: protocols["all"] for model, protocols in table.items()}
    best_baseline = min(scores[baseline]["ade"] for baseline in baselines)
    assert scores[name]["ade"] < 0.9 * best_baseline
    assert 0.8 < scores[name]["coverage_90"] <= 1.0
    assert np.isfinite(scores[name]["anll"])
