# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What the fault tests of time, stream, life and surroundings need besides the harness."""

from __future__ import annotations

import socket
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus
from fault_harness import FaultHarness, check_invariants
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from ros_helpers import LATCHED, START_NS, parameters_of
from rosgraph_msgs.msg import Clock

TRANSITIONS = {
    "configure": Transition.TRANSITION_CONFIGURE,
    "cleanup": Transition.TRANSITION_CLEANUP,
    "activate": Transition.TRANSITION_ACTIVATE,
    "deactivate": Transition.TRANSITION_DEACTIVATE,
}


class Stranger:
    """A node of another participant: one participant has one type for a topic.

    Attributes:
        node: the node.
    """

    def __init__(self, namespace: str, name: str = "stranger") -> None:
        self._context = rclpy.Context()
        rclpy.init(context=self._context, signal_handler_options=SignalHandlerOptions.NO)
        self.node = Node(name, namespace=namespace, context=self._context)

    def close(self) -> None:
        """Destroy the node."""
        self.node.destroy_node()
        self._context.try_shutdown()


class HealthListener:
    """Hears ``~/health`` as a supervisor does.

    Attributes:
        heard: all messages, in order.
    """

    def __init__(self, node: FaultHarness) -> None:
        self._node = node
        self.heard: list[Any] = []
        node.peer.create_subscription(
            DiagnosticStatus, "predictor/health", self.heard.append, LATCHED
        )

    def becomes(self, level: bytes, word: str = "") -> Any:
        """Wait until the newest verdict has this level and word; return it."""
        self._node.until(
            lambda: (
                self.heard and self.heard[-1].level == level and word in self.heard[-1].message
            ),
            f"health {level!r} with {word!r}, last {self.heard[-1:]}",
        )
        return self.heard[-1]


class SimulatedClock:
    """Publishes ``/clock``, in the stream's time."""

    def __init__(self, node: FaultHarness) -> None:
        self._node = node
        self._publisher = node.peer.create_publisher(Clock, "/clock", 10)
        node.until(lambda: self._publisher.get_subscription_count() > 0, "a listener to /clock")

    def show(self, time_s: float) -> int:
        """Publish a time (s) of the stream; return it (ns)."""
        time_ns = START_NS + round(time_s * 1e9)
        seconds, nanoseconds = divmod(time_ns, 10**9)
        self._publisher.publish(Clock(clock=Time(sec=seconds, nanosec=nanoseconds)))
        return time_ns

    def set(self, time_s: float) -> None:
        """Publish a time (s) of the stream until the node's diagnostics bear it."""
        self._node.until(lambda: self.show(time_s) == self._node.reported_ns, "the time")


def change_state(node: FaultHarness, transition: str | int, label: str = "") -> bool:
    """Return whether a transition, by name or id, was accepted."""
    number = TRANSITIONS.get(transition, transition) if not label else 0
    request = ChangeState.Request(transition=Transition(id=number, label=label))
    return bool(node.call(ChangeState, "change_state", request).success)


def state_of(node: FaultHarness) -> str:
    """Return the state of the life cycle."""
    return str(node.call(GetState, "get_state", GetState.Request()).current_state.label)


def set_parameters(node: FaultHarness, **values: Any) -> list[Any]:
    """Set parameters one by one; return the results."""
    request = SetParameters.Request(parameters=parameters_of(values))
    return list(node.call(SetParameters, "set_parameters", request).results)


def set_together(node: FaultHarness, service: str = "", **values: Any) -> Any:
    """Set parameters as a whole, or call another service of that type; return the result."""
    request = SetParametersAtomically.Request(parameters=parameters_of(values))
    service = service or "set_parameters_atomically"
    return node.call(SetParametersAtomically, service, request).result


def swap_model(node: FaultHarness, model: Path | str) -> Any:
    """Ask for another model; return the result."""
    return set_together(node, "swap_model", model=str(model))


def swap_models(node: FaultHarness, *models: Path | str) -> list[Any]:
    """Ask for models without waiting; return the futures of the answers."""
    client = node.peer.create_client(SetParametersAtomically, "predictor/swap_model")
    node.until(client.service_is_ready)
    requests = [
        SetParametersAtomically.Request(parameters=parameters_of({"model": str(model)}))
        for model in models
    ]
    return [client.call_async(request) for request in requests]


def reconnected(node: FaultHarness) -> None:
    """Wait until the node has subscribed to the harness' publisher and answers."""
    node.until(lambda: node.objects.get_subscription_count() > 0, "a subscription")

    def answers():
        """Return whether an observation has an answer; lost ones have none.

        The node's side of discovery may end later: what is sent before is lost.
        """
        states = node.states()
        node.send(states)
        return node.comes_true(lambda: node.answered(states.stamp_ns), 0.3)

    node.until(answers, "an answer after reconnecting")


def sources(node: FaultHarness, first: int = 0) -> np.ndarray:
    """Check all answers from ``first`` on and return the sources in them."""
    for answer in node.answers[first:]:
        check_invariants(answer.prediction)
    return np.concatenate([a.prediction.source for a in node.answers[first:]])


class ServiceManager:
    """The socket of a service manager.

    Attributes:
        messages: received so far.
    """

    def __init__(self, path: Path) -> None:
        self.path = str(path)
        self.messages: list[str] = []
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.bind(self.path)
        self._socket.setblocking(False)

    def hears(self, word: str) -> bool:
        """Return whether a message that begins with ``word`` has come."""
        while True:
            try:
                self.messages.append(self._socket.recv(4096).decode())
            except BlockingIOError:
                break
        return any(message.startswith(word) for message in self.messages)


class Resources:
    """Threads and memory of the node's process, to be as before after the faults."""

    def __init__(self, node: FaultHarness) -> None:
        self._node = node
        self._status = Path(f"/proc/{node.process.popen.pid}/status")
        self.threads, self.memory_mb = self._read()

    def _read(self) -> tuple[int, float]:
        values = dict(
            line.split(":", 1) for line in self._status.read_text().splitlines() if ":" in line
        )
        return int(values["Threads"]), int(values["VmRSS"].split()[0]) / 1024.0

    def check(self) -> None:
        """Check that no thread was left and that memory has not grown by more than 64 MB.

        A thread that was told to end may take a moment for it.
        """
        what = f"the end of all but {self.threads} threads"
        self._node.until(lambda: self._read()[0] <= self.threads, what)
        _, memory_mb = self._read()
        assert memory_mb < self.memory_mb + 64.0, f"{memory_mb} MB, {self.memory_mb} before"
