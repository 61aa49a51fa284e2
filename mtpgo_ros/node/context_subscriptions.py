# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Subscriptions to the latched context topics: the ego's identity and the lane markings."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String
from visualization_msgs.msg import MarkerArray

from msg_adapters.inputs.lane_markers import lanes_from_markers
from mtpgo_core.errors import MtpgoError
from mtpgo_core.scene.lane_map import LaneMap

_LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class ContextSubscriptions:
    """Subscriptions to ``ego_id`` and, for a model that uses lanes, ``lane_markings``.

    Args:
        node: the node.
        on_ego: called with the text of each message on ``ego_id``.
        on_lanes: called with the lane lines, None if the model does not use them.
    """

    def __init__(
        self,
        node: Node,
        on_ego: Callable[[str], None],
        on_lanes: Callable[[LaneMap], None] | None,
    ) -> None:
        self._node = node
        self._on_ego = on_ego
        self._subscriptions = [
            node.create_subscription(String, "ego_id", self._receive_ego, _LATCHED)
        ]
        if on_lanes is not None:
            self._subscriptions.append(
                node.create_subscription(
                    MarkerArray,
                    "lane_markings",
                    lambda message: self._receive_lanes(message, on_lanes),
                    _LATCHED,
                )
            )

    def _receive_ego(self, message: Any) -> None:
        self._on_ego(message.data)

    def _receive_lanes(self, message: Any, on_lanes: Callable[[LaneMap], None]) -> None:
        try:
            lanes = LaneMap(lanes_from_markers(message).polylines)
        except MtpgoError as error:
            self._node.get_logger().error(f"lane markings are not used: {error}")
            return
        self._node.get_logger().info(f"lane markings with {len(lanes)} segments taken")
        on_lanes(lanes)

    def close(self) -> None:
        """Destroy the subscriptions."""
        for subscription in self._subscriptions:
            self._node.destroy_subscription(subscription)
