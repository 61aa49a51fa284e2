# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A test bench for the node: real publishers and subscribers over DDS, in one executor.

Nothing here waits for a fixed time: everything waits for a condition, with a limit that only a
broken machine reaches.
"""

from __future__ import annotations

import contextlib
import ctypes
import itertools
import os
import signal
import subprocess
import sys
import threading
import time
import types
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import declared
import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import String

from msg_adapters.predictions import prediction_from_pointcloud2
from msg_adapters.registry import INPUTS
from msg_adapters.types import RclpyTypes
from mtpgo_core.identity import keys_from_integers
from mtpgo_core.schema import Prediction, TrackedStates, tracked_states
from mtpgo_ros.diagnostics.event_log import RECENT_S
from mtpgo_ros.node.inference.prediction_request import PredictionRequest
from mtpgo_ros.node.predictor_node import PredictorNode

ROOT = Path(__file__).resolve().parents[2]
LIMIT_S = 150.0
"""Only a broken machine reaches this (s); a node has been seen to need 67 s for its start."""

_END_S = 30.0
"""A process that is asked to end is killed after this time (s)."""

START_NS = 1_700_000_000_000_000_000
LATCHED = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
_namespaces = itertools.count()


def traffic(
    time_s: float, agents: int = 4, *, speed_mps: float = 10.0, frame_id: str = "map"
) -> TrackedStates:
    """Return cars in one row, driving along x, at a time (s) counted from ``START_NS``."""
    row = np.arange(agents, dtype=np.float64)
    position = np.stack([12.0 * row + speed_mps * time_s, np.zeros(agents)], axis=1)
    return tracked_states(
        START_NS + round(time_s * 1e9),
        frame_id,
        keys_from_integers(range(1, agents + 1)),
        position,
        agent_class=np.ones(agents, dtype=np.uint8),
        velocity=np.tile([speed_mps, 0.0], (agents, 1)),
        yaw=np.zeros(agents),
        size=np.tile([4.5, 1.8], (agents, 1)),
    )


def message_of(states: TrackedStates, kind: str = "pointcloud2") -> Any:
    """Return the rclpy message of tracked states."""
    return INPUTS[kind].from_states(states, RclpyTypes())


def borrowed_class(monkeypatch: Any, name: str) -> type:
    """Make ``package.msg`` importable with a class for a message whose package is not on pip.

    It borrows the type support of a message that is installed: publishers and raw subscriptions
    exchange the bytes as they are.
    """
    package, _, short = name.partition("/msg/")
    found = type(String)(short, (String,), {"__slots__": (), "stack_type": name})
    module = sys.modules.get(f"{package}.msg") or types.ModuleType(f"{package}.msg")
    monkeypatch.setitem(sys.modules, package, sys.modules.get(package, types.ModuleType(package)))
    monkeypatch.setitem(sys.modules, f"{package}.msg", module)
    monkeypatch.setattr(module, short, found, raising=False)
    return found


class RecordingLogger:
    """Keeps the log lines.

    Attributes:
        warnings, errors: the lines so far.
    """

    def __init__(self) -> None:
        self.warnings: list[str] = []
        self.errors: list[str] = []

    def warning(self, line: str) -> None:
        """Keep a warning."""
        self.warnings.append(line)

    def error(self, line: str) -> None:
        """Keep an error."""
        self.errors.append(line)


def spin_until(executor: Any, condition: Callable[[], Any]) -> None:
    """Spin until the condition holds."""
    end = time.monotonic() + LIMIT_S
    while not condition():
        assert time.monotonic() < end, "the condition did not come true in time"
        executor.spin_once(timeout_sec=0.02)


class Bench:
    """A predictor node and the publishers and subscribers around it.

    Attributes:
        predictions: what was published, decoded, in order.
        statuses: the newest diagnostics by the last word of their name.
    """

    def __init__(
        self, model: Path | str, objects_type: type | None = PointCloud2, **parameters: Any
    ) -> None:
        self.namespace = f"/bench{next(_namespaces)}"
        # Silence, as in a pause of the machine, does not stand in the place of another status.
        usual = {"diagnostic_period": 0.1, "input_timeout": LIMIT_S}
        given = {"model": str(model), **usual, **parameters}
        self.node = PredictorNode(
            namespace=self.namespace,
            parameter_overrides=[Parameter(name, value=value) for name, value in given.items()],
        )
        self.peer = Node("peer", namespace=self.namespace)
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.executor.add_node(self.peer)
        self.predictions: list[Prediction] = []
        self.statuses: dict[str, Any] = {}
        self.peer.create_subscription(
            PointCloud2,
            "predictor/predictions",
            lambda message: self.predictions.append(prediction_from_pointcloud2(message)),
            20,
        )
        self.peer.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 20)
        self.objects = None
        if objects_type is not None:
            self.objects = self.peer.create_publisher(
                objects_type,
                "objects",
                QoSProfile(depth=5, reliability=ReliabilityPolicy.RELIABLE),
            )

    def _on_diagnostics(self, message: Any) -> None:
        for status in message.status:
            if status.name.startswith(self.namespace.lstrip("/")):
                self.statuses[status.name.split()[-1]] = status

    def start(self) -> Bench:
        """Configure and activate, and wait until both sides have found each other."""
        assert str(self.node.trigger_configure()).endswith("SUCCESS"), self.node.failure
        assert str(self.node.trigger_activate()).endswith("SUCCESS"), self.node.failure
        topic = self.namespace + "/predictor/predictions"
        self.until(lambda: self.node.count_subscribers(topic) > 0)
        self.until(lambda: self.peer.count_publishers(topic) > 0)
        if self.objects is not None:
            self.until(lambda: self.objects.get_subscription_count() > 0)
            self.until(lambda: self.node._pipeline.objects._subscription.get_publisher_count() > 0)
        return self

    def be_patient(self) -> Bench:
        """Give the model unlimited time, so that a busy machine changes no outcome.

        For the same reason an event is recent, and reported as WARN, for as long as tests wait.
        """
        limit_ns = round(LIMIT_S * 1e9)
        self.node._pipeline._request = lambda window, stamp_ns, received_ns: PredictionRequest(
            window, stamp_ns, received_ns, budget_ns=limit_ns, deadline_ns=limit_ns
        )
        # Nor does a cycle that took long leave fewer agents to the model in the next.
        self.node._pipeline._load.allowed_s = lambda budget, period_s: LIMIT_S
        begin_s, rate = time.monotonic(), RECENT_S / LIMIT_S
        self.node.events._clock = lambda: begin_s + rate * (time.monotonic() - begin_s)
        return self

    def until(self, condition: Callable[[], Any], limit_s: float = LIMIT_S) -> None:
        """Spin until the condition holds."""
        assert self.comes_true(condition, limit_s), "the condition did not come true in time"

    def comes_true(self, condition: Callable[[], Any], limit_s: float) -> bool:
        """Spin until the condition holds; return whether it does within the time."""
        end = time.monotonic() + limit_s
        while not condition():
            if time.monotonic() >= end:
                return False
            self.executor.spin_once(timeout_sec=0.02)
        return True

    def count(self, name: str) -> int:
        """Return a counter of the node."""
        return self.node.events.counts().get(name, 0)

    def send(self, message: Any) -> None:
        """Publish a message of objects and wait until the node has received it."""
        before = self.count("messages")
        self.objects.publish(message)
        self.until(lambda: self.count("messages") > before)

    def predict(self, states: TrackedStates) -> Prediction:
        """Publish states that are due and return their prediction."""
        self.send(message_of(states))
        return self.prediction(states.stamp_ns)

    def prediction(self, stamp_ns: int) -> Prediction:
        """Wait for the prediction with this stamp and return it."""
        self.until(lambda: any(p.stamp_ns == stamp_ns for p in self.predictions))
        return next(p for p in self.predictions if p.stamp_ns == stamp_ns)

    def answered(self, number: int) -> None:
        """Wait until exactly so many predictions were published."""
        self.until(lambda: self.count("predictions") == number)

    def status(self, name: str, level: bytes, word: str = "", **expected: str) -> dict[str, str]:
        """Wait for level, word and values of a status; return all of its values."""

        def values() -> dict[str, str]:
            return {pair.key: pair.value for pair in self.statuses[name].values}

        self.until(
            lambda: (
                name in self.statuses
                and self.statuses[name].level == level
                and word in self.statuses[name].message
                and expected.items() <= values().items()
            )
        )
        return values()

    def call(self, kind: type, service: str, request: Any) -> Any:
        """Return the answer of one of the node's services."""
        client = self.peer.create_client(kind, f"predictor/{service}")
        self.until(client.service_is_ready)
        future = client.call_async(request)
        self.until(future.done)
        self.peer.destroy_client(client)
        return future.result()

    def close(self) -> None:
        """Stop and destroy everything."""
        pipeline = self.node._pipeline
        if not self.node.stop():
            # The test process lives on: its interpreter must not end under a running model.
            assert pipeline.worker.stop(LIMIT_S)
        self.executor.shutdown()
        self.node.destroy_node()
        self.peer.destroy_node()


