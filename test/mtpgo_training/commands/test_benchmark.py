# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Short runs of every kind of `mtpgo benchmark`, with the real node."""

import importlib.util
import json
from pathlib import Path

import pytest

from mtpgo_training.cli import main

HIGHWAY = Path(__file__).resolve().parents[3] / "resource" / "recordings" / "highway"
NO_ROS = importlib.util.find_spec("rclpy") is None


@pytest.mark.skipif(NO_ROS, reason="ROS 2 is not installed")
def test_the_real_node_is_measured(tmp_path, capsys):
    out = tmp_path / "node.json"
    # Longer than a pause of the machine, in which nothing is predicted or sampled.
    arguments = ["--agents", "3", "--rate", "5", "--duration", "5"]
    arguments += ["--model", "default", "--json", str(out)]
    assert main(["benchmark", "node", *arguments]) == 0
    content = json.loads(out.read_text())
    row = content["rows"][0]
    assert row["agents"] == 3
    assert 24 <= row["cycles"] <= 26
    assert 0.0 < row["p50_ms"] <= row["p99_ms"] <= row["max_ms"]
    assert 0.0 < row["first_input_s"] < row["start_s"]
    assert row["resident_mb"] > 100.0
    assert 0.0 < row["cpu_share"] <= 1.1
    assert content["machine"]["cores"] >= 1
    printed = capsys.readouterr().out
    assert "mtpgo benchmark node --agents 3" in printed
    assert "| 3 | scene | 5 | 25 |" in printed


def test_growth_without_the_node(tmp_path, capsys):
    out = tmp_path / "growth.json"
    arguments = ["--without-node", "--agents", "4", "40", "--duration", "0.1"]
    arguments += ["--model", "default"]
    assert main(["benchmark", "growth", *arguments, "--json", str(out)]) == 0
    rows = json.loads(out.read_text())["pipeline"]
    assert [row["agents"] for row in rows] == [4, 40]
    assert [row["graphs"] > 1 for row in rows] == [False, True]
    assert all(0.0 < row["observe_ms"] < row["predict_ms"] for row in rows)
    assert "| 40 |" in capsys.readouterr().out


def test_conversion_of_given_recordings(tmp_path, capsys):
    out = tmp_path / "conversion.json"
    arguments = ["--data", str(HIGHWAY), "--layout", "highd", "--json", str(out)]
    assert main(["benchmark", "conversion", *arguments]) == 0
    content = json.loads(out.read_text())
    assert [row["step"] for row in content["rows"]][1:] == [
        "convert",
        "cache, first time",
        "cache, again",
    ]
    for row in content["rows"]:
        assert row["times_real_time"] == pytest.approx(content["recording_s"] / row["wall_s"])
        assert row["cpu_s"] > 0.0
        assert 20.0 < row["peak_mb"] < 2000.0
    assert "1 recording(s): " in capsys.readouterr().out


@pytest.mark.parametrize("kind", ["latency", "node", "largest", "growth", "conversion"])
def test_an_output_that_cannot_be_written_is_reported_first(kind, tmp_path, capsys):
    (tmp_path / "file").write_text("")
    path = tmp_path / "file" / "out.json"
    assert main(["benchmark", kind, "--json", str(path)]) == 2
    error = capsys.readouterr().err
    assert len(error.splitlines()) == 1
    assert "cannot be written" in error


@pytest.mark.parametrize("kind", ["node", "largest", "growth"])
def test_without_ros_the_error_is_one_line(kind, monkeypatch, capsys):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    assert main(["benchmark", kind]) == 2
    error = capsys.readouterr().err
    assert len(error.splitlines()) == 1
    assert "the benchmark starts the ROS 2 node, but rclpy is not installed" in error


def test_without_sumo_the_error_is_one_line(monkeypatch, capsys):
    monkeypatch.setitem(__import__("sys").modules, "sumo", None)
    monkeypatch.delenv("SUMO_HOME", raising=False)
    monkeypatch.setenv("PATH", "")
    assert main(["benchmark", "conversion", "--minutes", "0.01"]) == 2
    error = capsys.readouterr().err
    assert len(error.splitlines()) == 1
    assert "sumo" in error.lower()


def test_an_unknown_model_gives_a_one_line_error(capsys):
    if NO_ROS:
        pytest.skip("ROS 2 is not installed")
    assert main(["benchmark", "node", "--model", "nobody"]) == 2
    assert "'nobody' is neither a file nor a shipped model" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["node", "--agents", "0"], "expected at least 1"),
        (["node", "--rate", "fast"], "expected a number above 0"),
        (["node", "--duration", "inf"], "expected a number above 0"),
        (["largest", "--graph", "star"], "invalid choice"),
        (["growth", "--input-rates", "-1"], "expected a number above 0"),
        (["conversion", "--minutes", "0"], "expected a number above 0"),
    ],
)
def test_wrong_arguments(arguments, words, capsys):
    with pytest.raises(SystemExit) as caught:
        main(["benchmark", *arguments])
    assert caught.value.code == 2
    assert words in capsys.readouterr().err


def test_a_full_memory_of_trails(tmp_path, capsys):
    out = tmp_path / "trails.json"
    assert main(["benchmark", "trails", "--agents", "8", "--rounds", "3", "--json", str(out)]) == 0
    (row,) = json.loads(out.read_text())["rows"]
    assert row["points"] == 1 << 19
    assert row["add_ms"] > 0.0
    assert row["features_ms"] > 0.0
    assert "| 8 | 524288 |" in capsys.readouterr().out
