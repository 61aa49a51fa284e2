# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Launch files, display layouts and the node's documentation, compared with the code."""

import ast
import dataclasses
import importlib.util
import json
import re
import sys
from pathlib import Path

import launch_stub
import numpy as np
import pytest
import yaml

from mtpgo_core.displays.display_layouts import DisplayNames, rviz_layout
from mtpgo_core.history.odd_input import ODD_INPUT
from mtpgo_core.quality.metrics import TIMES_S
from mtpgo_core.quality.quality_report import QUALITY_ROW, WINDOWS_S
from mtpgo_core.resources import find_resource
from mtpgo_core.task.calibration import GROUPS
from mtpgo_ros.diagnostics.event_log import BAD_MODEL, BAD_TIMING
from mtpgo_ros.parameters.predictor_parameters import PredictorParameters
from mtpgo_training.demo.demo_pipeline import SHIPPED

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
    "/predictor/quality_table",
    "/predictor/quality_markers",
    "/risk/markers",
    "/risk/occupancy",
    "/risk/risk_steps",
}


@pytest.mark.parametrize("path", LAUNCH_FILES, ids=lambda path: path.name)
def test_launch_files_are_what_ros2_launch_expects(path, monkeypatch):
    tree = ast.parse(path.read_text())
    functions = [node.name for node in tree.body if isinstance(node, ast.FunctionDef)]
    assert "generate_launch_description" in functions
    if importlib.util.find_spec("launch_ros"):
        monkeypatch.setattr(sys, "path", [*sys.path])
        spec = importlib.util.spec_from_file_location("launch_file", path)
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        assert module.generate_launch_description().entities


@pytest.fixture
def predictor_launch(monkeypatch):
    """The launch file as a module."""
    return launch_stub.load(ROOT / "launch" / "predictor.launch.py", monkeypatch)


@pytest.fixture
def start(monkeypatch, tmp_path):
    """A function that starts a launch file, with the given packages installed."""

    def start(file, /, *packages, **arguments):
        index = tmp_path / "share/ament_index/resource_index/packages"
        index.mkdir(parents=True, exist_ok=True)
        for package in {"rviz2", *packages}:
            (index / package).unlink(missing_ok=True)
        for package in packages:
            (index / package).touch()
        monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path))
        monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
        found = launch_stub.launched(ROOT / "launch" / file, arguments, monkeypatch)
        nodes = {one.package: one for one in found if isinstance(one, launch_stub.Node)}
        executables = [one.executable for one in found if isinstance(one, launch_stub.Node)]
        messages = [one.msg for one in found if isinstance(one, launch_stub.LogInfo)]
        return found, nodes, executables, messages

    return start


def test_without_rviz2_the_predictor_starts_and_a_message_says_so(start):
    _, _, executables, messages = start("predictor.launch.py", rviz="true")
    assert executables == ["predictor"]
    (message,) = messages
    assert message.startswith("rviz2 is not installed")
    assert "mtpgo layouts" in message
    assert start("predictor.launch.py", rviz="false")[2:] == (["predictor"], [])


def test_rviz_shows_the_node_under_its_namespace_name_frame_and_topics(start):
    _, nodes, executables, messages = start(
        "predictor.launch.py",
        "rviz2",
        rviz="true",
        namespace="robot1",
        name="p2",
        fixed_frame="odom",
        objects="/perception/objects",
    )
    assert (executables, messages) == (["predictor", "rviz2"], [])
    option, path = nodes["rviz2"].arguments
    names = DisplayNames("robot1", "p2", "odom", objects="/perception/objects")
    assert option == "-d"
    assert Path(path).read_text() == rviz_layout(names)
    node = nodes["mtpgo_ros"]
    assert (node.name, node.namespace) == ("p2", "robot1")
    assert node.remappings == [("objects", "/perception/objects")]
    assert node.parameters[1] == {"fixed_frame": "odom"}


