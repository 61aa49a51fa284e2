# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The node of ``record``: raw subscriptions with the types of the publishers."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from rclpy.clock import Clock, ClockType, ROSClock
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription
from rclpy.topic_endpoint_info import TopicEndpointInfo
from rclpy.validate_full_topic_name import validate_full_topic_name

from msg_adapters.bags.bag_definitions import known_layout
from msg_adapters.bags.live.live_bag_writer import LiveBagWriter
from msg_adapters.types import message_class
from mtpgo_core.errors import MessageError, RecordingError
from mtpgo_ros.bags.installed_types import installed_definition, require_installed_layout
from mtpgo_ros.runtime.clock_watch import EvenClock
from mtpgo_ros.runtime.executable import tell
from mtpgo_ros.runtime.ros_start import node_errors, spin

_DEPTH = 200
"""Messages that may wait for the disk; chosen: eight seconds at 25 Hz."""

_POLL_S = 0.1
"""Interval of the search for new publishers (s); chosen: short for a user who waits."""

_SILENT_S = 5.0
"""Topics without a message are reported after this time (s); chosen: more than discovery takes."""


def predictor_types(predictor: str) -> dict[str, str]:
    """Return the predictor's own topics with their types.

    They are subscribed to before their publisher appears, so that its first message is recorded,
    too. If a publisher has another type, its type counts.

    Args:
        predictor: absolute name of the node.
    """
    return {
        f"{predictor}/predictions": "sensor_msgs/msg/PointCloud2",
        f"{predictor}/debug/processing_time_ms": "std_msgs/msg/Float64",
        f"{predictor}/quality": "diagnostic_msgs/msg/DiagnosticArray",
        f"{predictor}/quality_table": "std_msgs/msg/Float64MultiArray",
        "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
    }


@dataclass(frozen=True)
class Recorded:
    """What was recorded.

    Attributes:
        messages: their number.
        sentence: what a user should know.
    """

    messages: int
    sentence: str


def record(
    path: Path, topics: Sequence[str], known: Mapping[str, str], stopped: Callable[[], bool]
) -> Recorded:
    """Record until asked to stop.

    Args:
        path: bag to be made.
        topics: absolute names.
        known: topics whose types are known beforehand.
        stopped: returns whether to stop.

    Raises:
        RecordingError: the output cannot be written, or no longer; what was written is kept.
        ConfigurationError: the name of a topic is not allowed, or ROS refuses the node.
    """
    with node_errors():
        for name in topics:
            validate_full_topic_name(name)
    with LiveBagWriter(path) as bag:
        with node_errors():
            node = Recorder(bag, topics, known)
        tell(f"ready: recording {', '.join(topics)} into {path}")
        try:
            spin(node, stopped, handled=lambda: bag.messages)
            bag.close()
        except RecordingError as error:
            raise RecordingError(
                f"{error}; the {bag.messages} messages ({bag.duration_s:.1f} s) written until then"
                f" are kept{node.remarks()}"
            ) from error
        finally:
            node.destroy_node()
    what = f"recorded {bag.messages} messages" if bag.messages else "recorded no message"
    return Recorded(bag.messages, f"{what} into {path}{node.remarks()}")


@dataclass
class _Topic:
    """A topic to be recorded.

    Attributes:
        message_type: type of the subscription, empty before there is one.
        subscription: None before a type is known.
        reliable, latched: QoS of the subscription.
        published: a publisher was found.
        messages: number of those recorded.
        problems: why something of it is not recorded.
    """

    message_type: str = ""
    subscription: Subscription | None = None
    reliable: bool = True
    latched: bool = False
    published: bool = False
    messages: int = 0
    problems: tuple[str, ...] = ()


