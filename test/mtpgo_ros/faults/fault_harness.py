# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A predictor process under faults over real DDS, and what must hold whatever arrives.

The predictor runs as a process of its own with the tiny model, which predicts constant velocity:
what a healthy road user's prediction must be is therefore known, and a fault that changes the
prediction of another road user shows. One process serves all tests of a module: each test starts
a new stretch of the stream with :meth:`FaultHarness.fresh`, far enough from the last that every
track is forgotten.
"""

from __future__ import annotations

import contextlib
import itertools
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from ros_helpers import Process, message_of, traffic
from sensor_msgs.msg import PointCloud2

from msg_adapters.conversions import stamp_to_ns
from msg_adapters.predictions import prediction_from_pointcloud2
from msg_adapters.registry import INPUTS
from msg_adapters.types import message_class
from mtpgo_core.schema import Prediction, Source, TrackedStates

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR

LOST_AFTER_S = 5.0
"""A message without an answer for this long was lost (s)."""

_SENT_AT_MOST = 3

LIMIT_S = 60.0
"""Only a broken machine reaches this (s)."""

PATIENT_S = 60.0
"""An ``input_timeout`` that no pause of the machine reaches (s): the input is not stale, which
would stand in the place of what a test waits for."""

REPORT_S = 0.1
"""Time between two diagnostics (s)."""

PERIOD_S = 0.2
"""Time between two observations of the stream (s): the node's default rate."""

FORGOTTEN_S = 10.0
"""After this long without an observation every track is forgotten (s): the window has 3 s."""

RELIABLE = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)
_numbers = itertools.count()


@dataclass(frozen=True)
class Answer:
    """One message on ``predictor/predictions``.

    Attributes:
        message: as received.
        prediction: decoded.
        received_s: time of receipt (s of the monotonic clock).
    """

    message: Any
    prediction: Prediction
    received_s: float


