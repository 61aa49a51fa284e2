# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What the node publishes of a prediction.

The cloud is the answer: it is made and published at once. Markers and the messages of other
stacks are larger; a thread of their own makes them where somebody listens, of the newest
prediction, so they delay nothing.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
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
from mtpgo_ros.node.latest_only import LatestOnly

_QOS = QoSProfile(depth=5)
_CLOUD, _MARKERS = "pointcloud2", "markers"
_TOPICS = {
    _CLOUD: "~/predictions",
    _MARKERS: "~/markers",
    "autoware": "~/predicted_objects",
}


class Outputs:
    """Publishers of all kinds wanted that can be published here; the choice may change.

    Args:
        node: the node that owns the publishers.
        kinds: wanted kinds.
        max_modes: modes of an agent.
        failed: told of an exception, with what was being done.
    """

    def __init__(
        self,
        node: LifecycleNode,
        kinds: tuple[str, ...],
        max_modes: int,
        failed: Callable[[str, Exception], None],
    ) -> None:
        self._node = node
        self._failed = failed
        self._types = RclpyTypes()
        # Held while a message is made or the choice changes.
        self._cloud_lock, self._side_lock = threading.Lock(), threading.Lock()
        self._publishers: dict[str, LifecyclePublisher] = {}
        self._writers: dict[str, Writer] = {}
        self._kinds: tuple[str, ...] = ()
        self._max_modes = 0
        self._time = node.create_lifecycle_publisher(Float64, "~/debug/processing_time_ms", _QOS)
        self.configure(kinds, max_modes)
        self._side = LatestOnly(self._publish_side, "side outputs")

    def configure(self, kinds: tuple[str, ...], max_modes: int) -> None:
        """Publish these kinds from the next prediction on."""
        with self._cloud_lock, self._side_lock:
            if _MARKERS in self._writers and (
                max_modes != self._max_modes or _MARKERS not in kinds
            ):
                self._clear_markers()
            if max_modes != self._max_modes:
                self._writers = {}
            self._max_modes = max_modes
            self._kinds = tuple(kind for kind in kinds if self._prepared(kind))

    def _prepared(self, kind: str) -> bool:
        """Make publisher and writer of a kind; false, with a log line, where that cannot be."""
        adapter = output_adapter(kind)
        try:
            if kind not in self._writers:
                # Bytes of markers take a twenty-fifth of the time of message objects.
                self._writers[kind] = adapter.writer(
                    self._types, max_modes=self._max_modes, serialized=True
                )
        except MessageError as error:
            self._node.get_logger().error(f"output {kind} is left out: {error}")
            return False
        if kind not in self._publishers:
            message_class = self._types.message_class(adapter.message_type)
            publisher = self._node.create_lifecycle_publisher(
                message_class,
                _TOPICS[kind],
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
        # Until discovery has ended on this side nothing is sent to a new subscriber: who must not
        # miss the first prediction waits for this line.
        if event.current_count_change > 0:
            topic = self._node.resolve_topic_name(_TOPICS[_CLOUD])
            self._node.get_logger().info(
                f"heard by {event.current_count} subscriber(s) on {topic}"
            )

    def publish(self, prediction: Prediction) -> None:
        """Publish the answer itself; safe from several threads."""
        with self._cloud_lock:
            if _CLOUD in self._kinds:
                self._publishers[_CLOUD].publish(self._writers[_CLOUD](prediction))

    def publish_rest(self, prediction: Prediction, processing_time_ms: float) -> None:
        """Publish the processing time, and hand the prediction on to the other kinds."""
        self._time.publish(Float64(data=processing_time_ms))
        if any(self._listened(kind) for kind in self._kinds):
            self._side.submit(prediction)

    def _listened(self, kind: str) -> bool:
        return kind != _CLOUD and self._publishers[kind].get_subscription_count() > 0

    def _publish_side(self, prediction: Prediction) -> None:
        for kind in self._kinds:
            try:
                with self._side_lock:
                    if kind in self._kinds and self._listened(kind):
                        self._publishers[kind].publish(self._writers[kind](prediction))
            except Exception as error:
                self._failed(f"output {kind} could not be published", error)

    def _clear_markers(self) -> None:
        """Take what has been drawn off the displays, and forget it."""
        publisher = self._publishers[_MARKERS]
        if publisher.is_activated:
            publisher.publish(clear_markers(self._types, stamp_ns=0, frame_id="map"))
        del self._writers[_MARKERS]

    def close(self) -> None:
        """Give the publishers back."""
        self._side.stop()
        with self._cloud_lock, self._side_lock:
            self._kinds = ()
            for publisher in (self._time, *self._publishers.values()):
                self._node.destroy_lifecycle_publisher(publisher)
