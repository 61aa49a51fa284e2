# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0

import os
import signal
import time

import pytest

from mtpgo_training.processes.child_process import ChildProcess, ProcessError, wait_until


def test_a_failing_process_is_quoted(tmp_path):
    child = ChildProcess("replay", [str(tmp_path / "none.mcap")], tmp_path / "replay.log", {})
    with pytest.raises(ProcessError, match=r"replay ended with status 2: .*none\.mcap") as caught:
        child.wait(60.0)
    assert "\n" not in str(caught.value)
    with pytest.raises(ProcessError, match="status 2"):
        child.wait_for("ready", 1.0)


def test_a_process_is_stopped_at_the_end_and_after_an_exception(tmp_path):
    arguments = ["--ros-args", "-p", "require_model:=false", "-p", "model:=none.pt"]
    with ChildProcess("predictor", arguments, tmp_path / "predictor.log", {}) as child:
        child.wait_for("ready", 60.0)
        child.check()
        with pytest.raises(ProcessError, match="was not ready within 0 s"):
            child.wait_for("never said", 0.0)
    assert not child.running
    assert "constant velocity serves" in child.text()
    with (
        pytest.raises(KeyError),
        ChildProcess("predictor", arguments, tmp_path / "again.log", {}) as child,
    ):
        _fail_when_ready(child)
    assert child._process.returncode == 0  # not killed: it has left nothing behind


def _fail_when_ready(child, number=0):
    child.wait_for("ready", 60.0)
    os.kill(child.pid, number)
    raise KeyError


def test_a_process_that_does_not_end_is_killed_after_an_exception(tmp_path, monkeypatch):
    monkeypatch.setattr("mtpgo_training.processes.child_process.ABORT_S", 0.1)
    udp = {"MTPGO_TRANSPORT": "udp"}  # No port in shared memory is left to other tests.
    arguments = ["--ros-args", "-p", "require_model:=false", "-p", "model:=none.pt"]
    with (
        pytest.raises(KeyError),
        ChildProcess("predictor", arguments, tmp_path / "predictor.log", udp) as child,
    ):
        _fail_when_ready(child, signal.SIGSTOP)
    assert child._process.returncode == -signal.SIGKILL


def test_waiting_ends_with_the_condition_or_the_timeout():
    begin_s = time.monotonic()
    assert wait_until(lambda: True, 3600.0)
    assert not wait_until(lambda: False, 0.05)
    assert time.monotonic() - begin_s >= 0.05