class Process:
    """One of the executables as a separate process, whose output is read continuously.

    Attributes:
        out, err: lines seen so far.
    """

    def __init__(self, module: str, *arguments: str | Path, installed: bool = False) -> None:
        start = ["-m", f"mtpgo_ros.{module}"]
        if installed:  # as the script that pip writes into bin/
            place, function = declared.entry_points()[module]
            start = ["-c", f"import sys; from {place} import {function}; sys.exit({function}())"]
        self.popen = subprocess.Popen(
            [sys.executable, "-W", "ignore", *start, *map(str, arguments)],
            cwd=ROOT,
            env={**os.environ, "PYTHONUNBUFFERED": "1"},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            preexec_fn=_die_with_parent,
        )
        self.out: list[str] = []
        self.err: list[str] = []
        self._threads = [
            threading.Thread(target=_collect, args=(pipe, lines), daemon=True)
            for lines, pipe in ((self.out, self.popen.stdout), (self.err, self.popen.stderr))
        ]
        for thread in self._threads:
            thread.start()

    def wait_for(self, word: str, meanwhile: Callable[[], Any] = lambda: time.sleep(0.02)) -> str:
        """Wait for a line of either stream that contains ``word`` and return it."""
        end = time.monotonic() + LIMIT_S
        while True:
            ended = self.popen.poll() is not None
            if ended:
                self.finish()
            for line in [*self.out, *self.err]:
                if word in line:
                    return line
            if ended or time.monotonic() > end:
                raise AssertionError(f"no {word!r} in {self.out} {self.err}")
            meanwhile()

    def finish(self) -> tuple[int, str, str]:
        """Return exit status, stdout and stderr of a process that ends by itself.

        Without lines of Fast DDS's own log: processes that start at the same moment compete for
        its locks in shared memory, which it calls an error and then takes others.
        """
        try:
            status = self.popen.wait(LIMIT_S)
        finally:
            self.popen.kill()
        for thread in self._threads:
            thread.join()
        out, err = (
            "".join(line for line in lines if "RTPS_TRANSPORT_SHM" not in line)
            for lines in (self.out, self.err)
        )
        return status, out, err

    def interrupt(self, number: int = signal.SIGINT) -> tuple[int, str, str]:
        """Send a signal, wait for the end and return the same as :meth:`finish`."""
        self.popen.send_signal(number)
        return self.finish()