class Recorder(Node):
    """Subscribes to topics with the types of their publishers and writes the bytes received.

    Args:
        bag: where the messages are written.
        topics: absolute names.
        known: topics whose types are known before they have a publisher.
    """

    def __init__(
        self, bag: LiveBagWriter, topics: Sequence[str], known: Mapping[str, str]
    ) -> None:
        super().__init__("record")
        self._bag = bag
        self._topics = {topic: _Topic() for topic in topics}
        self._before_clock = 0
        # Messages keep their order and distances in the bag when the machine's clock is set.
        self._machine = EvenClock()
        for name in topics:
            if name in known:
                self._subscribe(name, known[name], reliable=True, latched=False)
        self._find_publishers()
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = self.create_timer(_POLL_S, self._on_timer, clock=steady)
        self._silence = self.create_timer(_SILENT_S, self._report_silence, clock=steady)

    def _on_timer(self) -> None:
        self._machine.time_ns()
        self._find_publishers()
        self._bag.flush_if_due()

    def _find_publishers(self) -> None:
        """Subscribe to the topics by the types and QoS of the publishers found so far."""
        for name in self._topics:
            infos = self.get_publishers_info_by_topic(name)
            if infos:
                self._follow(name, infos)

    def _follow(self, name: str, infos: Sequence[TopicEndpointInfo]) -> None:
        """Subscribe to a topic with a QoS that all of its publishers of that type match."""
        topic = self._topics[name]
        types = sorted({info.topic_type for info in infos})
        # A node cannot subscribe to two types of one topic. What is recorded already goes on.
        chosen = topic.message_type if topic.message_type in types else types[0]
        others = [other for other in types if other != chosen]
        if others:
            self._warn(name, f"is recorded as {chosen} only, it is also {', '.join(others)}")
        profiles = [info.qos_profile for info in infos if info.topic_type == chosen]
        reliable = all(p.reliability is ReliabilityPolicy.RELIABLE for p in profiles)
        latched = all(p.durability is DurabilityPolicy.TRANSIENT_LOCAL for p in profiles)
        first, topic.published = not topic.published, True
        asked_too_much = (topic.reliable and not reliable) or (topic.latched and not latched)
        # The first publisher decides; a later one may only ask for less.
        latched = latched and (first or topic.latched)
        if chosen != topic.message_type or asked_too_much or (latched and not topic.latched):
            self._subscribe(name, chosen, reliable=reliable, latched=latched)
        if topic.subscription is not None:
            self._add_to_bag(name)

    def _subscribe(self, name: str, message_type: str, *, reliable: bool, latched: bool) -> None:
        topic = self._topics[name]
        if topic.subscription is not None:
            self.destroy_subscription(topic.subscription)
        topic.subscription, topic.message_type = None, message_type
        topic.reliable, topic.latched = reliable, latched
        qos = QoSProfile(
            depth=_DEPTH,
            reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
            durability=(
                DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE
            ),
        )
        try:
            kind = message_class(message_type)
        except MessageError as error:
            self._warn(name, f"is not recorded: {error}")
            return
        topic.subscription = self.create_subscription(
            kind, name, lambda data: self._on_message(name, data), qos, raw=True
        )

    def _add_to_bag(self, name: str) -> bool:
        """Add a topic to the bag once its type is known; return whether the bag has it."""
        topic = self._topics[name]
        if self._bag.type_of(name) == topic.message_type:
            return True
        try:
            self._bag.add_topic(
                name,
                topic.message_type,
                latched=topic.latched,
                reliable=topic.reliable,
                definition=_other_definition(topic.message_type),
            )
        except RecordingError as error:
            self._warn(name, f"is not recorded: {error}")
            return False
        return True

    def _on_message(self, name: str, data: Any) -> None:
        simulated = cast(ROSClock, self.get_clock()).ros_time_is_active
        now_ns = self.get_clock().now().nanoseconds if simulated else self._machine.time_ns()
        if now_ns == 0:
            # With use_sim_time there is no time yet; a message at 1970 would extend the bag.
            self._before_clock += 1
            return
        if self._add_to_bag(name):
            self._bag.write_bytes(name, now_ns, data)
            self._topics[name].messages += 1

    def _warn(self, name: str, problem: str) -> None:
        """Log a problem of a topic once, and keep it for the end."""
        topic = self._topics[name]
        if problem not in topic.problems:
            topic.problems = (*topic.problems, problem)
            self.get_logger().warning(f"topic {name} {problem}")

    def _report_silence(self) -> None:
        self.destroy_timer(self._silence)
        silent = self._silent(self._topics)
        if silent:
            self.get_logger().warning(f"after {_SILENT_S:g} s {silent}")

    def _silent(self, names: Collection[str]) -> str:
        """Return which topics have no publisher, and which have one and no message."""
        rest = [name for name in names if not self._topics[name].messages]
        missing = [name for name in rest if not self._topics[name].published]
        still = [
            f"{name} ({self._topics[name].message_type})"
            for name in rest
            if self._topics[name].published and not self._topics[name].problems
        ]
        parts = [f"no publisher on {', '.join(missing)}"] if missing else []
        if still:
            parts.append(f"no message on {', '.join(still)}")
        return "; ".join(parts)

    def remarks(self) -> str:
        """Return what the user should know about messages that are not in the bag."""
        parts = []
        if self._before_clock:
            parts.append(f"{self._before_clock} came before /clock and were left out")
        parts += [
            f"{name} {problem}"
            for name, topic in self._topics.items()
            for problem in topic.problems
        ]
        parts.append(self._silent(self._topics))
        return "".join(f"; {part}" for part in parts if part)


def _other_definition(message_type: str) -> str:
    """Return the installed definition of a type if it differs from the packaged one, else "".

    The packaged one, with its comments and constants, is written into bags by default.
    """
    try:
        require_installed_layout(message_type, known_layout(message_type))
    except MessageError:
        return installed_definition(message_type)
    return ""
