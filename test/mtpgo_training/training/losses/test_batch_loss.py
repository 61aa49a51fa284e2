# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The loss of one batch, and the validation with its calibration of the covariances."""

import copy
import functools

import pytest
import torch
from torch_geometric.loader import DataLoader
from traffic import braking_cars, turning_cars

from mtpgo_core.prediction.model_runner import ModelRunner
from mtpgo_core.scene.scene_builder import build_scenes
from mtpgo_core.task.task_description import HistoryConfig, SceneConfig, TaskDescription
from mtpgo_training.calibration.calibration_fit import fit_calibration
from mtpgo_training.evaluation.evaluator import evaluate
from mtpgo_training.export.exporter import export_model
from mtpgo_training.scenes.prepared_recording import prepare
from mtpgo_training.scenes.scene_dataset import dense, validation_scenes
from mtpgo_training.training.losses import gradient_accumulation
from mtpgo_training.training.losses.batch_loss import batch_loss, training_loss
from mtpgo_training.training.losses.huber_terms import HuberTerms
from mtpgo_training.training.losses.likelihood_loss import (
    negative_log_likelihood,
    trajectory_likelihood_loss,
)
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
            return float(training_loss(model, batches[2], LossWeights(1, ewta, nll)))

    assert loss(0.3, 0.7) == pytest.approx(0.3 * loss(1.0, 0.0) + 0.7 * loss(0.0, 1.0), rel=1e-4)


def test_the_first_phase_leaves_the_covariance_alone(model, batches):
    model.zero_grad(set_to_none=True)
    training_loss(model, batches[2], LossWeights(2, 1.0, 0.0)).backward()
    touched = {n.split(".")[0] for n, p in model.named_parameters() if p.grad is not None}
    assert "noise" not in touched
    assert {"encoder", "decoder", "control"} <= touched


def test_with_teacher_forcing_the_roll_out_sees_the_observed_states(model, batches):
    model = copy.deepcopy(model)  # an untrained one moves on almost regardless of what it sees
    torch.manual_seed(1)
    with torch.no_grad():
        for weights in model.parameters():
            weights += 0.3 * torch.randn_like(weights)
    fields, aim = {**batches[2]}, LossWeights(1, 0.0, 1.0)
    fields["weight"] = fields["weight"].clone()
    fields["weight"][..., 3] = 0.0  # not observed: the next step sees what was predicted
    target, observed = fields["target"][..., : model.config.state_size], fields["weight"] > 0.0
    with torch.no_grad():
        forced = training_loss(model, fields, aim, teacher_forcing=True)
        free = training_loss(model, fields, aim)
        output = model.roll_out(
            fields["x"],
            fields["valid"],
            fields["static"],
            initial_covariance=None,
            with_covariance=True,
            teacher=target,
            teacher_valid=observed,
            trails=None,
        )
        expected = negative_log_likelihood(*output, target, fields["weight"])
    torch.testing.assert_close(forced, expected)
    assert abs(float(forced - free)) > 0.001


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


@pytest.fixture(scope="module")
def on_trails():
    """A network that takes trails and sizes, and a batch in which earlier cars left trails."""
    scene = SceneConfig(max_neighbours=3, sizes=True, trails=True)
    data = DataConfig(validation_stride_s=4.0)
    source = prepare(turning_cars(tracks=8), HISTORY, scene, data, training=False)
    scenes = validation_scenes([source], HISTORY, scene, H)
    torch.manual_seed(0)
    options = {**OPTIONS, "static_features": True, "static_inputs": "all", "hold_standing": True}
    network = build_network("mtp-go", options, HISTORY, scene)
    return network, next(iter(DataLoader(scenes, batch_size=64)))


def test_the_network_gets_the_trails_and_sizes_of_the_scenes(on_trails):
    network, batch = on_trails
    fields = dense(batch)
    assert (fields["trails"][..., 2] > 0.0).any()
    assert fields["static"].shape[-1] == 8 + 3
    known = fields["valid"][..., -1]
    expected = torch.tensor([0.45, 1.9 / 3.0, 1.0]).expand(int(known.sum()), 3)
    torch.testing.assert_close(fields["static"][known][:, 8:], expected)
    aim = LossWeights(1, 0.0, 1.0)
    with torch.no_grad():
        value = training_loss(network, fields, aim)
        output = network(fields["x"], fields["valid"], fields["static"], None, fields["trails"])
        expected = negative_log_likelihood(*output, fields["target"], fields["weight"])
        none = {**fields, "trails": torch.zeros_like(fields["trails"])}
        torch.testing.assert_close(value, expected)
        assert not torch.equal(training_loss(network, none, aim), value)


def test_the_loss_of_a_batch_is_that_of_its_micro_batches_with_trails(on_trails, monkeypatch):
    network, batch = on_trails
    monkeypatch.setattr(gradient_accumulation, "MICRO_BATCH_AGENTS", 10)
    monkeypatch.setattr(gradient_accumulation, "MIN_MICRO_BATCH_AGENTS", 5)
    assert len(gradient_accumulation.micro_batches(batch)) > 1
    likelihood = functools.partial(trajectory_likelihood_loss, correlated_steps=5.0)
    aim = LossWeights(1, 0.5, 0.5)
    options = {"huber": HuberTerms(mean_weight=0.5), "likelihood": likelihood}
    whole = training_loss(network, dense(batch), aim, **options)
    parts = batch_loss(network, batch, aim, **options)
    torch.testing.assert_close(parts, whole, rtol=1e-5, atol=1e-6)


def test_no_tensor_with_trails_is_left_on_the_cpu(on_trails):
    network, batch = on_trails
    fields = {key: value.to("meta") for key, value in dense(batch).items()}
    likelihood = functools.partial(trajectory_likelihood_loss, correlated_steps=5.0)
    loss = training_loss(
        copy.deepcopy(network).to("meta"),
        fields,
        LossWeights(1, 0.3, 0.7),
        likelihood=likelihood,
    )
    loss.backward()
    assert loss.device.type == "meta"


def test_the_validation_gives_the_network_its_trails(on_trails):
    network, batch = on_trails
    fields = dense(batch)
    scores = validate(network, [fields])[0].averages()
    none = {**fields, "trails": torch.zeros_like(fields["trails"])}
    without = validate(network, [none])[0].averages()
    assert scores["model"]["all"]["n"] == without["model"]["all"]["n"] > 0
    assert scores["model"]["all"]["anll"] != without["model"]["all"]["anll"]


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
        network, fields, aim, huber=HuberTerms(mean_weight=1.0), teacher_forcing=True
    )
    loss.backward()
    assert loss.device.type == "meta"
