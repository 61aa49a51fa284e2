# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Subscriptions to the context topics: the ego's identity and the lane markings.

They are made for latched publishers, whose last message comes whenever the node starts. A volatile
or best-effort publisher does not fit such a subscription; when one appears, a second subscription
hears it.
"""

from __future__ import annotations

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
from rclpy.subscription import Subscription
from std_msgs.msg import String
from visualization_msgs.msg import MarkerArray

from msg_adapters.inputs.lane_markers import lanes_from_markers
from mtpgo_core.errors import MtpgoError
from mtpgo_core.scene.lane_map import LaneMap
from mtpgo_ros.diagnostics.event_log import EventLog

_LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)

_UNDEMANDING = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Fits every publisher that has no deadline or liveliness of its own to offer."""

OnLanes = Callable[[LaneMap, str], None]
"""Takes lane lines and their frame."""


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
        self._lanes: _AnyPublisher | None = None
        self.use_lanes(on_lanes)

    def use_lanes(self, on_lanes: OnLanes | None) -> None:
        """Subscribe to ``lane_markings`` if a function is given, else unsubscribe."""
        if self._lanes is not None:
            self._lanes.close()
            self._lanes = None
        if on_lanes is not None:
            self._lanes = _AnyPublisher(
                self._node,
                MarkerArray,
                "lane_markings",
                lambda message: self._receive_lanes(message, on_lanes),
                self._events,
            )

    def _receive_lanes(self, message: Any, on_lanes: OnLanes) -> None:
        try:
            markings = lanes_from_markers(message)
            lanes = LaneMap(markings.polylines)
        except MtpgoError as error:
            self._events.log("lanes", f"lane markings are not used: {error}", is_error=True)
            return
        self._node.get_logger().info(
            f"lane markings with {len(lanes)} segments taken", throttle_duration_sec=5.0
        )
        on_lanes(lanes, markings.frame_id)

    def close(self) -> None:
        """Destroy the subscriptions."""
        self._ego.close()
        self.use_lanes(None)


class _AnyPublisher:
    """A latched subscription and, once a publisher does not fit it, an undemanding one.

    Args:
        node: the node.
        kind: message class.
        topic: name.
        receive: called with each message that differs from the last one.
        events: where incompatible publishers are counted.
    """

    def __init__(
        self,
        node: Node,
        kind: type,
        topic: str,
        receive: Callable[[Any], None],
        events: EventLog,
    ) -> None:
        self._node, self._kind, self._topic = node, kind, topic
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
            is_error=True,
        )

    def close(self) -> None:
        """Destroy the subscriptions."""
        for subscription in self._subscriptions:
            self._node.destroy_subscription(subscription)
        self._subscriptions.clear()
