# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The node of ``record``: raw subscriptions, made as publishers appear."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo

from msg_adapters.bags.mcap_writer import McapWriter
from msg_adapters.types import message_class
from mtpgo_core.errors import MessageError, RecordingError
from mtpgo_ros.runtime.ros_start import spin

_DEPTH = 200
"""Messages that may wait for the disk; chosen: eight seconds at 25 Hz."""

_POLL_S = 0.1
"""Interval of the search for new publishers (s); chosen: short for a user who waits."""

_KNOWN_TYPES = {
    "predictions": "sensor_msgs/msg/PointCloud2",
    "processing_time_ms": "std_msgs/msg/Float64",
    "diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
}
"""Types of the predictor's own topics by the last part of their name. These are subscribed to
before their publisher appears, so that its first message is recorded, too."""


def record(path: Path, topics: Sequence[str], stopped: Callable[[], bool]) -> str:
    """Record until asked to stop.

    Args:
        path: bag to be made.
        topics: absolute names.
        stopped: returns whether to stop.

    Returns:
        A sentence that says what was recorded.

    Raises:
        RecordingError: the output cannot be written.
    """
    with McapWriter(path) as bag:
        node = Recorder(bag, topics)
        print(f"ready: recording {', '.join(topics)} into {path}", flush=True)
        spin(node, stopped, handled=lambda: bag.messages)
    sentence = f"recorded {bag.messages} messages into {path}{node.remarks()}"
    node.destroy_node()
    return sentence


class Recorder(Node):
    """Subscribes to topics as their types become known and writes the bytes received.

    Args:
        bag: where the messages are written.
        topics: absolute names.
    """

    def __init__(self, bag: McapWriter, topics: Sequence[str]) -> None:
        super().__init__("record")
        self._bag = bag
        self._missing = list(topics)
        self._before_clock = 0
        for topic in topics:
            known = _KNOWN_TYPES.get(topic.rpartition("/")[2])
            if known is not None:
                self._subscribe(topic, known, [])
        self._find_publishers()
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = self.create_timer(_POLL_S, self._find_publishers, clock=steady)

    def _find_publishers(self) -> None:
        """Subscribe to the topics that have a publisher by now."""
        for topic in list(self._missing):
            infos = self.get_publishers_info_by_topic(topic)
            if infos:
                self._subscribe(topic, infos[0].topic_type, infos)

    def _subscribe(self, topic: str, message_type: str, infos: list[TopicEndpointInfo]) -> None:
        self._missing.remove(topic)
        profiles = [info.qos_profile for info in infos]
        reliable = all(p.reliability is ReliabilityPolicy.RELIABLE for p in profiles)
        latched = bool(profiles) and all(
            p.durability is DurabilityPolicy.TRANSIENT_LOCAL for p in profiles
        )
        qos = QoSProfile(
            depth=_DEPTH,
            reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
            durability=(
                DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE
            ),
        )
        try:
            kind = message_class(message_type)
            self._bag.add_topic(topic, message_type, latched=latched, reliable=reliable)
        except (MessageError, RecordingError) as error:
            self.get_logger().warning(f"topic {topic} is not recorded: {error}")
            return
        self.create_subscription(
            kind, topic, lambda data: self._on_message(topic, data), qos, raw=True
        )

    def _on_message(self, topic: str, data: Any) -> None:
        now_ns = self.get_clock().now().nanoseconds
        if now_ns == 0:
            # With use_sim_time there is no time yet; a message at 1970 would extend the bag.
            self._before_clock += 1
            return
        self._bag.write_bytes(topic, now_ns, data)

    def remarks(self) -> str:
        """Return what the user should know about messages that are not in the bag."""
        text = ""
        if self._before_clock:
            text += f"; {self._before_clock} came before /clock and were left out"
        if self._missing:
            text += f"; no publisher on {', '.join(self._missing)}"
        return text
