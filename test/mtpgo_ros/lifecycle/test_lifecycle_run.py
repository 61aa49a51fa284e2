# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A signal ends the start of a node at once, whatever it is doing."""

import signal
import socket
import sys

import pytest
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.parameter import Parameter
from ros_helpers import LongStep

from mtpgo_core.errors import ModelFileError
from mtpgo_core.task import model_trial
from mtpgo_ros.lifecycle.lifecycle_run import run_lifecycle
from mtpgo_ros.lifecycle.node_executable import run_executable
from mtpgo_ros.node.predictor_node import PredictorNode
from mtpgo_ros.parameters.predictor_parameters import PredictorParameters
from mtpgo_ros.runtime.executable import stop_on_signals
from mtpgo_ros.runtime.supervision import ServiceNotifier

STEPS = {
    "file": "mtpgo_ros.runtime.model_loading.read_model",
    "trial": "mtpgo_core.prediction.model_runner.try_out",
    "load": "mtpgo_core.prediction.model_runner.ModelRunner.of",
    "first run": "mtpgo_core.prediction.model_runner.ModelRunner.warm_up",
    "calibration file": "mtpgo_ros.quality.live_calibrator.restore",
    "lanes": "mtpgo_ros.node.lanes.lane_input.read_lane_file",
    "warm-up": "mtpgo_ros.node.model_host.ModelHost.warm_up",
}
"""What takes time at a start, and which function does it."""


@pytest.fixture
def stopped(signals):
    """The signals as the executables have them, for the time of a test."""
    return stop_on_signals()


@pytest.fixture
def node(models, tmp_path, monkeypatch):
    # The other process would import torch for nothing.
    monkeypatch.setattr("mtpgo_ros.runtime.model_loading.start_trials", lambda: None)
    (tmp_path / "lanes.json").write_text("{}")
    given = {
        "model": str(models["lanes"]),
        "calibration_file": str(tmp_path / "calibration.json"),
        "lane_file": str(tmp_path / "lanes.json"),
    }
    made = PredictorNode(
        namespace="/interrupted",
        parameter_overrides=[Parameter(name, value=value) for name, value in given.items()],
    )
    yield made
    made.stop()
    made.destroy_node()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("step", STEPS)
def test_each_step_of_the_configuration(node, stopped, monkeypatch, step, number):
    if step != "trial":
        monkeypatch.setattr(STEPS["trial"], lambda *_: None)
    if step == "warm-up":
        monkeypatch.setattr(STEPS["lanes"], lambda *_: _Anything())
    long = LongStep(number)
    monkeypatch.setattr(STEPS[step], long)
    run_lifecycle(node, stopped, ServiceNotifier())
    assert not long.ended
    assert stopped()
    assert node.failure == "a signal interrupted it"
    assert node._state_machine.current_state[1] == "unconfigured"


class _Anything:
    """Stands for lanes that were read."""

    lines, sentence = (), ""


def test_the_import_of_torch(node, stopped, monkeypatch):
    long = LongStep(signal.SIGINT)

    class Finder:
        def find_spec(self, name, path=None, target=None):
            return long() if name == "mtpgo_core.prediction.model_runner" else None

    monkeypatch.delitem(sys.modules, "mtpgo_core.prediction.model_runner", raising=False)
    monkeypatch.setattr(sys, "meta_path", [Finder(), *sys.meta_path])
    run_lifecycle(node, stopped, ServiceNotifier())
    assert not long.ended
    assert node.failure == "a signal interrupted it"


def test_a_configuration_that_another_node_asks_for(node, stopped, monkeypatch):
    long = LongStep(signal.SIGTERM)
    monkeypatch.setattr(STEPS["file"], long)
    assert node.trigger_configure() == TransitionCallbackReturn.FAILURE
    assert not long.ended


def test_the_watchdog_of_a_service_manager_is_served_while_a_model_is_loaded(
    node, stopped, monkeypatch, tmp_path
):
    """A configuration that a manager of the life cycle asks for keeps the executor busy."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(tmp_path / "notify"))
        manager.settimeout(10.0)
        monkeypatch.setattr(node._server, "value", PredictorParameters(autostart=False))
        run_lifecycle(node, lambda: True, ServiceNotifier(manager.getsockname(), 20_000))

        def load(parameters):
            while manager.recv(100) != b"WATCHDOG=1":
                pass
            raise ModelFileError("enough")

        monkeypatch.setattr("mtpgo_ros.node.predictor_node.ModelHost", load)
        assert node.trigger_configure() == TransitionCallbackReturn.FAILURE
        assert node.failure == "enough"


def test_the_imports_of_an_executable(stopped, monkeypatch):
    monkeypatch.setattr("mtpgo_ros.runtime.ros_start.start", lambda arguments: None)
    monkeypatch.setattr("rclpy.try_shutdown", lambda: None)  # the tests go on with it
    long = LongStep(signal.SIGTERM)
    assert run_executable("predictor", "", [], stopped, long) == 0
    assert not long.ended
    # Before the first import.
    assert run_executable("predictor", "", [], stopped, lambda: 1 / 0) == 0


def test_the_process_of_a_trial_ends_with_it(node, stopped, monkeypatch):
    monkeypatch.setattr(model_trial, "_passed", set())
    monkeypatch.setattr("mtpgo_core.task.model_trial.WORKER", "this")
    monkeypatch.setattr("mtpgo_core.task.model_trial.selectors.DefaultSelector", LongStep(15))
    run_lifecycle(node, stopped, ServiceNotifier())
    assert node.failure == "a signal interrupted it"
    assert model_trial._worker is None
