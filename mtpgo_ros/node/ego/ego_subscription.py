# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The subscription to the ego's odometry, and its absence."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any, Protocol

from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription

from msg_adapters.inputs.ego_odometry import EgoOdometry, JoinedEgo
from mtpgo_core.errors import ConfigurationError, MtpgoError
from mtpgo_core.schema import KeyArray, TrackedStates
from mtpgo_ros.diagnostics.event_log import EventLog
from mtpgo_ros.parameters.predictor_parameters import PredictorParameters

_ODOMETRY_QOS = QoSProfile(depth=50, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Queue of odometry: half a second at 100 Hz."""

ToFrame = Callable[[TrackedStates], TrackedStates]


class EgoSource(Protocol):
    """Adds the ego to the objects of a message."""

    topic: str

    def join(self, states: TrackedStates, key: KeyArray | None, to_frame: ToFrame) -> JoinedEgo:
        """Return the objects with the ego, see :meth:`EgoOdometry.join`."""

    def clear(self) -> None:
        """Forget the past, as after a jump of the clock."""

    def close(self) -> None:
        """Destroy the subscription."""


class NoEgo:
    """No odometry of the ego: the objects stay as they are.

    Attributes:
        topic: empty.
    """

    topic = ""

    def join(self, states: TrackedStates, key: KeyArray | None, to_frame: ToFrame) -> JoinedEgo:
        """Return the objects unchanged."""
        return JoinedEgo(states, known=False)

    def clear(self) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Do nothing: there is no subscription."""


class EgoSubscription:
    """Hears the ego's odometry; messages of objects are joined on another thread.

    Args:
        node: the node.
        parameters: the topic, and what is known of the ego.
        events: where unusable odometry is counted.

    Attributes:
        topic: resolved name.

    Raises:
        ConfigurationError: the topic's name is not allowed.
    """

    def __init__(self, node: Node, parameters: PredictorParameters, events: EventLog) -> None:
        self._node, self._events = node, events
        self._odometry = EgoOdometry(parameters.ego_options)
        self._lock = threading.Lock()
        try:
            self._subscription: Subscription = node.create_subscription(
                Odometry, parameters.ego_topic, self._on_odometry, _ODOMETRY_QOS
            )
        except Exception as error:  # rclpy's errors about names have no common base.
            raise ConfigurationError(
                f"parameter ego_topic is {parameters.ego_topic!r}, expected the name of a topic:"
                f" {' '.join(str(error).split())}"
            ) from error
        self.topic = self._subscription.topic_name

    def _on_odometry(self, message: Any) -> None:
        try:
            with self._lock:
                self._odometry.add(message)
        except MtpgoError as error:
            line = f"message on {self.topic} left out: {error}"
            self._events.count("ego_refused", reason=line, detail=str(error))

    def join(self, states: TrackedStates, key: KeyArray | None, to_frame: ToFrame) -> JoinedEgo:
        """Return the objects with the ego; counts doubles and messages without it."""
        assert key is not None
        with self._lock:
            joined = self._odometry.join(states, key, to_frame)
        self._events.count("ego_doubles", joined.doubles)
        if not joined.known:
            reason = f"the ego is not known from {self.topic}: {joined.problem}"
            self._events.count("ego_missing", reason=reason)
        return joined

    def clear(self) -> None:
        """Forget the past, as after a jump of the clock."""
        with self._lock:
            self._odometry.clear()

    def close(self) -> None:
        """Destroy the subscription."""
        self._node.destroy_subscription(self._subscription)


def ego_source(node: Node, parameters: PredictorParameters, events: EventLog) -> EgoSource:
    """Return the subscription to the ego's odometry, or none without ``ego_topic``."""
    if not parameters.ego_topic:
        return NoEgo()
    return EgoSubscription(node, parameters, events)
