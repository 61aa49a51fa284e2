# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Every network by its name: from options to the file that the node runs."""

import argparse
import dataclasses
import os

import numpy as np
import pytest
import torch
from traffic import braking_cars

from models.network_config import NetworkConfig
from mtpgo_core.errors import ConfigurationError
from mtpgo_core.prediction.model_runner import ModelRunner, load_task
from mtpgo_core.scene.trails.trail_branches import BRANCHES
from mtpgo_core.task.task_description import HistoryConfig, SceneConfig, TaskDescription
from mtpgo_training import cli
from mtpgo_training.commands import info as info_command
from mtpgo_training.data.splits import NamedRecording
from mtpgo_training.evaluation.evaluator import evaluate
from mtpgo_training.export import exporter as export
from mtpgo_training.training.loop.trained_parts import calibrated_parts
from mtpgo_training.training.networks import (
    NETWORKS,
    build_network,
    name_of,
    network_config,
    options_for,
    rebuild,
)
from mtpgo_training.training.run_folder import RunFolder, load_checkpoint
from mtpgo_training.training.trainer import train
from mtpgo_training.training.training_config import DataConfig, OptimisationConfig, TrainingConfig

HISTORY, SCENE = HistoryConfig(), SceneConfig(max_neighbours=3, context="polar")
OPTIONS = {"hidden": 12, "modes": 3, "horizon_steps": 8}
ALL = pytest.mark.parametrize("name", NETWORKS)


def build(name, **options):
    torch.manual_seed(2)
    model = build_network(name, {**OPTIONS, **options}, HISTORY, SCENE)
    with torch.no_grad():  # away from constant velocity, where every mistake would look the same
        for value in model.parameters():
            value.add_(0.05 * torch.randn_like(value))
    return model.eval()


@ALL
def test_sizes_follow_from_the_task(name):
    scene = SceneConfig(context="polar", classes=("car",))
    config = network_config(name, OPTIONS, HISTORY, scene)
    assert (config.feature_size, config.static_size, config.history_steps) == (11, 1, 16)
    assert (config.hidden, config.modes, config.horizon_steps) == (12, 3, 8)


@ALL
def test_sizes_are_static_features_and_trails_belong_to_mtp_go(name):
    scene = SceneConfig(sizes=True, trails=True)
    config = network_config(name, OPTIONS, HISTORY, scene)
    assert config.static_size == len(scene.classes) + 3
    assert getattr(config, "trail_branches", 0) == (BRANCHES if name == "mtp-go" else 0)


@ALL
def test_the_paper_s_angles_reach_every_network_that_reads_the_yaw(name):
    scene = SceneConfig(context="polar", angles="radians")
    options = {**OPTIONS, "agent_frame": False}
    config = network_config(name, options, HISTORY, scene)
    assert config.feature_size == 9
    assert name == "mtp-go" or config.yaw_as_angle
    assert not getattr(network_config(name, OPTIONS, HISTORY, SCENE), "yaw_as_angle", False)


def test_a_task_without_trails_gives_a_network_without_them():
    config = network_config("mtp-go", {**OPTIONS, "trail_branches": 2}, HISTORY, SCENE)
    assert config.trail_branches == 0


@ALL
def test_a_network_knows_its_name_and_is_rebuilt_from_its_options(name):
    model = build(name)
    assert name_of(model) == name
    again = rebuild(name, model.config.to_dict())
    again.load_state_dict(model.state_dict())
    assert again.config == model.config
    assert type(again) is type(model)


def test_an_unknown_network_is_answered_by_the_known_ones():
    with pytest.raises(ConfigurationError) as error:
        build_network("lstm", {}, HISTORY, SCENE)
    assert str(error.value) == (
        "network is 'lstm', expected one of 'mtp-go', 'seq2seq', 's-lstm', 'cs-lstm', "
        "'gnn-rnn', 'mmtransformer', 'trajectron++'"
    )


@pytest.mark.parametrize("option", ["integrator", "hiden"])
def test_an_option_that_a_network_does_not_know_is_named(option):
    with pytest.raises(ConfigurationError, match=f"unknown field '{option}', expected"):
        build_network("seq2seq", {option: 1}, HISTORY, SCENE)


def test_one_configuration_serves_all_networks():
    """Options of other networks are left out; one that no network has is kept and refused."""
    options = {"hidden": 48, "integrator": "heun", "observation_std_m": 0.2, "rows": 7}
    assert options_for("mtp-go", options) == {k: v for k, v in options.items() if k != "rows"}
    assert options_for("seq2seq", options) == {"hidden": 48, "observation_std_m": 0.2}
    assert options_for("s-lstm", options) == {
        "hidden": 48,
        "observation_std_m": 0.2,
        "rows": 7,
    }
    assert options_for("gnn-rnn", {"hiden": 3}) == {"hiden": 3}