def test_the_frame_of_rviz_can_be_given(start):
    nodes = start("predictor.launch.py", "rviz2", rviz="true", frame="utm", fixed_frame="odom")[1]
    assert "Fixed Frame: utm" in Path(nodes["rviz2"].arguments[1]).read_text()
    nodes = start("predictor.launch.py", "rviz2", rviz="true")[1]
    assert "Fixed Frame: map" in Path(nodes["rviz2"].arguments[1]).read_text()


def test_without_the_python_package_rviz_shows_the_layout_that_ships(start, monkeypatch):
    monkeypatch.setitem(sys.modules, "mtpgo_core.displays.display_layouts", None)
    _, nodes, _, messages = start("predictor.launch.py", "rviz2", rviz="true")
    assert nodes["rviz2"].arguments == ["-d", str(ROOT / "config" / "predictor.rviz")]
    assert len(messages) == 1


def test_the_demo_plays_the_bag_that_ships_again_and_again(start):
    found, _, executables, _ = start("demo.launch.py", "rviz2")
    assert executables == ["predictor", "rviz2", "replay"]
    predictor, _, replay = [one for one in found if isinstance(one, launch_stub.Node)]
    assert Path(replay.arguments[0]) == find_resource(*SHIPPED)
    assert "--loop" in replay.arguments
    assert predictor.parameters[1]["use_sim_time"] is True
    # The bag's topics are where they were recorded, also for a predictor in a namespace.
    found = start("demo.launch.py", namespace="robot1", loop="false")[0]
    predictor, replay = [one for one in found if isinstance(one, launch_stub.Node)]
    assert ("objects", "/objects") in predictor.remappings
    assert "--loop" not in replay.arguments


@pytest.mark.parametrize(
    ("file", "more"), [("predictor.launch.py", {}), ("replay.launch.py", {"bag": "x.mcap"})]
)
def test_the_lane_file_and_how_it_is_read_reach_the_node(start, file, more):
    given = {
        "lane_file": "/maps/town.osm",
        "lane_projection": "mgrs",
        "lane_origin": "49.01, 8.43",
        "lane_offset": "1000, -250.5",
        "lane_frame": "map",
    }
    assert {name for name in NAMES if name.startswith("lane_")} == set(given)
    nodes = [one for one in start(file, **more, **given)[0] if isinstance(one, launch_stub.Node)]
    assert given.items() <= nodes[0].parameters[1].items()
    nodes = [one for one in start(file, **more)[0] if isinstance(one, launch_stub.Node)]
    assert not given.keys() & nodes[0].parameters[1].keys()  # the parameter file's values stay


def test_replay_ends_everything_with_the_bag(start):
    found = start("replay.launch.py", bag="x.mcap", speed="2.0", objects="/tracks")[0]
    predictor, replay, end = found
    assert replay.arguments[:3] == ["x.mcap", "--rate", "2.0"]
    assert ("objects", "/tracks") in predictor.remappings
    assert end.handler.target_action is replay
    assert isinstance(end.handler.on_exit[0], launch_stub.Shutdown)
    with pytest.raises(ValueError, match="argument loop is 'maybe', expected true or false"):
        start("replay.launch.py", bag="x.mcap", loop="maybe")


@pytest.mark.parametrize(
    ("kind", "name", "text", "expected"),
    [
        (float, "rate", "abc", "a number"),
        (float, "rate", "nan", "a number"),
        (float, "rate", "1e999", "a number"),
        (bool, "respawn", "maybe", "true or false"),
    ],
)
def test_a_wrong_launch_argument_is_named(predictor_launch, kind, name, text, expected):
    with pytest.raises(ValueError, match=f"argument {name} is '{text}', expected {expected}"):
        predictor_launch.typed(kind, name, text)
    assert predictor_launch.typed(float, "rate", "10") == 10.0
    assert predictor_launch.typed(bool, "respawn", "True") is True
    for text in ("markers,autoware", "[markers, autoware]", "['markers', 'autoware']"):
        assert predictor_launch.typed(tuple, "output", text) == ["markers", "autoware"]


