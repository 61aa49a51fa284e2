# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Every kind of `mtpgo benchmark` from its command line, in short; the node is the real one."""

import importlib.util
import json
from pathlib import Path

import pytest

from mtpgo_training.benchmark import conversion_benchmark as conversion
from mtpgo_training.benchmark import growth_benchmark as growth
from mtpgo_training.benchmark import node_benchmark as node
from mtpgo_training.benchmark.machine import command_line, machine, write_json
from mtpgo_training.benchmark.node_case import NodeCase
from mtpgo_training.cli import main

HIGHWAY = Path(__file__).resolve().parents[3] / "resource" / "recordings" / "highway"
NO_ROS = importlib.util.find_spec("rclpy") is None


@pytest.mark.skipif(NO_ROS, reason="ROS 2 is not installed")
def test_the_real_node_is_measured(tmp_path, capsys):
    out = tmp_path / "node.json"
    arguments = ["--agents", "3", "--rate", "5", "--duration", "1"]
    arguments += ["--model", "default", "--json", str(out)]
    assert main(["benchmark", "node", *arguments]) == 0
    told = json.loads(out.read_text())
    row = told["rows"][0]
    assert row["agents"] == 3
    assert 4 <= row["cycles"] <= 6
    assert 0.0 < row["p50_ms"] <= row["p99_ms"] <= row["max_ms"]
    assert 0.0 < row["first_input_s"] < row["start_s"]
    assert row["resident_mb"] > 100.0
    assert 0.0 < row["cpu_share"] <= 1.1
    assert told["machine"]["cores"] >= 1
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


def test_growth_asks_the_node_for_every_size_rate_and_marker():
    plan = growth.GrowthPlan(agents=(8, 512), input_rates=(25.0, 100.0), seconds=3.0)
    assert [(c.agents, c.rate) for c in plan.node_cases()] == [(8, 1.0), (512, 1.0)]
    assert [(c.agents, c.input_rate) for c in plan.input_cases()] == [(128, 25.0), (128, 100.0)]
    assert [c.markers for c in plan.marker_cases()] == [False, True]


def test_conversion_of_given_recordings(tmp_path, capsys):
    out = tmp_path / "conversion.json"
    arguments = ["--data", str(HIGHWAY), "--layout", "highd", "--json", str(out)]
    assert main(["benchmark", "conversion", *arguments]) == 0
    told = json.loads(out.read_text())
    assert [row["step"] for row in told["rows"]][1:] == [
        "convert",
        "cache, first time",
        "cache, again",
    ]
    for row in told["rows"]:
        assert row["times_real_time"] == pytest.approx(told["recording_s"] / row["wall_s"])
        assert row["cpu_s"] > 0.0
        assert 20.0 < row["peak_mb"] < 2000.0
    assert "1 recording(s): " in capsys.readouterr().out


def test_a_step_that_fails_says_so():
    with pytest.raises(Exception, match="'convert' ended with status 2: mtpgo convert: error"):
        conversion.timed("convert", ["-m", "mtpgo_training.cli", "convert", "x", "y"], 1.0)


@pytest.mark.parametrize("kind", ["latency", "node", "largest", "growth", "conversion"])
def test_an_output_that_cannot_be_written_is_found_out_first(kind, tmp_path, capsys):
    (tmp_path / "file").write_text("")
    path = tmp_path / "file" / "out.json"
    assert main(["benchmark", kind, "--json", str(path)]) == 2
    said = capsys.readouterr().err
    assert len(said.splitlines()) == 1
    assert "cannot be written" in said


@pytest.mark.parametrize("kind", ["node", "largest", "growth"])
def test_without_ros_one_sentence(kind, monkeypatch, capsys):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    assert main(["benchmark", kind]) == 2
    said = capsys.readouterr().err
    assert len(said.splitlines()) == 1
    assert "the benchmark starts the ROS 2 node, but rclpy is not installed" in said


def test_without_sumo_one_sentence(monkeypatch, capsys):
    monkeypatch.setitem(__import__("sys").modules, "sumo", None)
    assert main(["benchmark", "conversion", "--minutes", "0.01"]) == 2
    said = capsys.readouterr().err
    assert len(said.splitlines()) == 1
    assert "sumo" in said.lower()


def test_a_model_that_is_none_is_one_sentence(capsys):
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


def test_what_is_asked_for_covers_every_policy_and_both_rates():
    asked = {(each.case.agents, each.case.graph, each.case.rate) for each in node.REQUIREMENTS}
    assert (64, "scene", 5.0) in asked
    assert (32, "scene", 10.0) in asked
    assert {graph for _, graph, _ in asked} == {"scene", "cover", "each"}
    assert all(each.case.duration_s == 60.0 for each in node.REQUIREMENTS)


def test_the_largest_scene_is_found_by_halving(monkeypatch, capsys):
    tried = []

    def pretended(case, model, logs, parameters=()):
        tried.append(case.agents)
        base = node.NodeRow(case.agents, case.graph, None, 5.0, 25.0, False, 10, 0, 0, *[1.0] * 7)
        return base if case.agents <= 72 else node.dataclasses.replace(base, misses=1)

    monkeypatch.setattr(node, "measure", pretended)
    monkeypatch.setattr(node, "require_node_tools", lambda: None)
    rows = node.print_largest(["cover"], NodeCase(0), "default", "x", None, step=8, most=512)
    assert [row.agents for row in rows] == [72]
    assert len(tried) <= 7
    assert "| 72 | cover |" in capsys.readouterr().out


def test_the_command_that_repeats_a_measurement():
    given = {"agents": [2, 8], "input_rate": 25.0, "neighbours": None, "markers": True, "p": []}
    assert command_line("node", given) == (
        "mtpgo benchmark node --agents 2 8 --input-rate 25.0 --markers"
    )
    assert {"processor", "cores", "torch", "numpy", "python", "load"} <= set(machine())


def test_what_was_not_measured_is_null(tmp_path):
    write_json(tmp_path / "out.json", {"rows": [{"p99_ms": float("nan"), "cycles": 0}]})
    told = json.loads((tmp_path / "out.json").read_text())
    assert told["rows"] == [{"p99_ms": None, "cycles": 0}]
