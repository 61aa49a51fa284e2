# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What the node publishes of a prediction."""

from __future__ import annotations

import threading
from typing import Any

from rclpy.lifecycle import LifecycleNode
from rclpy.qos import QoSProfile
from std_msgs.msg import Float64

from msg_adapters.prediction_markers import clear_markers
from msg_adapters.registry import Writer, output_adapter
from msg_adapters.types import RclpyTypes
from mtpgo_core.errors import MessageError
from mtpgo_core.schema import Prediction

_QOS = QoSProfile(depth=5)
_TOPICS = {
    "pointcloud2": "~/predictions",
    "markers": "~/markers",
    "autoware": "~/predicted_objects",
}
_ALWAYS = "pointcloud2"
"""The one kind that is made whether somebody listens or not: it is the answer that is timed."""


class Outputs:
    """Publishers of all kinds that can be published here; which of them are used may change.

    Publishing is safe from several threads.

    Args:
        node: the node that owns the publishers.
        kinds: wanted kinds.
        max_modes: modes of an agent.
    """

    def __init__(self, node: LifecycleNode, kinds: tuple[str, ...], max_modes: int) -> None:
        self._node = node
        self._types = RclpyTypes()
        self._lock = threading.Lock()
        self._publishers: dict[str, Any] = {}
        self._writers: dict[str, Writer] = {}
        self._kinds: tuple[str, ...] = ()
        self._max_modes = 0
        self._time = node.create_lifecycle_publisher(Float64, "~/debug/processing_time_ms", _QOS)
        self.configure(kinds, max_modes)

    def configure(self, kinds: tuple[str, ...], max_modes: int) -> None:
        """Publish these kinds from the next prediction on."""
        with self._lock:
            if max_modes != self._max_modes:
                self._clear_markers()
                self._writers = {}
            elif "markers" in self._kinds and "markers" not in kinds:
                self._clear_markers()
                self._writers.pop("markers", None)
            self._max_modes = max_modes
            self._kinds = kinds
            for kind in kinds:
                self._prepare(kind)

    def _prepare(self, kind: str) -> None:
        """Make publisher and writer of a kind, or say why it is left out."""
        adapter = output_adapter(kind)
        try:
            if kind not in self._writers:
                self._writers[kind] = adapter.writer(self._types, max_modes=self._max_modes)
            if kind not in self._publishers:
                message_class = self._types.message_class(adapter.message_type)
                publisher = self._node.create_lifecycle_publisher(
                    message_class, _TOPICS[kind], _QOS
                )
                if self._time.is_activated:  # Added while the node is active.
                    publisher.on_activate(None)
                self._publishers[kind] = publisher
        except MessageError as error:
            self._node.get_logger().error(f"output {kind} is left out: {error}")

    def publish(self, prediction: Prediction) -> None:
        """Publish the answer itself."""
        with self._lock:
            if _ALWAYS in self._kinds and _ALWAYS in self._writers:
                self._publishers[_ALWAYS].publish(self._writers[_ALWAYS](prediction))

    def publish_rest(self, prediction: Prediction, processing_time_ms: float) -> None:
        """Publish the processing time, and the other kinds where somebody listens."""
        with self._lock:
            self._time.publish(Float64(data=processing_time_ms))
            for kind in self._kinds:
                if kind == _ALWAYS or kind not in self._writers:
                    continue
                publisher = self._publishers[kind]
                if publisher.get_subscription_count() > 0:
                    publisher.publish(self._writers[kind](prediction))

    def _clear_markers(self) -> None:
        """Take what has been drawn off the displays."""
        if "markers" in self._writers and self._publishers["markers"].is_activated:
            self._publishers["markers"].publish(
                clear_markers(self._types, stamp_ns=0, frame_id="map")
            )

    def close(self) -> None:
        """Give the publishers back."""
        for publisher in (self._time, *self._publishers.values()):
            self._node.destroy_lifecycle_publisher(publisher)
