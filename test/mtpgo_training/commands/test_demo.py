# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The demo with the real processes, on a generated recording and an untrained model."""

import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
import torch
from demo_traffic import make_recording

from models.mtp_go import MTPGO
from models.mtp_go_config import ModelConfig
from mtpgo_core.task.task_description import TaskDescription
from mtpgo_training.cli import main
from mtpgo_training.data.readers import load_recordings
from mtpgo_training.data.writers.ind_writer import write_ind
from mtpgo_training.export.exporter import export_model

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Two recordings in inD layout, "01" and "02"."""
    folder = tmp_path_factory.mktemp("data")
    write_ind(make_recording("01", 8.2), folder)
    write_ind(make_recording("02", 1.0), folder)
    return folder


@pytest.fixture(scope="module")
def model(folder, tmp_path_factory):
    """An untrained model, in effect constant velocity, that was "trained" on recording "01"."""
    torch.manual_seed(0)
    (seen,) = load_recordings(folder, "ind", ["01"])
    training = {"recordings": [{"name": "01", "sha256": seen.sha256, "split": "train"}]}
    path = tmp_path_factory.mktemp("model") / "made.pt"
    network = MTPGO(ModelConfig(modes=2, hidden=8))
    export_model(network, TaskDescription(name="made", training=training), path)
    return path


def demo(*arguments: str, cwd: Path) -> subprocess.CompletedProcess:
    environment = dict(os.environ, PYTHONPATH=str(ROOT))
    return subprocess.run(
        [sys.executable, "-m", "mtpgo_training.cli", "demo", *arguments],
        cwd=cwd,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.timeout(300)
def test_the_node_predicts_all_road_users_in_every_cycle(folder, model, tmp_path):
    done = demo(str(folder), "--layout", "ind", "--model", str(model), "--all", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    output = tmp_path / "demo_output"
    content = json.loads((output / "summary.json").read_text())
    # 8.2 s and 1 s at 5 Hz, both ends included; two road users.
    assert content["cycles"] == content["scenes"] == 42 + 6
    assert content["predictions_published"] == 2 * 48
    assert content["missed_cycles"] == content["missing_predictions"] == 0
    assert content["agents_max"] == 2
    assert 0.0 < content["latency_ms_p50"] <= content["latency_ms_p99"]
    # An untrained model goes straight on, up to the spread between its modes.
    assert content["ade_m"] == pytest.approx(content["cv_ade_m"], abs=0.5)
    assert content["model"]["name"] == "made"
    assert (output / "prediction.png").stat().st_size > 10_000
    assert "48 of 48 cycles answered at 5 Hz" in done.stdout
    assert done.stdout.count("\n01 ") == done.stdout.count("\n02 ") == 1


def test_bad_input_gives_one_line_and_status_2(folder, model, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "taken").write_text("a file")
    data = (str(folder), "--layout", "ind", "--model", str(model))
    for arguments, sentence in (
        ((str(folder), "--model", str(model)), "expected --layout with one of"),
        ((str(folder), "--layout", "none", "--model", str(model)), "'none' is unknown"),
        ((*data, "--recordings", "01"), "trained on all 1 recordings"),
        ((*data, "-o", str(tmp_path / "taken")), "taken is a file, expected a folder"),
        ((*data[:3], "--model", "none"), "none"),
    ):
        assert main(["demo", *arguments]) == 2
        error = capsys.readouterr().err
        assert sentence in error
        assert error.count("\n") == 1
    assert not (tmp_path / "demo_output" / "summary.json").exists()


def test_without_ros_the_error_names_rclpy(monkeypatch, capsys):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    assert main(["demo"]) == 2
    assert "rclpy is not installed" in capsys.readouterr().err