@pytest.mark.parametrize("file", ["predictor.launch.py", "risk.launch.py"])
def test_a_parameter_file_that_does_not_exist_is_refused(start, file):
    """launch itself warns, and starts the node with the defaults."""
    with pytest.raises(ValueError, match=r"params_file is '/no\.yaml', expected a parameter file"):
        start(file, params_file="/no.yaml")
    (node,), *_ = start(file, params_file="")
    assert Path(node.parameters[0]).parent == ROOT / "config"


def test_what_a_bag_is_played_with_can_be_given(start):
    given = {"lane_markings": "/lanes", "use_sim_time": "false"}
    predictor = start("replay.launch.py", bag="x.mcap", **given)[0][0]
    assert ("lane_markings", "/lanes") in predictor.remappings
    assert predictor.parameters[1]["use_sim_time"] is False
    found = start("demo.launch.py", bag="mine.mcap")[0]
    _, replay = [one for one in found if isinstance(one, launch_stub.Node)]
    assert replay.arguments[0] == "mine.mcap"
    assert "--end-with-parent" in replay.arguments


def test_an_empty_name_or_topic_is_the_usual_one(start):
    (predictor,), *_ = start("predictor.launch.py", name="", objects="", ego_id_topic="/ego")
    assert (predictor.name, predictor.remappings) == ("predictor", [("ego_id", "/ego")])
    (risk,), *_ = start("risk.launch.py", plan="", predictions="/p")
    assert risk.remappings == [("predictor/predictions", "/p")]


def test_the_service_unit_has_a_watchdog_and_starts_the_predictor():
    lines = (ROOT / "config" / "systemd" / "mtpgo-predictor.service").read_text().splitlines()
    assert {"Type=notify", "WatchdogSec=5", "Restart=on-failure"} <= set(lines)
    (command,) = [line for line in lines if line.startswith("ExecStart=")]
    assert "exec" in command  # the process that systemd knows is the node
    assert "lib/mtpgo_ros/predictor" in command


def test_the_launch_arguments_are_parameters_of_the_node():
    arguments = launch_stub.parameter_types(ROOT / "launch" / "predictor.launch.py")
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


def test_the_plots_show_the_scores_that_their_legends_name():
    panels = json.loads((ROOT / "config" / "foxglove.json").read_text())["configById"]
    rows = QUALITY_ROW.names
    shape = (len(WINDOWS_S), len(GROUPS), len(TIMES_S), len(rows))
    for panel, legend in {
        "Plot!coverage": {f"{t} s": (t, "coverage_90") for t in TIMES_S},
        "Plot!ade": {"predicted": (5, "ade"), "constant velocity": (5, "cv_ade")},
    }.items():
        for path in panels[panel]["paths"]:
            time_s, name = legend.pop(path["label"])
            place = (0, GROUPS.index("vehicle_moving"), TIMES_S.index(time_s), rows.index(name))
            number = np.ravel_multi_index(place, shape)
            assert path["value"] == f"/predictor/quality_table.data[{number}]"
        assert not legend


def test_the_documentation_names_every_parameter_counter_and_topic():
    text = (ROOT / "docs" / "node.md").read_text()
    for name in NAMES:
        assert f"| `{name}` |" in text, name
    for counter in {**ODD_INPUT, **BAD_TIMING, **BAD_MODEL}:
        assert f"`{counter}`" in text, counter
    for topic in (
        "objects",
        "odometry",
        "ego_id",
        "lane_markings",
        "~/predictions",
        "~/markers",
        "~/quality",
        "~/quality_table",
        "~/quality_markers",
    ):
        assert f"`{topic}`" in text, topic


def test_the_documented_defaults_are_the_defaults():
    text = (ROOT / "docs" / "node.md").read_text().partition("## Parameters")[2]
    for field in dataclasses.fields(PredictorParameters):
        value = field.default
        written = ", ".join(value) if isinstance(value, tuple) else value
        written = str(written).lower() if isinstance(value, bool) else str(written)
        row = next(line for line in text.splitlines() if line.startswith(f"| `{field.name}` |"))
        assert row.split("|")[2].strip() == (f"`{written}`" if written else "empty"), field.name
