# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The commands of ``ros2`` in the documentation, where ROS and this package are installed."""

import os
import re
import signal
import subprocess
import sys
import time

import pytest
import yaml
from installed_ros import why_not

PACKAGES = ("launch", "param", "lifecycle", "node", "service", "topic", "run")
"""Those of ``ros2`` that have a package each."""

LIMIT_S = 150.0
"""Only a broken machine reaches this (s)."""

ROS2 = (sys.executable, "-c", "import sys; from ros2cli.cli import main; sys.exit(main())")

pytestmark = pytest.mark.timeout(600)


class Command:
    """A command of ``ros2``, with a process group of its own, as in a terminal.

    Args:
        words: the command.
        path: file for what it says.
    """

    def __init__(self, words, path):
        self.path = path
        with path.open("wb") as output:
            self.popen = subprocess.Popen(
                [*ROS2, *words], stdout=output, stderr=output, start_new_session=True
            )

    @property
    def said(self):
        return self.path.read_text()

    def wait_for(self, word):
        self.until(lambda: word in self.said)

    def until(self, condition):
        end = time.monotonic() + LIMIT_S
        while not condition():
            assert time.monotonic() < end, self.said
            time.sleep(0.05)

    def status(self):
        return self.popen.wait(LIMIT_S)

    def nodes_ended(self):
        """Return whether all processes that launch has started have ended."""
        pids = re.findall(r"process started with pid \[(\d+)\]", self.said)
        assert pids, self.said
        return not any(os.path.exists(f"/proc/{pid}") for pid in pids)

    def close(self):
        if self.popen.poll() is None:
            os.killpg(self.popen.pid, signal.SIGKILL)
            self.popen.wait()


@pytest.fixture
def start(tmp_path):
    """A function that starts a command of ``ros2``; it is killed at the end."""
    if reason := why_not("ros2cli", *(f"ros2{name}" for name in PACKAGES)):
        pytest.skip(reason)
    made = []

    def start(*words):
        made.append(Command(words, tmp_path / f"{len(made)}.txt"))
        return made[-1]

    yield start
    for one in made:
        one.close()


@pytest.fixture
def ros2(start):
    """A function that runs a command of ``ros2`` and returns what it says."""

    def ros2(*words):
        command = start(*words)
        command.status()
        return command.said

    yield ros2
    ros2("daemon", "stop")


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["predictor.launch.py", "rate:=abc"], "argument rate is 'abc', expected a number"),
        (["predictor.launch.py", "rviz:=no"], "argument rviz is 'no', expected true or false"),
        (["risk.launch.py", "params_file:=/no.yaml"], "'/no.yaml', expected a parameter file"),
        (["replay.launch.py"], "missing required argument 'bag'"),
    ],
    ids=["number", "truth", "file", "required"],
)
def test_a_wrong_argument_is_one_sentence_and_nothing_is_started(start, arguments, sentence):
    command = start("launch", "mtpgo_ros", *arguments)
    assert command.status() == 1
    assert sentence in command.said
    assert "Traceback" not in command.said
    assert "process started" not in command.said


def test_the_demo_ends_with_its_bag_where_it_is_not_looped(start):
    command = start(
        *("launch", "mtpgo_ros", "demo.launch.py", "rviz:=false", "loop:=false", "speed:=10.0")
    )
    assert command.status() == 0
    assert "played 351 messages" in command.said
    assert command.said.count("process has finished cleanly") == 2
    assert command.nodes_ended()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_whatever_ends_launch_ends_the_demo(start, number):
    command = start("launch", "mtpgo_ros", "demo.launch.py", "rviz:=false")
    command.wait_for("hearing 1 publisher")
    if number == signal.SIGINT:  # Ctrl-C reaches the nodes, too
        os.killpg(command.popen.pid, number)
        assert command.status() == 0
        assert "process has died" not in command.said
    else:  # launch ends at once and leaves its processes behind
        command.popen.send_signal(number)
        assert command.status() == -number
    command.until(command.nodes_ended)


def test_the_node_is_read_and_changed_from_the_command_line(start, ros2, tmp_path):
    node = start("run", "mtpgo_ros", "predictor", "--ros-args", "-p", "ego_id:='7'")
    node.wait_for("ready")
    node.until(lambda: "/predictor" in ros2("node", "list"))
    assert "active [3]" in ros2("lifecycle", "get", "/predictor")
    assert "Unknown transition requested" in ros2("lifecycle", "set", "/predictor", "activate")
    for transition in ("deactivate", "activate"):
        assert "successful" in ros2("lifecycle", "set", "/predictor", transition)
    assert "successful" in ros2("param", "set", "/predictor", "rate", "4")
    said = ros2("param", "set", "/predictor", "ratte", "4.0")
    assert "the node has no parameter ratte, did you mean rate?" in said
    assert "Max value: 50.0" in ros2("param", "describe", "/predictor", "rate")
    swap = "{parameters: [{name: model, value: {type: 4, string_value: default}}]}"
    kind = "rcl_interfaces/srv/SetParametersAtomically"
    said = ros2("service", "call", "/predictor/swap_model", kind, swap)
    assert "successful=True, reason='the model is now default" in said
    assert "message: " in ros2("topic", "echo", "--once", "/predictor/health")
    dumped = ros2("param", "dump", "/predictor")
    values = yaml.safe_load(dumped)["/predictor"]["ros__parameters"]
    assert (values["rate"], values["ego_id"]) == (4.0, "7")
    os.killpg(node.popen.pid, signal.SIGINT)
    assert node.status() == 0

    path = tmp_path / "dumped.yaml"
    path.write_text(dumped)
    again = start("run", "mtpgo_ros", "predictor", "--ros-args", "--params-file", str(path))
    again.wait_for("ready")
    again.until(lambda: "/predictor" in ros2("node", "list"))
    assert "no effect" not in again.said
    assert yaml.safe_load(ros2("param", "dump", "/predictor"))["/predictor"] == {
        "ros__parameters": values
    }
