# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Export of checkpoints, and the exported file in the node's runner."""

import argparse
import dataclasses
import zipfile

import numpy as np
import pytest
import torch
from traffic import braking_cars, cut_windows, turning_cars

from models.mtp_go import MTPGO
from models.mtp_go_config import ModelConfig
from mtpgo_core.errors import ConfigurationError, ModelFileError
from mtpgo_core.prediction.model_runner import ModelRunner, load_task
from mtpgo_core.scene.scene_builder import build_scenes
from mtpgo_core.scene.trails.trail_context import TrailContext
from mtpgo_core.task.model_file import content_sha256, read_model
from mtpgo_core.task.task_description import HistoryConfig, SceneConfig, TaskDescription
from mtpgo_training import cli
from mtpgo_training.commands import evaluate as evaluation
from mtpgo_training.commands import info as info_command
from mtpgo_training.export import exporter as export
from mtpgo_training.scenes.recorded_trails import recorded_trails
from mtpgo_training.scenes.track_samples import SampleTable, take_in
from mtpgo_training.training.networks import build_network
from mtpgo_training.training.run_folder import RunFolder
from mtpgo_training.training.training_config import TrainingConfig

OPTIONS = {"hidden": 12, "modes": 3, "horizon_steps": 8, "ode_hidden": 4}
CONFIG = TrainingConfig(
    name="tiny",
    scene=SceneConfig(max_neighbours=3),
    model=OPTIONS,
    licence="free",
    attribution="nobody",
)
RECORDINGS = [
    {"name": "01", "source": "cars", "layout": "ind", "sha256": "ab", "split": "train"},
    {"name": "02", "source": "cars", "layout": "ind", "sha256": "cd", "split": "test"},
]


@pytest.fixture(scope="module")
def model():
    torch.manual_seed(4)
    network = MTPGO(ModelConfig(**OPTIONS))
    with torch.no_grad():  # away from constant velocity, where errors would not show
        for value in network.parameters():
            value.add_(0.05 * torch.randn_like(value))
    return network.eval()


@pytest.fixture(scope="module")
def run_folder(model, tmp_path_factory):
    folder = RunFolder(tmp_path_factory.mktemp("run"))
    checkpoint = {
        "config": dataclasses.asdict(CONFIG),
        "model_config": model.config.to_dict(),
        "average": model.state_dict(),
        "covariance_scale": 1.3,
        "epoch": 3,
        "step": 40,
        "metrics": {"model": {"all": {"ade": 0.5, "n": 7, "fnll": None}}},
        "splits": RECORDINGS,
    }
    folder.save(checkpoint, best=True)
    return folder


@pytest.fixture(scope="module")
def model_file(run_folder, tmp_path_factory):
    path = tmp_path_factory.mktemp("model") / "tiny.pt"
    assert cli.main(["export", str(run_folder.path), "-o", str(path)]) == 0
    return path


def test_the_file_contains_the_task_description(model_file, model):
    task = load_task(model_file)
    assert task.name == "tiny"
    assert task.scene == CONFIG.scene
    assert task.history == CONFIG.history
    assert task.states == ("x", "y", "vx", "vy")
    assert (task.modes, task.horizon_steps) == (3, 8)
    assert task.training["recordings"] == RECORDINGS
    assert task.training["licence"] == "free"
    assert task.metrics["validation"]["model"]["all"]["ade"] == 0.5
    assert task.model["hidden"] == 12
    assert task.weights_sha256 == export.weights_hash(model)
    assert len(task.weights_sha256) == 64
    assert task.content_sha256 == content_sha256(read_model(model_file).archive.records())


@pytest.mark.parametrize(
    ("ending", "change"),
    [
        ("task.json", lambda text: text.replace(b'"weights_sha256": "', b'"weights_sha256": "0')),
        ("task.json", lambda text: text.replace(b"free", b"mine")),
        ("constants/3", lambda values: bytes([values[0] ^ 1]) + values[1:]),
        (".py", lambda code: code.replace(b"torch.mul", b"torch.add", 1)),
    ],
    ids=["hash", "licence", "weights", "code"],
)
def test_a_file_that_was_changed_after_the_export_is_refused(model_file, tmp_path, ending, change):
    path = tmp_path / "forged.pt"
    with zipfile.ZipFile(model_file) as old, zipfile.ZipFile(path, "w") as new:
        for info in old.infolist():
            content = old.read(info)
            changed = change(content) if info.filename.endswith(ending) else content
            new.writestr(info, changed)
    with pytest.raises(ModelFileError, match=r"forged\.pt is not what was exported"):
        load_task(path)