class LongStep:
    """Stands for a function that takes long, during which a signal comes.

    Attributes:
        ended: the function was not interrupted.
    """

    def __init__(self, number):
        self.number, self.ended = number, False

    def __call__(self, *_args, **_options):
        signal.raise_signal(self.number)
        for _ in range(100):
            time.sleep(0.01)
        self.ended = True
        raise AssertionError("the step was not interrupted")


def end(popen: subprocess.Popen[str]) -> None:
    """End a process, whatever its status, and kill it only if it does not end.

    One that is killed leaves its ports in shared memory to the tests that follow, and may hold a
    lock there, on which the others wait.
    """
    if popen.poll() is None:
        popen.send_signal(signal.SIGTERM)
        popen.send_signal(signal.SIGCONT)  # One that is stopped receives no other signal.
        with contextlib.suppress(subprocess.TimeoutExpired):
            popen.wait(_END_S)
    popen.kill()
    popen.wait()


def _die_with_parent() -> None:
    """End the process with its parent, so that a killed test run leaves none running."""
    set_parent_death_signal = 1
    ctypes.CDLL(None).prctl(set_parent_death_signal, signal.SIGKILL)


def _collect(pipe: Any, lines: list[str]) -> None:
    for line in pipe:
        lines.append(line)


def held_locks(process: int) -> set[tuple[str, int]]:
    """Return the locks that Fast DDS holds in shared memory for a process (Linux).

    It has one for each segment and each port that the process reads. Those that stay are of a
    process that has crashed, or not left its domain.

    Returns:
        Path and inode of each: a name may soon be another process's.
    """
    lines = [line.split() for line in Path("/proc/locks").read_text().splitlines()]
    held = {int(x[5].split(":")[2]) for x in lines if x[1] == "FLOCK" and x[4] == str(process)}
    there = {(str(path), _inode(path)) for path in Path("/dev/shm").glob("fastrtps_*_el")}
    return {(path, inode) for path, inode in there if inode in held}


def left_of(locks: set[tuple[str, int]]) -> list[str]:
    """Return which of these locks still exist."""
    return [path for path, inode in locks if _inode(path) == inode]


def _inode(path: str | Path) -> int:
    """Return the inode of a file, 0 if it is not there."""
    try:
        return os.stat(path).st_ino
    except FileNotFoundError:
        return 0


def run_process(module: str, *arguments: str | Path) -> tuple[int, str, str]:
    """Return exit status, stdout and stderr of an executable that ends by itself."""
    return Process(module, *arguments).finish()


def one_line(text: str) -> str:
    """Return the only line of a text."""
    lines = [line for line in text.splitlines() if line.strip()]
    assert len(lines) == 1, text
    return lines[0]


def init() -> None:
    """Start rclpy for the whole test process, without its signal handlers."""
    if not rclpy.ok():
        rclpy.init(signal_handler_options=rclpy.signals.SignalHandlerOptions.NO)


def parameters_of(values: dict[str, Any]) -> Sequence[Any]:
    """Return parameter messages."""
    return [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]
