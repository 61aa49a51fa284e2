# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The node of the load generator: publishes observations and records when predictions arrive."""

from __future__ import annotations

import threading
import time
from typing import Any

import numpy as np
from rclpy.node import Node
from sensor_msgs.msg import PointCloud2
from visualization_msgs.msg import MarkerArray

from msg_adapters.conversions import stamp_to_ns
from msg_adapters.inputs.object_cloud import states_to_pointcloud2
from msg_adapters.ring_traffic import RingTraffic
from msg_adapters.types import RclpyTypes
from msg_adapters.wire.cloud import cloud_to_records
from mtpgo_core.schema import Source

_DEPTH = 10
"""Queue length of publisher and subscriptions."""


class LoadNode(Node):
    """Publishes observations and receives predictions.

    Args:
        agents: vehicles in each observation.
        predictor: name of the predictor's node.
        markers: subscribe to its markers.

    Attributes:
        received: for each prediction its stamp, its time of receipt (both ns), its number of
            agents, and how many of them were predicted at constant velocity.
        measured_from: monotonic time at which the measurement begins (ns), None before it is set.
        measured_until: monotonic time at which the measurement ends (ns).
    """

    def __init__(self, agents: int, predictor: str, markers: bool) -> None:
        super().__init__("load_generator")
        self._traffic = RingTraffic(agents)
        self._types = RclpyTypes()
        self._published: list[tuple[int, int]] = []
        self._heard_from: int | None = None
        self._marker_messages = 0
        self.received: list[tuple[int, int, int, int]] = []
        self.measured_from: int | None = None
        self.measured_until = 0
        self._out = self.create_publisher(PointCloud2, "objects", _DEPTH)
        name = "/" + predictor.strip("/")
        self.create_subscription(PointCloud2, f"{name}/predictions", self._on_prediction, _DEPTH)
        if markers:
            # Raw: decoding thousands of markers would delay the receipt of the predictions.
            topic = f"{name}/markers"
            self.create_subscription(MarkerArray, topic, self._on_markers, _DEPTH, raw=True)
        # Publication happens on another thread than everything else.
        self._lock = threading.Lock()

    def publish(self, time_s: float, stamp_ns: int) -> None:
        """Publish the traffic at a time (s) with a stamp (ns)."""
        message = states_to_pointcloud2(self._traffic.at(time_s, stamp_ns), self._types)
        if self._heard_from is None and self._out.get_subscription_count() > 0:
            self._heard_from = stamp_ns
        published_ns = time.monotonic_ns()
        self._out.publish(message)
        with self._lock:
            self._published.append((stamp_ns, published_ns))

    def _on_prediction(self, message: Any) -> None:
        received_ns = time.monotonic_ns()
        points = cloud_to_records(message)
        first = (points["mode"] == 0) & (points["step"] == 0)
        fallback = int(np.count_nonzero(points["source"][first] != Source.MODEL))
        stamp_ns = stamp_to_ns(message.header.stamp)
        self.received.append((stamp_ns, received_ns, int(first.sum()), fallback))

    def _on_markers(self, _message: Any) -> None:
        self._marker_messages += 1

    def result(self) -> dict[str, Any]:
        """Return everything that was recorded; times in ns of the monotonic clock."""
        with self._lock:
            return {
                "published": self._published,
                "received": self.received,
                "heard_from_stamp": self._heard_from,
                "measured_from": self.measured_from,
                "measured_until": self.measured_until,
                "marker_messages": self._marker_messages,
            }
