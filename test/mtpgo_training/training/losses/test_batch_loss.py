# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The loss of one batch, and the validation with its calibration of the covariances."""

import pytest
import torch
from torch_geometric.loader import DataLoader
from traffic import braking_cars

from mtpgo_core.prediction.model_runner import ModelRunner
from mtpgo_core.scene.scene_builder import build_scenes
from mtpgo_core.task.task_description import HistoryConfig, SceneConfig, TaskDescription
from mtpgo_training.calibration.calibration_fit import fit_calibration
from mtpgo_training.evaluation.evaluator import evaluate
from mtpgo_training.export.exporter import export_model
from mtpgo_training.scenes.prepared_recording import prepare
from mtpgo_training.scenes.scene_dataset import dense, validation_scenes
from mtpgo_training.training.losses.batch_loss import training_loss
from mtpgo_training.training.losses.schedules import LossWeights
from mtpgo_training.training.networks import NETWORKS, build_network
from mtpgo_training.training.training_config import DataConfig
from mtpgo_training.training.validation import validate

HISTORY, SCENE, H = HistoryConfig(), SceneConfig(max_neighbours=3), 8
OPTIONS = {"hidden": 8, "modes": 3, "horizon_steps": H, "ode_hidden": 4}


@pytest.fixture(scope="module")
def batches():
    source = prepare(braking_cars(), HISTORY, SCENE, DataConfig(), training=False)
    scenes = validation_scenes([source], HISTORY, SCENE, H)
    return [dense(batch) for batch in DataLoader(scenes, batch_size=16)]


@pytest.fixture(scope="module")
def model():
    torch.manual_seed(0)
    return build_network("mtp-go", OPTIONS, HISTORY, SCENE)


def test_a_blend_is_the_sum_of_its_parts(model, batches):
    def loss(ewta, nll):
        with torch.no_grad():
            return float(
                training_loss(model, batches[2], LossWeights(1, ewta, nll), huber_delta=1.0)
            )

    assert loss(0.3, 0.7) == pytest.approx(0.3 * loss(1.0, 0.0) + 0.7 * loss(0.0, 1.0), rel=1e-4)


def test_the_first_phase_leaves_the_covariance_alone(model, batches):
    model.zero_grad(set_to_none=True)
    training_loss(model, batches[2], LossWeights(2, 1.0, 0.0), huber_delta=1.0).backward()
    touched = {n.split(".")[0] for n, p in model.named_parameters() if p.grad is not None}
    assert "noise" not in touched
    assert {"encoder", "decoder", "control"} <= touched


def test_the_validation_scores_what_the_evaluation_scores(tmp_path):
    """The same graphs above all: both keep their centres from one instant to the next."""
    scene = SceneConfig(max_neighbours=3, radius_m=60.0)
    torch.manual_seed(0)
    network = build_network("mtp-go", OPTIONS, HISTORY, scene)
    export_model(network, TaskDescription(history=HISTORY, scene=scene), tmp_path / "model.pt")
    recording = braking_cars(tracks=24)
    runner = ModelRunner.load(tmp_path / "model.pt")
    table = evaluate({"model": runner}, [recording], stride_s=0.2, centre=False)
    offline = table["model"]["all"]
    data = DataConfig(validation_stride_s=0.2)
    source = prepare(recording, HISTORY, scene, data, training=False)
    kept = validation_scenes([source], HISTORY, scene, H)
    fresh = [build_scenes(tracked.window, scene) for tracked in source.windows]
    assert len(kept) != sum(len(batch.features) for batch in fresh), "no centre was kept"
    batches = [dense(batch) for batch in DataLoader(kept, batch_size=64)]
    online = validate(network, batches)[0].averages()["model"]["all"]
    assert online["n"] == offline["n"]
    for metric in ("ade", "anll", "min_ade", "coverage_90"):
        assert online[metric] == pytest.approx(offline[metric], rel=1e-4)


def test_a_calibration_brings_the_ellipses_to_their_level(model, batches):
    book, samples = validate(model, batches)
    calibration = fit_calibration(samples)
    again, _ = validate(model, batches, calibration)
    before, after = (scores.averages()["model"]["all"] for scores in (book, again))
    assert abs(before["coverage_90"] - 0.9) > 0.02
    assert after["coverage_90"] == pytest.approx(0.9, abs=0.03)
    assert before["ade"] == pytest.approx(after["ade"], rel=1e-5)


def test_an_untrained_model_scores_nearly_as_constant_velocity(model, batches):
    models = validate(model, batches)[0].averages()
    for protocol in ("all", "centre"):
        assert models["model"][protocol]["n"] == models["cv"][protocol]["n"]
        expected = models["cv"][protocol]["ade"]
        assert models["model"][protocol]["ade"] == pytest.approx(expected, rel=0.05)


@pytest.mark.parametrize("name", NETWORKS)
@pytest.mark.parametrize(
    "aim", [LossWeights(2, 1.0, 0.0), LossWeights(1, 0.3, 0.7)], ids=["E", "N"]
)
def test_nothing_is_left_on_the_cpu_when_training_is_elsewhere(batches, name, aim):
    """The device ``meta`` computes nothing, but refuses to be mixed with others, as a GPU does."""
    options = {"hidden": 8, "modes": 3, "horizon_steps": H}
    network = build_network(name, options, HISTORY, SCENE).to("meta")
    fields = {key: value.to("meta") for key, value in batches[0].items()}
    loss = training_loss(
        network, fields, aim, huber_delta=1.0, mean_weight=1.0, teacher_forcing=True
    )
    loss.backward()
    assert loss.device.type == "meta"