def test_the_runner_computes_what_the_eager_model_computes(model_file, model):
    recording = braking_cars(seconds=4.0)
    window = cut_windows(recording, HistoryConfig(), 0.2)[-1].window
    batch = build_scenes(window, CONFIG.scene)
    prediction = ModelRunner.load(model_file).predict(window, batch)
    assert_predicts_as(model, batch, prediction, scale=1.3)


def test_the_runner_gives_the_model_its_trails_and_sizes(tmp_path):
    scene = SceneConfig(max_neighbours=3, sizes=True, trails=True)
    history, path = HistoryConfig(), tmp_path / "m.pt"
    options = {**OPTIONS, "static_features": True, "static_inputs": "all", "hold_standing": True}
    torch.manual_seed(4)
    model = build_network("mtp-go", options, history, scene)
    with torch.no_grad():
        for value in model.parameters():
            value.add_(0.05 * torch.randn_like(value))
    export.export_model(model, TaskDescription(scene=scene), path)
    assert load_task(path).scene == scene
    recording = turning_cars(tracks=8)
    window = cut_windows(recording, history, 4.0)[-4].window
    memory = recorded_trails(recording, SampleTable(take_in(recording, history), history))
    batch = build_scenes(window, scene, trails=TrailContext(memory, 8, history.dt_s))
    assert (batch.trails[..., 2] > 0.0).any()
    runner = ModelRunner.load(path)
    prediction = runner.predict(window, batch)
    assert_predicts_as(model, batch, prediction)
    none = dataclasses.replace(batch, trails=np.zeros_like(batch.trails))
    assert np.nanmax(np.abs(runner.predict(window, none).mean - prediction.mean)) > 1e-3


def test_a_network_with_trails_is_not_exported_for_a_task_without_them(tmp_path):
    network = build_network("mtp-go", OPTIONS, HistoryConfig(), SceneConfig(trails=True))
    with pytest.raises(ModelFileError, match=r"does not run on the input .* given no trails"):
        export.export_model(network, TaskDescription(scene=SceneConfig()), tmp_path / "m.pt")
    assert list(tmp_path.iterdir()) == []


def test_the_file_says_how_far_apart_the_modes_are_at_least(tmp_path):
    options = OPTIONS | {"least_mode_spread": 0.5}
    network = build_network("mtp-go", options, HistoryConfig(), SceneConfig())
    plain, spread = TaskDescription(), tmp_path / "spread.pt"
    assert plain.least_mode_spread == 0.0
    assert export.export_model(network, plain, spread).least_mode_spread == 0.5
    assert load_task(spread).least_mode_spread == 0.5


def assert_predicts_as(model, batch, prediction, scale=1.0):
    """Compare the runner's prediction with the eager model's on the same scenes."""
    given = [torch.from_numpy(x) for x in (batch.features, batch.valid, batch.static)]
    trails = None if batch.trails is None else torch.from_numpy(batch.trails)
    with torch.no_grad():
        log_weight, mean, covariance = model(*given, None, trails)
    for b, i in zip(*np.nonzero(batch.primary), strict=True):
        row = batch.agent[b, i]
        order = np.argsort(-log_weight[b, i].numpy(), kind="stable")
        c, s = np.cos(batch.rotation[b]), np.sin(batch.rotation[b])
        turn = np.array([[c, -s], [s, c]])
        expected = mean[b, i].numpy()[order][..., :2] @ turn.T + batch.origin[b]
        np.testing.assert_allclose(prediction.mean[row][..., :2], expected, atol=1e-4)
        spread = scale * turn @ covariance[b, i].numpy()[order][..., :2, :2] @ turn.T
        np.testing.assert_allclose(prediction.covariance[row], spread, atol=1e-4, rtol=1e-3)


