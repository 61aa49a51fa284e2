# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Subscriptions to the context topics: the ego's identity and the lane markings.

The subscriptions are latched (transient local), so the last message arrives whenever the node
starts. A volatile or best-effort publisher is incompatible with such a subscription; when one
appears, a second, volatile best-effort subscription is created.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import (
    DurabilityPolicy,
    QoSProfile,
    ReliabilityPolicy,
    qos_policy_name_from_kind,
)
from rclpy.serialization import deserialize_message
from rclpy.subscription import Subscription
from std_msgs.msg import String
from visualization_msgs.msg import MarkerArray

from msg_adapters.inputs.lane_markers import check_serialized, lanes_from_markers
from mtpgo_core.scene.lane_map import LaneMap
from mtpgo_ros.diagnostics.event_log import REPEAT_S, EventLog
from mtpgo_ros.runtime.work_queue import WorkQueue

_LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)

_UNDEMANDING = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Fits every publisher that has no deadline or liveliness of its own to offer."""

OnLanes = Callable[[LaneMap, str], None]
"""Takes lane lines and their frame, on the thread that reads them."""

_PATIENCE_S = 0.1
"""How long closing waits for lane markings that are being read (s); chosen: transitions are to be
answered within 0.2 s."""


class ContextSubscriptions:
    """Subscriptions to ``ego_id`` and, for a model that uses lanes, ``lane_markings``.

    Args:
        node: the node.
        on_ego: called with the text of each message on ``ego_id``.
        on_lanes: called with the lane lines and their frame, None if they are not wanted.
        events: where incompatible publishers and unusable messages are counted and logged.
    """

    def __init__(
        self,
        node: Node,
        on_ego: Callable[[str], None],
        on_lanes: OnLanes | None,
        events: EventLog,
    ) -> None:
        self._node, self._events = node, events
        self._ego = _AnyPublisher(
            node, String, "ego_id", lambda message: on_ego(message.data), events
        )
        self._lanes: _LaneMarkings | None = None
        self.use_lanes(on_lanes)

    def use_lanes(
        self, on_lanes: OnLanes | None, on_refused: Callable[[str], None] = lambda reason: None
    ) -> None:
        """Subscribe to ``lane_markings`` if a function is given, else unsubscribe.

        Args:
            on_lanes: called with the lane lines and their frame.
            on_refused: called with the sentence that says why a message is not used.
        """
        if self._lanes is not None:
            self._lanes.close()
            self._lanes = None
        if on_lanes is not None:
            self._lanes = _LaneMarkings(self._node, on_lanes, on_refused, self._events)

    def close(self) -> None:
        """Destroy the subscriptions."""
        self._ego.close()
        self.use_lanes(None)


class _LaneMarkings:
    """The subscription to ``lane_markings``, whose messages are read on a separate thread.

    Reading the lines of a large site takes a second, which would block services and diagnostics.

    Args:
        node: the node.
        on_lanes: called with lane lines and their frame.
        on_refused: called with the sentence that says why a message is not used.
        events: where unusable messages are logged.
    """

    def __init__(
        self,
        node: Node,
        on_lanes: OnLanes,
        on_refused: Callable[[str], None],
        events: EventLog,
    ) -> None:
        self._node, self._events = node, events
        self._on_lanes, self._on_refused = on_lanes, on_refused
        self._told_s = float("-inf")
        self._subscription = _AnyPublisher(
            node, MarkerArray, "lane_markings", self._submit, events, raw=True
        )
        # Created last: if the above fails, nothing would end its thread.
        self._queue = WorkQueue(self._read, 1, "lane markings")

    def _submit(self, data: bytes) -> None:
        self._queue.submit(data)

    def _read(self, data: bytes) -> None:
        try:
            check_serialized(data)
            markings = lanes_from_markers(deserialize_message(data, MarkerArray))
            lanes = LaneMap(markings.polylines)
        except Exception as error:  # Whatever a message contains, the node keeps running.
            sentence = f"lane markings are not used: {error}"
            if not self._queue.stopped:
                self._events.log("lanes", sentence, is_error=True)
                self._on_refused(sentence)
            return
        if self._queue.stopped:
            return
        now_s = time.monotonic()  # The logger's own limit is by a clock that may be set back.
        if now_s - self._told_s > REPEAT_S:
            self._told_s = now_s
            self._node.get_logger().info(f"lane markings with {len(lanes)} segments taken")
        self._on_lanes(lanes, markings.frame_id)

    def close(self) -> None:
        """Destroy the subscription and end the thread."""
        self._queue.stop(_PATIENCE_S)
        self._subscription.close()


class _AnyPublisher:
    """A latched subscription and, once a publisher is incompatible, a volatile best-effort one.

    Args:
        node: the node.
        kind: message class.
        topic: name.
        receive: called with each message that differs from the last one.
        events: where incompatible publishers are counted.
        raw: give the bytes of each message.
    """

    def __init__(
        self,
        node: Node,
        kind: type,
        topic: str,
        receive: Callable[[Any], None],
        events: EventLog,
        *,
        raw: bool = False,
    ) -> None:
        self._node, self._kind, self._topic, self._raw = node, kind, topic, raw
        self._receive, self._events = receive, events
        self._last: Any = None
        self._subscriptions: list[Subscription] = []
        self._subscribe(_LATCHED, self._on_misfit)

    def _subscribe(self, qos: QoSProfile, on_incompatible: Callable[[Any], None]) -> None:
        self._subscriptions.append(
            self._node.create_subscription(
                self._kind,
                self._topic,
                self._on_message,
                qos,
                raw=self._raw,
                event_callbacks=SubscriptionEventCallbacks(incompatible_qos=on_incompatible),
            )
        )

    def _on_message(self, message: Any) -> None:
        # With two subscriptions, each message of a latched publisher comes twice.
        if len(self._subscriptions) > 1:
            if message == self._last:
                return
            self._last = message
        self._receive(message)

    def _on_misfit(self, event: Any) -> None:
        if len(self._subscriptions) > 1:
            return
        policy = qos_policy_name_from_kind(event.last_policy_kind)
        self._node.get_logger().info(
            f"a publisher on {self._topic} is not reliable and latched (QoS policy {policy}): what"
            " it publishes from now on is heard"
        )
        self._subscribe(_UNDEMANDING, self._on_incompatible)

    def _on_incompatible(self, event: Any) -> None:
        policy = qos_policy_name_from_kind(event.last_policy_kind)
        self._events.count(
            "qos_incompatible",
            event.total_count_change,
            f"a publisher on {self._topic} cannot be heard: its QoS policy {policy} does not fit",
            detail=f"{policy} on {self._topic}",
            is_error=True,
        )

    def close(self) -> None:
        """Destroy the subscriptions."""
        for subscription in self._subscriptions:
            self._node.destroy_subscription(subscription)
        self._subscriptions.clear()
