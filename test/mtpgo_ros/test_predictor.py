# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The executable ``predictor`` as a process: start, end and exit status."""

import itertools
import signal
import sys
import time
from pathlib import Path

import pytest
import rclpy
from ros_helpers import (
    LIMIT_S,
    held_locks,
    left_of,
    message_of,
    one_line,
    run_process,
    traffic,
)
from sensor_msgs.msg import PointCloud2

from msg_adapters.predictions import prediction_from_pointcloud2
from mtpgo_core.schema import Source

LINUX = sys.platform == "linux"


def arguments(model, **parameters):
    given = {"model": model, **parameters}
    return ["--ros-args", *[a for k, v in given.items() for a in ("-p", f"{k}:={v}")]]


def test_a_missing_model_ends_the_process_with_one_sentence():
    status, out, err = run_process("predictor", *arguments("/no/such/model.pt"))
    assert (status, out) == (2, "")
    assert "/no/such/model.pt does not exist" in one_line(err)


def test_a_truncated_model_ends_the_process_with_one_sentence(models, tmp_path):
    broken = tmp_path / "broken.pt"
    broken.write_bytes(models["quick"].read_bytes()[:2000])
    status, out, err = run_process("predictor", *arguments(broken))
    assert (status, out) == (2, "")
    assert str(broken) in one_line(err)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (["--ros-args", "-p", "rate:=-1.0"], "parameter rate"),
        (["--ros-args", "-p", "graph:=star"], "'cover'"),
        (["--ros-args", "-p", "max_agents:=many"], "max_agents"),
        (["--ros-args", "-p", "output:=[pointcloud2, carrier_pigeon]"], "carrier_pigeon"),
        (["--ros-args", "-p", "rate"], "rate"),
        (["--modle", "x.pt"], "--modle"),
    ],
    ids=["range", "choice", "type", "kind", "syntax", "argument"],
)
def test_bad_arguments_end_the_process_with_one_sentence(given, words):
    status, out, err = run_process("predictor", *given)
    assert (status, out) == (2, "")
    assert words in one_line(err)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_node_with_status_zero(process, models, number):
    predictor = process("predictor", *arguments(models["quick"]))
    predictor.wait_for("ready")
    status, out, err = predictor.interrupt(number)
    assert (status, out) == (0, "")
    assert "Traceback" not in err


@pytest.mark.parametrize("name", ["predictor", "risk", "record"])
def test_signals_until_the_very_end_leave_the_status_at_zero(process, models, tmp_path, name):
    """Ctrl-C reaches a node from the terminal and, a moment later, from ``ros2 launch`` again."""
    given = {"predictor": arguments(models["quick"]), "record": ["-o", tmp_path / "bag"]}
    running = process(name, *given.get(name, []), installed=True)
    running.wait_for("ready")
    running.popen.send_signal(signal.SIGINT)
    while running.popen.poll() is None:
        running.popen.send_signal(signal.SIGTERM)
    # record has recorded nothing, which is status 1.
    assert running.finish()[0] == (1 if name == "record" else 0)


@pytest.mark.skipif(not LINUX, reason="reads /proc/locks")
@pytest.mark.parametrize("name", ["predictor", "risk", "record"])
def test_nothing_stays_in_shared_memory_after_the_end(process, models, tmp_path, name):
    """Others would go on writing to a port that stays, which the next process does not read."""
    given = {"predictor": arguments(models["quick"]), "record": ["-o", tmp_path / "bag"]}
    running = process(name, *given.get(name, []))
    running.wait_for("ready")
    own = held_locks(running.popen.pid)
    assert len(own) >= 2, "a segment and a port"
    running.interrupt(signal.SIGTERM)
    assert not left_of(own)


def test_a_signal_during_the_start_is_no_error(process, models):
    predictor = process("predictor", *arguments(models["quick"]))
    command = Path(f"/proc/{predictor.popen.pid}/cmdline")
    while b"mtpgo_ros" not in command.read_bytes():
        pass  # Python has started; the signal may come at any moment from here.
    status, _, err = predictor.interrupt(signal.SIGTERM)
    assert "Traceback" not in err
    assert status in (0, -signal.SIGTERM)  # the latter before main() has been reached


def test_a_signal_ends_the_node_while_the_model_runs(process, models, peer):
    predictor = process("predictor", *arguments(models["stuck"]))
    predictor.wait_for("ready")
    objects = peer.create_publisher(PointCloud2, "/objects", 5)
    steps = itertools.count()

    def publish():
        objects.publish(message_of(traffic(0.2 * next(steps), speed_mps=20.0)))
        time.sleep(0.05)

    predictor.wait_for("over budget", publish)
    own = held_locks(predictor.popen.pid) if LINUX else set()
    status, _, err = predictor.interrupt()
    assert status == 0
    assert "Traceback" not in err
    assert "terminate" not in err
    assert not left_of(own)  # as in the test of shared memory above


def test_without_a_model_the_process_predicts_constant_velocity(process, peer):
    predictor = process("predictor", *arguments("/no/such/model.pt", require_model=False))
    predictor.wait_for("degraded")
    predictor.wait_for("ready")
    received = []
    peer.create_subscription(PointCloud2, "/predictor/predictions", received.append, 5)
    objects = peer.create_publisher(PointCloud2, "/objects", 5)
    end = time.monotonic() + LIMIT_S
    for step in itertools.count():
        objects.publish(message_of(traffic(0.2 * step)))
        rclpy.spin_once(peer, timeout_sec=0.1)
        if received or time.monotonic() > end:
            break
    prediction = prediction_from_pointcloud2(received[0])
    assert (prediction.source == Source.CONSTANT_VELOCITY).all()
    assert predictor.interrupt()[0] == 0