def test_info_shows_data_licence_and_metrics(model_file, capsys):
    assert info_command.run(argparse.Namespace(model=str(model_file))) == 0
    text = capsys.readouterr().out
    for expected in ("tiny", "cars/01", "cars/02", "nobody", "free", "ade 0.500", "cos_yaw"):
        assert expected in text
    assert "fnll" not in text


def other_run(run_folder, path, seed, ade, validation):
    """Write the run's checkpoint with another seed, validation ADE and validation recording."""
    checkpoint = torch.load(run_folder.best, weights_only=True)
    checkpoint["config"]["seed"] = seed
    checkpoint["metrics"]["model"]["all"]["ade"] = ade
    entry = {"name": validation, "source": "cars", "layout": "ind", "sha256": validation * 2}
    checkpoint["splits"] = [*RECORDINGS, {**entry, "split": "validation"}]
    folder = RunFolder(path)
    folder.save(checkpoint, best=True)
    return str(folder.path)


def test_of_several_runs_the_best_by_validation_is_exported(run_folder, tmp_path, capsys):
    runs = [
        other_run(run_folder, tmp_path / f"seed{seed}", seed, ade, "03")
        for seed, ade in ((1, 0.5), (2, 0.4), (3, 0.6))
    ]
    output = tmp_path / "chosen.pt"
    assert cli.main(["export", *runs, "-o", str(output)]) == 0
    text = capsys.readouterr().out
    assert f"candidate  {runs[1]}: validation ADE 0.400 m, chosen" in text
    assert "from 3 runs by validation ADE: 0.500 m (seed 1), 0.400 m (seed 2), 0.600 m" in text
    training = load_task(output).training
    assert training["configuration"]["seed"] == 2
    assert training["chosen_from"] == [
        {"seed": 1, "validation_ade_m": 0.5},
        {"seed": 2, "validation_ade_m": 0.4},
        {"seed": 3, "validation_ade_m": 0.6},
    ]


def test_runs_validated_on_different_recordings_are_not_compared(run_folder, tmp_path, capsys):
    one = other_run(run_folder, tmp_path / "one", 1, 0.5, "03")
    two = other_run(run_folder, tmp_path / "two", 1, 0.4, "04")
    assert cli.main(["export", one, two, "-o", str(tmp_path / "x.pt")]) == 2
    error = capsys.readouterr().err
    assert f"{two} was validated on 04 and {one} on 03, expected the same recordings" in error
    assert not (tmp_path / "x.pt").exists()


def test_a_run_without_a_validation_is_not_compared(run_folder, tmp_path, capsys):
    runs = [other_run(run_folder, tmp_path / name, 1, 0.5, "03") for name in ("one", "two")]
    path = RunFolder(tmp_path / "two").best
    torch.save({**torch.load(path, weights_only=True), "metrics": {}}, path)
    assert cli.main(["export", *runs, "-o", str(tmp_path / "x.pt")]) == 2
    assert f"{runs[1]} has not been validated yet, expected runs" in capsys.readouterr().err
    assert not (tmp_path / "x.pt").exists()


def test_a_checkpoint_of_another_architecture_gives_a_one_line_error(run_folder, tmp_path):
    checkpoint = torch.load(run_folder.best, weights_only=True)
    checkpoint["model_config"]["hidden"] = 16
    with pytest.raises(ConfigurationError, match="does not fit") as caught:
        export.load_model(checkpoint)
    assert "\n" not in str(caught.value)


def test_an_export_that_differs_from_the_eager_model_is_not_written(model, tmp_path, monkeypatch):
    path = tmp_path / "m.pt"
    monkeypatch.setattr(export, "LARGEST_DIFFERENCE_M", -1.0)
    with pytest.raises(ModelFileError, match="differs from the eager one"):
        export.export_model(model, export.TaskDescription(scene=CONFIG.scene), path)
    assert list(tmp_path.iterdir()) == []


def test_an_ego_policy_is_refused_offline(model_file):
    arguments = argparse.ArgumentParser()
    evaluation.add_parser(arguments.add_subparsers())
    args = arguments.parse_args(
        [
            "evaluate",
            "--model",
            str(model_file),
            "--data",
            ".",
            "--layout",
            "ind",
            "--policy",
            "ego",
        ]
    )
    with pytest.raises(ConfigurationError, match="no ego"):
        args.run(args)
