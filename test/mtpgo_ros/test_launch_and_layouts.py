# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Launch files, display layouts and the node's documentation, compared with the code."""

import ast
import dataclasses
import importlib.util
import json
import re
from pathlib import Path

import pytest
import yaml

from mtpgo_ros.diagnostics.event_log import BAD_MODEL, BAD_TIMING, ODD_INPUT
from mtpgo_ros.parameters.predictor_parameters import PredictorParameters

ROOT = Path(__file__).resolve().parents[2]
LAUNCH_FILES = sorted((ROOT / "launch").glob("*.launch.py"))
NAMES = {field.name: type(field.default) for field in dataclasses.fields(PredictorParameters)}
TOPICS = {
    "/objects",
    "/lane_markings",
    "/diagnostics",
    "/predictor/predictions",
    "/predictor/markers",
    "/predictor/debug/processing_time_ms",
}


@pytest.mark.parametrize("path", LAUNCH_FILES, ids=lambda path: path.name)
def test_launch_files_are_what_ros2_launch_expects(path):
    tree = ast.parse(path.read_text())
    functions = [node.name for node in tree.body if isinstance(node, ast.FunctionDef)]
    assert "generate_launch_description" in functions
    if importlib.util.find_spec("launch_ros"):
        spec = importlib.util.spec_from_file_location("launch_file", path)
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        assert module.generate_launch_description().entities


def test_the_launch_arguments_are_parameters_of_the_node():
    tree = ast.parse((ROOT / "launch" / "predictor.launch.py").read_text())
    table = next(
        node.value
        for node in tree.body
        if isinstance(node, ast.Assign) and node.targets[0].id == "PARAMETERS"
    )
    arguments = {
        key.value: value.elts[0].id for key, value in zip(table.keys, table.values, strict=True)
    }
    assert arguments.pop("use_sim_time") == "bool"
    assert {"model", "graph", "rate"} <= set(arguments)
    assert arguments == {name: NAMES[name].__name__ for name in arguments}


def test_the_displays_show_the_topics_that_there_are():
    rviz = yaml.safe_load((ROOT / "config" / "predictor.rviz").read_text())
    displays = rviz["Visualization Manager"]["Displays"]
    shown = {display["Topic"]["Value"] for display in displays if "Topic" in display}
    foxglove = json.loads((ROOT / "config" / "foxglove.json").read_text())
    text = json.dumps(foxglove)
    shown |= set(re.findall(r'"(/[a-z_/]+)', text))
    assert shown == TOPICS
    panels = set(re.findall(r'"(?:first|second)": "([^"]+)"', text))
    assert panels == set(foxglove["configById"])


def test_the_documentation_names_every_parameter_counter_and_topic():
    text = (ROOT / "docs" / "node.md").read_text()
    for name in NAMES:
        assert f"| `{name}` |" in text, name
    for counter in {**ODD_INPUT, **BAD_TIMING, **BAD_MODEL}:
        assert f"`{counter}`" in text, counter
    for topic in ("objects", "odometry", "ego_id", "lane_markings", "~/predictions", "~/markers"):
        assert f"`{topic}`" in text, topic


def test_the_documented_defaults_are_the_defaults():
    text = (ROOT / "docs" / "node.md").read_text().partition("## Parameters")[2]
    for field in dataclasses.fields(PredictorParameters):
        value = field.default
        written = ", ".join(value) if isinstance(value, tuple) else value
        written = str(written).lower() if isinstance(value, bool) else str(written)
        row = next(line for line in text.splitlines() if line.startswith(f"| `{field.name}` |"))
        assert row.split("|")[2].strip() == (f"`{written}`" if written else "empty"), field.name
