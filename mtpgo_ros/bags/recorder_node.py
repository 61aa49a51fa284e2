# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The node of ``record``: raw subscriptions, taken up as publishers appear."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo

from msg_adapters.types import message_class
from mtpgo_core.errors import MessageError, RecordingError
from mtpgo_ros.bags.bag_writer import BagSink
from mtpgo_ros.runtime.ros_start import spin

_DEPTH = 200
"""Messages that may wait for the disk; at 25 Hz that is eight seconds."""

_POLL_S = 0.1

_KNOWN_TYPES = {
    "predictions": "sensor_msgs/msg/PointCloud2",
    "processing_time_ms": "std_msgs/msg/Float64",
    "diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
}
"""Types of the predictor's own topics by the last part of their name: these are subscribed to
before their publisher appears, so not even its first message is missed."""


def record(path: Path, topics: Sequence[str], stopped: Callable[[], bool]) -> str:
    """Record until asked to stop.

    Args:
        path: folder to be made.
        topics: absolute names.
        stopped: says whether to stop.

    Returns:
        What was recorded, in words.

    Raises:
        RecordingError: the output cannot be written.
    """
    sink = BagSink(path)
    try:
        node = Recorder(sink, topics)
        print(f"ready: recording {', '.join(topics)} into {path}", flush=True)
        spin(node, stopped, handled=lambda: sink.messages)
    except BaseException:
        sink.discard()
        raise
    sink.close()
    sentence = f"recorded {sink.messages} messages into {path}{node.remarks()}"
    node.destroy_node()
    return sentence


class Recorder(Node):
    """Subscribes to the topics as their types become known and passes the bytes on.

    Args:
        sink: where the messages go.
        topics: absolute names.
    """

    def __init__(self, sink: BagSink, topics: Sequence[str]) -> None:
        super().__init__("record")
        self._sink = sink
        self._missing = list(topics)
        self._before_clock = 0
        for topic in topics:
            known = _KNOWN_TYPES.get(topic.rpartition("/")[2])
            if known is not None:
                self._take_up(topic, known, [])
        self._look()
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = self.create_timer(_POLL_S, self._look, clock=steady)

    def _look(self) -> None:
        """Take up the topics that have a publisher by now."""
        for topic in list(self._missing):
            infos = self.get_publishers_info_by_topic(topic)
            if infos:
                self._take_up(topic, infos[0].topic_type, infos)

    def _take_up(self, topic: str, message_type: str, infos: list[TopicEndpointInfo]) -> None:
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
            self._sink.add_topic(topic, message_type, latched=latched, reliable=reliable)
        except (MessageError, RecordingError) as error:
            self.get_logger().warning(f"topic {topic} is not recorded: {error}")
            return
        self.create_subscription(
            kind, topic, lambda data: self._on_message(topic, data), qos, raw=True
        )

    def _on_message(self, topic: str, data: Any) -> None:
        now_ns = self.get_clock().now().nanoseconds
        if now_ns == 0:
            # With use_sim_time there is no time yet; a message at 1970 would stretch the bag.
            self._before_clock += 1
            return
        self._sink.write(topic, now_ns, data)

    def remarks(self) -> str:
        """What the user should know about messages that are not in the bag."""
        text = ""
        if self._before_clock:
            text += f"; {self._before_clock} came before /clock and were left out"
        if self._missing:
            text += f"; nobody published {', '.join(self._missing)}"
        return text
