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

ATTEMPTS = 3
"""The recordings are played in real time, so a machine that pauses misses cycles, and observations
in the recorded bag; a node or a recorder that misses them misses them each time."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Two recordings in inD layout, "01" and "02"."""
    folder = tmp_path_factory.mktemp("data")
    write_ind(make_recording("01", 8.2), folder)
    write_ind(make_recording("02", 3.2), folder)
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


@pytest.mark.timeout(600)
def test_the_node_predicts_all_road_users_in_every_cycle(folder, model, tmp_path):
    given = ["--layout", "ind", "--model", str(model), "--all", "-p", "ratte:=1"]
    output = tmp_path / "demo_output"
    for _ in range(ATTEMPTS):
        done = demo(str(folder), *given, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        content = json.loads((output / "summary.json").read_text())
        counts = [
            [row[side]["predictions"] for side in ("live", "offline")] for row in content["live"]
        ]
        if not content["missed_cycles"] and all(live == bag for live, bag in counts):
            break
    assert "predictor: parameter ratte has no effect" in done.stdout
    # 8.2 s and 3.2 s at 5 Hz, both ends included; two road users.
    assert content["cycles"] == content["scenes"] == 42 + 17
    assert content["predictions_published"] == 2 * 59
    assert content["missed_cycles"] == content["missing_predictions"] == 0
    assert content["agents_max"] == 2
    assert 0.0 < content["latency_ms_p50"] <= content["latency_ms_p99"]
    # An untrained model goes straight on, up to the spread between its modes.
    assert content["ade_m"] == pytest.approx(content["cv_ade_m"], abs=0.5)
    assert content["model"]["name"] == "made"
    assert (output / "prediction.png").stat().st_size > 10_000
    assert "59 of 59 cycles answered at 5 Hz" in done.stdout
    assert done.stdout.count("\n01 ") == done.stdout.count("\n02 ") == 1
    check_live(content["live"])
    assert "mm at most, over the same road users and predictions." in done.stdout
    page = (output / "report" / "index.html").read_text()
    assert page.count("data:image/png;base64,") == 3
    assert "What the online calibration changes" in page


@pytest.mark.timeout(300)
def test_cycles_are_counted_at_the_rate_that_the_node_was_given(folder, model, tmp_path):
    given = ["--layout", "ind", "--model", str(model), "-p", "rate:=5", "-p", "rate:=2.5"]
    for _ in range(ATTEMPTS):
        done = demo(str(folder), *given, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        content = json.loads((tmp_path / "demo_output" / "summary.json").read_text())
        if not content["missed_cycles"]:
            break
    # Recording 02 alone, 3.2 s with both ends.
    assert (content["cycles"], content["missed_cycles"]) == (9, 0)
    assert "9 of 9 cycles answered at 2.5 Hz" in done.stdout


def check_live(rows):
    """The node's scores are those of its bag, with all predictions of both recordings."""
    assert [(row["group"], row["time_s"]) for row in rows] == [
        ("vehicle_moving", t) for t in (1, 3, 5)
    ]
    # A road user of the second recording is another one, although it has the same identity.
    counts = [(row["live"]["agents"], row["live"]["predictions"]) for row in rows]
    assert counts == [(4, 2 * (37 + 12)), (4, 2 * (27 + 2)), (2, 2 * 17)]
    for row in rows:
        live, offline = row["live"], row["offline"]
        for name in ("agents", "predictions"):
            assert live[name] == offline[name]
        for name in ("ade", "fde", "cv_ade"):
            assert live[name] == pytest.approx(offline[name], abs=1e-3)
        for name in ("miss_rate", "nll", "coverage_50", "coverage_90"):
            assert live[name] == pytest.approx(offline[name], abs=1e-3)


def test_bad_input_gives_one_line_and_status_2(folder, model, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "taken").write_text("a file")
    data = (str(folder), "--layout", "ind", "--model", str(model))
    for arguments, sentence in (
        ((str(folder), "--model", str(model)), "expected --layout with one of"),
        ((str(folder), "--layout", "none", "--model", str(model)), "'none' is unknown"),
        ((*data, "--recordings", "01"), "trained or chosen with all recordings given (01)"),
        ((*data, "-o", str(tmp_path / "taken")), "taken is a file, expected a folder"),
        ((*data[:3], "--model", "none"), "none"),
        ((*data, "-p", "rate:=0"), "--parameter is 'rate:=0', expected a rate above 0 Hz"),
        ((*data, "-p", "rate="), "--parameter is 'rate=', expected NAME:=VALUE"),
        ((*data, "-p", "model:=road"), "--parameter is 'model:=road', expected --model"),
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