@pytest.fixture(scope="module", params=[n for n in NETWORKS if n != "mtp-go"])
def exported(request, tmp_path_factory):
    """Name, network and file of each baseline, exported from a checkpoint."""
    name, place = request.param, tmp_path_factory.mktemp("run")
    model = build(name, observation_std_m=0.2)
    config = TrainingConfig(name="rival", scene=SCENE, model=OPTIONS)
    checkpoint = {
        "config": dataclasses.asdict(config),
        "network": name,
        "model_config": model.config.to_dict(),
        "average": model.state_dict(),
        "covariance_scale": 1.4,
        "epoch": 1,
        "step": 1,
        "metrics": {},
        "splits": [],
    }
    folder = RunFolder(place)
    folder.save(checkpoint, best=True)
    path = place / "rival.pt"
    assert cli.main(["export", str(folder.path), "-o", str(path)]) == 0
    return name, model, path


def test_the_file_says_which_network_it_is(exported, capsys):
    name, model, path = exported
    task = load_task(path)
    assert task.model["network"] == name
    assert task.states == ("x", "y")
    assert (task.modes, task.horizon_steps) == (3, 8)
    assert task.weights_sha256 == export.weights_hash(model)
    assert info_command.run(argparse.Namespace(model=str(path))) == 0
    assert f"network    {name}" in capsys.readouterr().out


def test_the_file_is_evaluated_as_any_model_on_the_nodes_path(exported):
    _, _, path = exported
    recording = braking_cars(seconds=5.0, tracks=5)
    models = evaluate({"rival": ModelRunner.load(path)}, [recording], stride_s=1.0)
    assert models["rival"]["all"]["n"] == models["cv"]["all"]["n"] > 0
    for key in ("ade", "fde", "anll", "min_ade", "coverage_90"):
        assert np.isfinite(models["rival"]["all"][key])


def test_a_checkpoint_of_another_network_is_one_sentence(exported):
    name, model, _ = exported
    other = "mtp-go" if name == "seq2seq" else "seq2seq"
    checkpoint = {"network": other, "model_config": model.config.to_dict()}
    with pytest.raises(ConfigurationError) as error:
        export.load_model({**checkpoint, "average": model.state_dict()})
    assert "does not fit" in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("name", ["s-lstm", "gnn-rnn"])
def test_a_baseline_is_trained_by_the_same_trainer(name, tmp_path):
    """Through both losses: it comes near the truth that constant velocity misses."""
    config = TrainingConfig(
        network=name,
        num_threads=int(os.environ["OMP_NUM_THREADS"]),
        data=DataConfig(validation=("03",), validation_stride_s=1.0, stride_s=0.4),
        scene=SceneConfig(max_neighbours=3),
        model={**OPTIONS, "modes": 2},
        optimisation=OptimisationConfig(
            epochs=6, batch_scenes=8, learning_rate=1e-2, warmup_steps=5, teacher_forcing=0.3
        ),
    )
    recordings = [
        NamedRecording("cars", braking_cars(f"{seed:02d}", seed=seed, tracks=8, seconds=5.0))
        for seed in (1, 3)
    ]
    folder = RunFolder(tmp_path / "run")
    train(config, recordings, folder)
    checkpoint = load_checkpoint(folder.path)
    assert checkpoint["network"] == name
    assert name_of(export.load_model(checkpoint)) == name
    scores = checkpoint["metrics"]
    assert scores["model"]["all"]["ade"] < 0.6 * scores["cv"]["all"]["ade"]


@ALL
def test_every_network_has_covariances_to_train_alone(name):
    """What the last epochs of a recipe train: of the baselines the noise."""
    own = ["initial_covariance"] if name == "mtp-go" else []
    assert calibrated_parts(build(name)) == ["noise", *own]


def test_without_its_filter_mtp_go_has_the_noise_to_train_alone():
    assert calibrated_parts(build("mtp-go", ekf=False)) == ["noise"]


@pytest.mark.parametrize("name", ["modes", "horizon_steps"])
def test_a_network_has_no_more_than_a_model_file_may_have(name):
    """It would be trained first, and refused by the export."""
    limits = [
        {field.name: field for field in dataclasses.fields(kind)}[name].metadata["limits"]
        for kind in (NetworkConfig, TaskDescription)
    ]
    assert limits[0].high == limits[1].high
    assert limits[0].low == limits[1].low
