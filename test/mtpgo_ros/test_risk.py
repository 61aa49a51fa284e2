# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The executable, its launch file, and the parameter file for nav2."""

import dataclasses
import signal
import socket
from pathlib import Path

import launch_stub
import pytest
import yaml

from mtpgo_ros.parameters.risk_parameters import RiskParameters

ROOT = Path(__file__).resolve().parents[2]

COSTMAP = {
    "global_frame": str,
    "robot_base_frame": str,
    "update_frequency": float,
    "publish_frequency": float,
    "transform_tolerance": float,
    "rolling_window": bool,
    "width": int,
    "height": int,
    "resolution": float,
    "robot_radius": float,
    "plugins": list,
    "use_maximum": bool,
    "trinary_costmap": bool,
    "lethal_cost_threshold": int,
    "unknown_cost_value": int,
    "track_unknown_space": bool,
}
"""Parameters of nav2's Costmap2DROS in Jazzy that the file uses, with the types it declares."""

STATIC_LAYER = {
    "plugin": str,
    "enabled": bool,
    "map_topic": str,
    "map_subscribe_transient_local": bool,
    "subscribe_to_updates": bool,
}
"""Those of its StaticLayer."""


@pytest.fixture
def manager(tmp_path, monkeypatch):
    """The socket of a service manager that expects a sign of life every 0.4 s."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as one:
        one.bind(str(tmp_path / "notify"))
        one.settimeout(60.0)
        monkeypatch.setenv("NOTIFY_SOCKET", one.getsockname())
        monkeypatch.setenv("WATCHDOG_USEC", "400000")
        yield one


def test_it_starts_and_ends_with_a_signal_and_bad_input_is_one_sentence(
    process, manager, monkeypatch
):
    running = process("risk")
    monkeypatch.delenv("NOTIFY_SOCKET")
    refused = process("risk", "--ros-args", "-p", "plan_type:=spline")
    two_types = process("risk", "--ros-args", "-r", "~/health:=/diagnostics")
    running.wait_for("ready: waiting for predictions on /predictor/predictions")
    status, out, err = refused.finish()
    assert (status, out) == (2, "")
    assert err.startswith("risk: parameter plan_type is 'spline', expected one of")
    status, _, err = two_types.finish()
    assert status == 2
    assert "risk: not accepted by ROS: Failed to create publisher" in err
    assert "Traceback" not in err
    # As a service of systemd it reports that it is ready, a sentence, and signs of life.
    heard: list[str] = []
    while len({line.partition("=")[0] for line in heard}) < 3 or heard.count("WATCHDOG=1") < 2:
        heard.append(manager.recv(4096).decode())
    assert heard[0] == "READY=1"
    (sentence,) = {line for line in heard if line.startswith("STATUS=")}
    assert sentence == (
        "STATUS=no plan has come on /odometry yet; the risk is unknown;"
        " nothing has come on /predictor/predictions yet"
    )
    assert running.interrupt(signal.SIGTERM)[0] == 0


def test_the_launch_arguments_are_parameters_of_the_node():
    arguments = launch_stub.parameter_types(ROOT / "launch" / "risk.launch.py")
    assert arguments.pop("use_sim_time") == "bool"
    kinds = {f.name: type(f.default).__name__ for f in dataclasses.fields(RiskParameters)}
    assert arguments == {name: kinds[name] for name in arguments}


def test_the_launch_arguments_choose_types_and_topics(monkeypatch):
    given = {"prediction_type": "autoware", "predicted_objects": "/objects", "namespace": "robot1"}
    (node,) = launch_stub.launched(ROOT / "launch" / "risk.launch.py", given, monkeypatch)
    assert (node.name, node.namespace) == ("risk", "robot1")
    assert node.parameters[1] == {"prediction_type": "autoware"}
    assert node.remappings == [("predictor/predicted_objects", "/objects")]


def test_the_service_unit_has_a_watchdog_and_starts_risk():
    folder = ROOT / "config" / "systemd"
    lines = (folder / "mtpgo-risk.service").read_text().splitlines()
    assert {"Type=notify", "WatchdogSec=5", "Restart=on-failure"} <= set(lines)
    (command,) = [line for line in lines if line.startswith("ExecStart=")]
    assert "exec" in command  # the process that systemd knows is the node
    assert "lib/mtpgo_ros/risk" in command
    assert "mtpgo-predictor.service" in next(line for line in lines if line.startswith("After="))


def test_the_costmap_of_nav2_has_the_grid_as_a_layer():
    file = yaml.safe_load((ROOT / "config" / "nav2_predicted_occupancy.yaml").read_text())
    costmap = file["local_costmap"]["local_costmap"]["ros__parameters"]
    layers = {name for name, value in costmap.items() if isinstance(value, dict)}
    assert layers == set(costmap["plugins"])
    assert {k: type(v) for k, v in costmap.items() if k not in layers} == COSTMAP
    layer = costmap["predicted_occupancy"]
    assert {k: type(v) for k, v in layer.items()} == STATIC_LAYER
    assert layer["plugin"] == "nav2_costmap_2d::StaticLayer"
    assert layer["map_topic"] == "/risk/occupancy"
    # See the comments in the file: what the layer does to the costmap depends on these.
    assert layer["map_subscribe_transient_local"]
    assert costmap["rolling_window"]
    assert costmap["use_maximum"]
    assert not costmap["trinary_costmap"]
    assert 0 < costmap["lethal_cost_threshold"] < 100
    assert costmap["unknown_cost_value"] == 255
    assert costmap["plugins"][0] == "predicted_occupancy"
    assert costmap["plugins"][-1] == "inflation_layer"
