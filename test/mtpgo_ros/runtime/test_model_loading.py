# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Model files that a node must survive: refused, replaced by constant velocity, interruptible."""

import dataclasses
import signal
import sys
from pathlib import Path

import psutil
import pytest
from ros_helpers import LIMIT_S, spin_until

from mtpgo_core.errors import ModelFileError
from mtpgo_core.task import model_trial
from mtpgo_core.task.model_file import read_model
from mtpgo_ros.node.model_host import ModelHost
from mtpgo_ros.parameters.predictor_parameters import PredictorParameters
from mtpgo_ros.runtime.model_loading import load_model

sys.path.insert(0, str(Path(__file__).parents[2] / "mtpgo_core"))
import hostile_models


@pytest.fixture
def hostile(tmp_path):
    """Return a function that writes a hostile file."""

    def write(name):
        path = tmp_path / f"{name}.pt"
        path.write_bytes(getattr(hostile_models, name)())
        return path

    return write


@pytest.mark.parametrize(
    "name",
    [
        "bomb",
        "of_another_torch",
        "with_a_forged_hash",
        "not_a_number",
        "loops_for_ever",
        "a_pickle",
    ],
)
def test_constant_velocity_replaces_every_unusable_model(hostile, name, monkeypatch):
    monkeypatch.setattr(model_trial, "PROCESSOR_TIME_S", 1)
    path = hostile(name)
    given = dataclasses.replace(PredictorParameters(), model=str(path))
    with pytest.raises(ModelFileError, match=f"model file {path} "):
        ModelHost(given)
    host = ModelHost(dataclasses.replace(given, require_model=False))
    assert host.degraded.startswith(f"model file {path} ")
    assert "\n" not in host.degraded
    assert host.describe()["model"] == "constant velocity"
    assert host.describe()["model_sha256"] == ""


def test_a_pinned_model_is_loaded_and_no_other(models):
    right = read_model(models["quick"]).archive.sha256
    given = dataclasses.replace(PredictorParameters(), model=str(models["quick"]))
    host = ModelHost(dataclasses.replace(given, model_sha256=right))
    assert host.describe()["model_sha256"] == right
    with pytest.raises(ModelFileError, match=f"has the SHA-256 {right}, expected {'1' * 64}"):
        ModelHost(dataclasses.replace(given, model_sha256="1" * 64))


def test_a_stop_request_interrupts_loading(hostile, monkeypatch):
    monkeypatch.setattr("mtpgo_ros.runtime.model_loading.stop_requested", lambda: True)
    with pytest.raises(ModelFileError, match="loading was interrupted"):
        load_model(str(hostile("loops_in_loops")), 1, "")


def test_a_signal_ends_a_node_that_is_loading_a_model(process, hostile):
    path = hostile("loops_in_loops")
    predictor = process("predictor", "--ros-args", "-p", f"model:={path}")
    node = psutil.Process(predictor.popen.pid)

    class Looking:
        """Looks for the process of the trial."""

        def spin_once(self, timeout_sec):
            assert predictor.popen.poll() is None

    spin_until(Looking(), lambda: node.children())
    (trial,) = node.children()
    status, _, err = predictor.interrupt(signal.SIGTERM)
    assert (status, err) == (0, "")
    psutil.wait_procs([trial], timeout=LIMIT_S)
    assert not trial.is_running()