class FaultHarness:
    """A predictor process, with a publisher of objects and subscribers beside it.

    Args:
        model: model file.
        kind: input type of the first publisher, for instance ``markers``.
        qos: of the first publisher.
        wait: wait until the node has heard the publisher and the subscriber.
        arguments: further ROS arguments.
        **parameters: of the node.

    Attributes:
        process: the predictor.
        peer: the node of this side; add publishers, subscriptions and clients to it.
        objects: the first publisher.
        answers: all received predictions, in order.
        statuses: newest diagnostic status by the last word of its name.
        seen: every (name, level, message) of the diagnostics, in order, without repetitions.
        reported_ns: system time of the newest diagnostics (ns).
        time_s: stream time of the newest observation (s).
    """

    def __init__(
        self,
        model: Path | str,
        *,
        kind: str = "pointcloud2",
        qos: QoSProfile = RELIABLE,
        wait: bool = True,
        arguments: Sequence[str] = (),
        own_diagnostics: bool = False,
        **parameters: Any,
    ) -> None:
        self.namespace = f"/faults{next(_numbers)}"
        given = {"model": model, "diagnostic_period": REPORT_S, **parameters}
        # A process that outlives its module has its own: other tests record the usual topic.
        diagnostics = f"{self.namespace}/diagnostics" if own_diagnostics else "/diagnostics"
        remapped = ["-r", f"__ns:={self.namespace}", "-r", f"/diagnostics:={diagnostics}"]
        arguments = ["--ros-args", *remapped, *arguments]
        for name, value in given.items():
            text = str(value).lower() if isinstance(value, bool) else str(value)
            arguments += ["-p", f"{name}:={text}"]
        self.process = Process("predictor", *arguments)
        self.peer = Node("peer", namespace=self.namespace)
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.peer)
        self.answers: list[Answer] = []
        self.statuses: dict[str, Any] = {}
        self.seen: list[tuple[str, bytes, str]] = []
        self.time_s = 0.0
        self._last: dict[str, tuple[bytes, str]] = {}
        self.reported_ns = 0
        self._settled = False
        self.peer.create_subscription(
            PointCloud2, "predictor/predictions", self._on_prediction, RELIABLE
        )
        self.peer.create_subscription(DiagnosticArray, diagnostics, self._on_diagnostics, 50)
        self.objects = self.publisher(kind, qos)
        if wait:
            self.process.wait_for("hearing", self.spin)
            self.process.wait_for("heard by", self.spin)
            self.until(lambda: self.objects.get_subscription_count() > 0)

    # What comes back.

    def _on_prediction(self, message: Any) -> None:
        prediction = prediction_from_pointcloud2(message)
        self.answers.append(Answer(message, prediction, time.monotonic()))

    def _on_diagnostics(self, message: Any) -> None:
        own = [s for s in message.status if s.name.startswith(self.namespace.lstrip("/") + "/")]
        if own:
            self.reported_ns = stamp_to_ns(message.header.stamp)
        for status in own:
            name = status.name.split()[-1]
            self.statuses[name] = status
            said = (status.level, status.message)
            if self._last.get(name) != said:
                self._last[name] = said
                self.seen.append((name, *said))

    def spin(self) -> None:
        """Handle what has arrived."""
        self.executor.spin_once(timeout_sec=0.01)

    def spin_for(self, duration_s: float) -> None:
        """Handle what arrives for a time (s); for faults that consist in time passing."""
        self.comes_true(lambda: False, duration_s)

    def comes_true(self, condition: Callable[[], Any], limit_s: float) -> bool:
        """Spin until the condition holds; return whether it does within the time."""
        end_s = time.monotonic() + limit_s
        while not condition():
            if time.monotonic() >= end_s:
                return False
            self.spin()
        return True

    def until(self, condition: Callable[[], Any], what: str = "the condition") -> None:
        """Spin until the condition holds."""
        if not self.comes_true(condition, LIMIT_S):
            raise AssertionError(
                f"{what} did not come true in time; diagnostics {self._last}; log "
                f"{self.process.out[-5:]} {self.process.err[-5:]}"
            )

    # What is sent.

    def publisher(self, kind: str | type = "pointcloud2", qos: QoSProfile = RELIABLE) -> Any:
        """Return a further publisher on ``objects``, of an input type or a message class."""
        if isinstance(kind, str):
            kind = message_class(INPUTS[kind].message_type)
        return self.peer.create_publisher(kind, "objects", qos)

    def fresh(self) -> FaultHarness:
        """Begin a new stretch of the stream, in which no track is known any more."""
        self.time_s += FORGOTTEN_S
        return self

    def states(self, agents: int = 4, **options: Any) -> TrackedStates:
        """Return healthy traffic, one period after the last observation."""
        self.time_s = round(self.time_s + PERIOD_S, 6)
        return traffic(self.time_s, agents, **options)

    def send(self, given: Any, publisher: Any = None, kind: str = "pointcloud2") -> None:
        """Publish tracked states, a message, or the bytes of one."""
        self._settled = False
        message = message_of(given, kind) if isinstance(given, TrackedStates) else given
        (publisher or self.objects).publish(message)

    def answer(self, stamp_ns: int) -> Answer:
        """Wait for the prediction with this stamp; exactly one may come."""
        self.until(
            lambda: self.answered(stamp_ns),
            f"a prediction of {stamp_ns}",
        )
        found = [a for a in self.answers if a.prediction.stamp_ns == stamp_ns]
        assert len(found) == 1, f"{len(found)} predictions of {stamp_ns}"
        return found[0]

    def send_and_await(self, states: TrackedStates) -> Prediction:
        """Publish states and return their prediction, with the invariants checked only."""
        self.send(states)
        prediction = self.answer(states.stamp_ns).prediction
        check_invariants(prediction)
        return prediction

    def predict(self, states: TrackedStates, *untouched: int, **options: Any) -> Prediction:
        """Publish states, check what must always hold, and return their prediction.

        Args:
            states: the observation, in the order of identities.
            *untouched: rows of ``states`` whose prediction must be right; all if none is given.
            **options: of :meth:`check`.
        """
        self.send(states)
        prediction = self.answer(states.stamp_ns).prediction
        self.check(prediction, states, *untouched, **options)
        return prediction

    def healthy(self, agents: int = 4, steps: int = 1) -> Prediction:
        """Publish healthy observations and check that all is predicted as it must be."""
        for _ in range(steps):
            prediction = self.predict_next(agents)
        return prediction

    def predict_next(self, agents: int = 4, **options: Any) -> Prediction:
        """Publish a healthy observation and check its prediction, as of a stream that goes on.

        A single message may be lost where the subscription changes between best effort and
        reliable (after a pause of the stream); the next one is not.

        Args:
            agents: number of road users.
            **options: of :meth:`states`.
        """
        for _ in range(_SENT_AT_MOST):
            states = self.states(agents, **options)
            self.send(states)
            if self.comes_true(partial(self.answered, states.stamp_ns), LOST_AFTER_S):
                break
        prediction = self.answer(states.stamp_ns).prediction
        self.check(prediction, states)
        return prediction

    def answered(self, stamp_ns: int) -> bool:
        """Return whether a prediction with this stamp has come."""
        return any(a.prediction.stamp_ns == stamp_ns for a in self.answers)

    # What must hold.

    def check(
        self,
        prediction: Prediction,
        states: TrackedStates,
        *untouched: int,
        served: Any = None,
        tolerance_m: float = 0.05,
    ) -> None:
        """Check the invariants of a prediction against the observation that it answers.

        Args:
            prediction: as received.
            states: the observation; NaN rows and rejected rows are the caller's to leave out.
            *untouched: rows of ``states`` whose prediction must be right; all if none is given.
            served: the ``id_0`` that must be predicted; those of ``states`` by default.
            tolerance_m: of the first mode's positions (m).
        """
        check_invariants(prediction)
        assert prediction.stamp_ns == states.stamp_ns
        assert prediction.frame_id == states.frame_id or len(states) == 0
        wanted = states.key[:, 0].tolist() if served is None else list(served)
        assert sorted(prediction.key[:, 0].tolist()) == sorted(set(wanted))
        for row in untouched or range(len(states)):
            self.check_right(prediction, states, row, tolerance_m)

    @staticmethod
    def check_right(
        prediction: Prediction, states: TrackedStates, row: int, tolerance_m: float
    ) -> None:
        """Check that the road user in ``row`` is predicted at its constant velocity."""
        place = np.flatnonzero((prediction.key == states.key[row]).all(axis=1))
        assert place.shape == (1,), f"agent {states.key[row]} is predicted {place.shape[0]} times"
        reach = states.velocity[row] * prediction.time_s[:, None]
        error_m = prediction.mean[place[0], 0, :, :2] - (states.position[row] + reach)
        assert np.abs(error_m).max() < tolerance_m, f"agent {states.key[row]} off by {error_m}"

    def counter(self, name: str) -> int:
        """Return the newest reported value of a counter, 0 before the first report."""
        for status in self.statuses.values():
            for pair in status.values:
                if pair.key == name:
                    return int(pair.value)
        return 0

    @contextlib.contextmanager
    def counts(self, **expected: int) -> Iterator[None]:
        """Check that within the block, exactly so many of each were counted."""
        if not self._settled:
            self.settle()
        before = {name: self.counter(name) for name in expected}
        yield
        self.settle()
        self.until(
            lambda: all(self.counter(n) - before[n] >= expected[n] for n in expected),
            f"the counters {expected}, from {before}",
        )
        found = {name: self.counter(name) - before[name] for name in expected}
        assert found == expected

    def settle(self) -> None:
        """Wait for diagnostics that were made after now."""
        now_ns = time.time_ns()
        self.until(lambda: self.reported_ns > now_ns, "diagnostics")
        self._settled = True

    def level(self, name: str, level: bytes, word: str = "") -> Any:
        """Wait until a status has this level and ``word`` in its message; return the status."""
        what = f"status {name} at {level!r} with {word!r}"
        self.until(lambda: self._has(name, level, word), what)
        return self.statuses[name]

    def level_while_healthy(self, name: str, level: bytes, word: str = "") -> Any:
        """Stream healthy observations until a status has this level and word: OK again, or others.

        For every level that silence would end: after a pause of the machine, too, the next
        observation brings it back.
        """
        end_s = time.monotonic() + LIMIT_S
        while not self._has(name, level, word):
            assert time.monotonic() < end_s, f"status {name} is {self._last.get(name)}"
            self.healthy()
            self.spin_for(0.5 * PERIOD_S)
        return self.statuses[name]

    def _has(self, name: str, level: bytes, word: str) -> bool:
        found = self.statuses.get(name)
        return found is not None and found.level == level and word in found.message

    def said(self, name: str, level: bytes, word: str) -> bool:
        """Return whether a status has ever had this level with ``word`` in its message."""
        return any(n == name and v == level and word in m for n, v, m in self.seen)

    def call(self, kind: type, service: str, request: Any) -> Any:
        """Return the answer of one of the node's services."""
        client = self.peer.create_client(kind, f"predictor/{service}")
        self.until(client.service_is_ready)
        future = client.call_async(request)
        self.until(future.done, f"an answer of {service}")
        self.peer.destroy_client(client)
        return future.result()

    def close(self) -> None:
        """End the process; it must still be able to end in order."""
        ended = self.process.popen.poll() is not None
        status = self.process.finish()[0] if ended else self.process.interrupt(signal.SIGINT)[0]
        self.executor.shutdown()
        self.peer.destroy_node()
        assert ended or status == 0, f"ended with {status}: {self.process.err[-5:]}"


def check_invariants(prediction: Prediction) -> None:
    """Check that every number is finite, weights sum to 1, covariances are positive definite."""
    for name in ("mean", "yaw", "weight", "covariance", "z", "time_s"):
        assert np.isfinite(getattr(prediction, name)).all(), name
    assert np.allclose(prediction.weight.sum(axis=1), 1.0, atol=1e-5)
    assert (prediction.weight >= 0.0).all()
    xx, yy = prediction.covariance[..., 0, 0], prediction.covariance[..., 1, 1]
    xy = prediction.covariance[..., 0, 1]
    assert ((xx > 0.0) & (yy > 0.0) & (xx * yy > xy * xy)).all()
    assert np.isin(prediction.source, [int(source) for source in Source]).all()
    assert len(np.unique(prediction.key, axis=0)) == len(prediction)
