# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The publishers of the node.

The point cloud is published immediately. The secondary outputs, markers and the messages of other
stacks, are larger: a separate thread builds them from the newest prediction, and only while they
have subscribers, so that they delay nothing.
"""

from __future__ import annotations

import threading
from typing import Any

from rclpy.event_handler import PublisherEventCallbacks
from rclpy.lifecycle import LifecycleNode, LifecyclePublisher
from rclpy.qos import QoSProfile
from std_msgs.msg import Float64

from msg_adapters.outputs.prediction_markers import clear_markers
from msg_adapters.registry import Writer, output_adapter
from msg_adapters.types import RclpyTypes
from mtpgo_core.errors import MessageError
from mtpgo_core.schema import Prediction
from mtpgo_ros.diagnostics.event_log import EventLog
from mtpgo_ros.runtime.work_queue import WorkQueue

_QOS = QoSProfile(depth=5)
"""Reliable; a subscriber may fall behind by one second at 5 Hz."""
_CLOUD, _MARKERS = "pointcloud2", "markers"
OUTPUT_TOPICS = {
    _CLOUD: "~/predictions",
    _MARKERS: "~/markers",
    "autoware": "~/predicted_objects",
}


class Publishers:
    """One publisher for each selected kind of output; the selection may change.

    Args:
        node: the node that owns the publishers.
        kinds: selected kinds; those whose messages are not installed are left out.
        max_modes: most modes of an agent.
        events: where failures are logged.

    Attributes:
        left_out: the sentence that says why a selected kind is not published, by its name.
    """

    def __init__(
        self,
        node: LifecycleNode,
        kinds: tuple[str, ...],
        max_modes: int,
        events: EventLog,
    ) -> None:
        self._node = node
        self._events = events
        self._types = RclpyTypes()
        # Held while a message is built or the selection changes.
        self._cloud_lock, self._secondary_lock = threading.Lock(), threading.Lock()
        self._publishers: dict[str, LifecyclePublisher] = {}
        self._writers: dict[str, Writer] = {}
        self._kinds: tuple[str, ...] = ()
        self.left_out: dict[str, str] = {}
        self._max_modes = 0
        self._time = node.create_lifecycle_publisher(Float64, "~/debug/processing_time_ms", _QOS)
        self.configure(kinds, max_modes)
        self._secondary = WorkQueue(self._publish_secondary, 1, "secondary outputs")

    def configure(self, kinds: tuple[str, ...], max_modes: int) -> None:
        """Publish these kinds from the next prediction on."""
        with self._cloud_lock, self._secondary_lock:
            if _MARKERS in self._writers and (
                max_modes != self._max_modes or _MARKERS not in kinds
            ):
                self._clear_markers()
            if max_modes != self._max_modes:
                self._writers = {}
            self._max_modes = max_modes
            self.left_out = {}
            self._kinds = tuple(kind for kind in dict.fromkeys(kinds) if self._prepare(kind))

    @property
    def nothing(self) -> bool:
        """Whether no selected kind can be published."""
        return not self._kinds

    def _prepare(self, kind: str) -> bool:
        """Create publisher and writer of a kind; log and return false if that is impossible."""
        adapter = output_adapter(kind)
        try:
            if kind not in self._writers:
                # Serialized markers take a twenty-fifth of the time of message objects (measured).
                self._writers[kind] = adapter.writer(
                    self._types, max_modes=self._max_modes, serialized=True
                )
        except MessageError as error:
            self.left_out[kind] = f"output {kind} is left out: {error}"
            self._node.get_logger().error(self.left_out[kind])
            return False
        if kind not in self._publishers:
            message_class = self._types.message_class(adapter.message_type)
            publisher = self._node.create_lifecycle_publisher(
                message_class,
                OUTPUT_TOPICS[kind],
                _QOS,
                event_callbacks=PublisherEventCallbacks(
                    matched=self._on_matched if kind == _CLOUD else None
                ),
            )
            if self._time.is_activated:  # Added while the node is active.
                publisher.on_activate(None)
            self._publishers[kind] = publisher
        return True

    def _on_matched(self, event: Any) -> None:
        # Nothing is sent to a new subscriber before discovery has ended on this side. Scripts that
        # must not miss the first prediction wait for this line.
        if event.current_count_change > 0:
            topic = self._node.resolve_topic_name(OUTPUT_TOPICS[_CLOUD])
            self._node.get_logger().info(
                f"heard by {event.current_count} subscriber(s) on {topic}"
            )

    def publish(self, prediction: Prediction) -> None:
        """Publish the point cloud; thread-safe."""
        with self._cloud_lock:
            if _CLOUD in self._kinds:
                self._publishers[_CLOUD].publish(self._writers[_CLOUD](prediction))

    def publish_secondary(self, prediction: Prediction, processing_time_ms: float) -> None:
        """Publish the processing time, and start the secondary outputs."""
        self._time.publish(Float64(data=processing_time_ms))
        if any(self._has_subscribers(kind) for kind in self._kinds):
            self._secondary.submit(prediction)

    def _has_subscribers(self, kind: str) -> bool:
        """Return whether a secondary kind has subscribers."""
        return kind != _CLOUD and self._publishers[kind].get_subscription_count() > 0

    def _publish_secondary(self, prediction: Prediction) -> None:
        for kind in self._kinds:
            try:
                with self._secondary_lock:
                    if kind in self._kinds and self._has_subscribers(kind):
                        self._publishers[kind].publish(self._writers[kind](prediction))
                        self.left_out.pop(kind, None)
            except Exception as error:
                self.left_out[kind] = f"output {kind} is left out: it could not be made: {error}"
                self._events.failure(f"output {kind} could not be published", error)

    def _clear_markers(self) -> None:
        """Delete all published markers from the displays."""
        publisher = self._publishers[_MARKERS]
        if publisher.is_activated:
            publisher.publish(clear_markers(self._types, stamp_ns=0, frame_id="map"))
        del self._writers[_MARKERS]

    def close(self) -> None:
        """Destroy the publishers."""
        self._secondary.stop()
        with self._cloud_lock, self._secondary_lock:
            self._kinds = ()
            for publisher in (self._time, *self._publishers.values()):
                self._node.destroy_lifecycle_publisher(publisher)
