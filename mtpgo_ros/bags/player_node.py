# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The node of ``replay``: raw publishers, the clock and the progress bar."""

from __future__ import annotations

import select
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import rclpy
from builtin_interfaces.msg import Time
from rclpy.duration import Duration
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosgraph_msgs.msg import Clock
from tqdm import tqdm
from visualization_msgs.msg import MarkerArray

from msg_adapters.bags.bag_definitions import BagDefinitions
from msg_adapters.bags.bag_reader import BagReader, BagTopic
from msg_adapters.conversions import LAST_S
from msg_adapters.inputs.lane_markers import MOST_POINTS, lanes_to_markers
from msg_adapters.types import RclpyTypes, message_class
from mtpgo_core.errors import ConfigurationError, MessageError, RecordingError
from mtpgo_core.schema import Float64Array
from mtpgo_ros.bags.installed_types import require_installed_layout
from mtpgo_ros.bags.playback import Message, PlaybackTiming, Report, Sinks, play
from mtpgo_ros.runtime.clock_watch import watched_clock
from mtpgo_ros.runtime.executable import tell
from mtpgo_ros.runtime.ros_start import node_errors, wake_middleware

LANES_TOPIC = "/lane_markings"

_S_NS = 1_000_000_000

_POLL_S = 0.02
"""Polling interval while the player waits (s); chosen: not noticeable."""

_ARRIVAL_S = 1.0
"""Longest time that the last messages have to arrive (s); chosen: a subscriber may be stopped."""

_PAUSE_S = 1.0
"""Time between two repetitions of a part without a duration, as one message is (s); chosen."""

_PARTICIPANT_BYTES = 12
"""Bytes of an endpoint's identifier that are of its participant (DDSI-RTPS, GUID prefix)."""

_MOST_LATCHED = 1000
"""Most messages of a latched topic kept for late subscribers; chosen: bounds the memory."""


@dataclass(frozen=True)
class Wait:
    """What the player waits for before it starts.

    Attributes:
        subscribers: number of subscribing nodes that one of the topics must have.
        timeout_s: longest time to wait for them (s).
        delay_s: time for discovery after the subscribers are there (s).
        paused: wait after that for a line on standard input.
    """

    subscribers: int
    timeout_s: float
    delay_s: float
    paused: bool = False


class BagPlayer:
    """Publishes the topics of a bag.

    Args:
        bag: the open bag.
        timing: which part to play, and how fast.
        topics: which of its topics to play.

    Raises:
        RecordingError: none of the topics can be played here, or its times are beyond those that
            ``/clock`` can show.
    """

    def __init__(self, bag: BagReader, timing: PlaybackTiming, topics: Sequence[BagTopic]) -> None:
        self._bag, self._timing = bag, timing
        if timing.clock_hz > 0.0:
            _require_times_of_clock(bag, timing)
            topics = [topic for topic in topics if topic.name != "/clock"]
        with node_errors():
            self._node = rclpy.create_node("replay")
        self._publishers: dict[str, Publisher] = {}
        definitions = BagDefinitions(bag.connections)
        for topic in topics:
            try:
                for connection in bag.connections_of(topic):
                    layout = definitions.layout(connection)
                    require_installed_layout(topic.message_type, layout)
                with node_errors():
                    self._publishers[topic.name] = self._publisher(topic)
            except (ConfigurationError, MessageError) as error:
                tell(f"replay: skipping {topic.name}: {error}", error=True)
        self._topics = [topic for topic in topics if topic.name in self._publishers]
        if not self._topics:
            self.close()
            types = ", ".join(sorted({topic.message_type for topic in topics})) or "none"
            raise RecordingError(
                f"bag {bag.path} holds no topic that can be played here, its types: {types}"
            )
        self._clock: Publisher | None = None
        if timing.clock_hz > 0.0:
            self._clock = self._node.create_publisher(Clock, "/clock", QoSProfile(depth=10))

    def _publisher(self, topic: BagTopic) -> Publisher:
        qos = QoSProfile(depth=10)
        if topic.latched:
            qos = QoSProfile(
                depth=min(topic.count, _MOST_LATCHED), durability=DurabilityPolicy.TRANSIENT_LOCAL
            )
        return self._node.create_publisher(message_class(topic.message_type), topic.name, qos)

    def publish_lanes(self, lines: Sequence[Float64Array], frame_id: str) -> None:
        """Publish lane lines on ``/lane_markings``, for late subscribers as well.

        Raises:
            ConfigurationError: more points than subscribers take.
        """
        number = sum(map(len, lines))
        if number > MOST_POINTS:
            raise ConfigurationError(
                f"--lane-file has {number} points of lane lines, expected at most {MOST_POINTS}"
                " for a message: give the file to the predictor (lane_file)"
            )
        qos = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        publisher = self._node.create_publisher(MarkerArray, LANES_TOPIC, qos)
        publisher.publish(lanes_to_markers(lines, RclpyTypes(), stamp_ns=0, frame_id=frame_id))

    def wait(self, wait: Wait, stopped: Callable[[], bool]) -> bool:
        """Wait for the subscribers and for discovery; return False when stopped meanwhile.

        Raises:
            RecordingError: too few subscribers appeared in time.
            ConfigurationError: there is no standard input to wait for a line on.
        """
        end = time.monotonic() + wait.timeout_s
        while not stopped() and self._subscribers() < wait.subscribers:
            if time.monotonic() > end:
                raise RecordingError(
                    f"{self._subscribers()} subscribers after {wait.timeout_s:g} s on the topics"
                    f" {', '.join(self._publishers)}, expected {wait.subscribers}"
                )
            time.sleep(_POLL_S)
        _rest(wait.delay_s, stopped)
        if wait.paused and not stopped():
            if sys.stdin is None:
                raise ConfigurationError(
                    "--start-paused waits for Enter on standard input, which is closed"
                )
            tell("paused: press Enter to start")
            while not stopped() and not select.select([sys.stdin], [], [], _POLL_S)[0]:
                pass
        return not stopped()

    def _subscribers(self) -> int:
        """Return how many nodes subscribe to the topic that has most of them.

        Nodes, not subscriptions: while a node subscribes anew it has two.
        """
        return max(map(self._subscribers_of, self._publishers.values()))

    def _subscribers_of(self, publisher: Publisher) -> int:
        subscriptions = self._node.get_subscriptions_info_by_topic(publisher.topic_name)
        # The participant comes first in an identifier; names are known a little later than it.
        nodes = {
            (tuple(info.endpoint_gid[:_PARTICIPANT_BYTES]), info.node_namespace, info.node_name)
            for info in subscriptions
        }
        return min(len(nodes), publisher.get_subscription_count())

    def run(self, stopped: Callable[[], bool], *, loop: bool, progress: bool) -> Report:
        """Play the topics once, or again and again until stopped.

        Args:
            stopped: returns whether to stop.
            loop: start again at the end.
            progress: show a progress bar on stderr.

        Raises:
            RecordingError: the bag is damaged.
        """
        report = Report()
        self._publish_latched_before_start()
        with (
            watched_clock(lambda _: None, lambda: wake_middleware(self._node)),
            _Progress(self._timing, hidden=not progress) as bar,
        ):
            sinks = Sinks(self._publish, self._tick, bar.reached, stopped)
            play(self._messages(), self._timing, sinks, report)
            pause_s = 0.0 if self._timing.end_ns > self._timing.origin_ns else _PAUSE_S
            if loop and pause_s:
                tell(
                    f"replay: all messages are of one time: they are repeated every {pause_s:g} s",
                    error=True,
                )
            while loop and not stopped():
                _rest(pause_s, stopped)
                bar.restart()
                play(self._messages(), self._timing, sinks, report)
        self._let_arrive(stopped)
        return report

    def _let_arrive(self, stopped: Callable[[], bool]) -> None:
        """Wait until the last messages have arrived, for a time that all topics share."""
        end = time.monotonic() + _ARRIVAL_S
        for publisher in self._publishers.values():
            left_s = end - time.monotonic()
            if stopped() or left_s <= 0.0:
                return
            publisher.wait_for_all_acked(Duration(nanoseconds=round(1e9 * left_s)))

    def _messages(self) -> Iterator[Message]:
        return self._bag.raw_messages(
            self._topics, self._timing.origin_ns, self._timing.end_ns + 1
        )

    def _publish_latched_before_start(self) -> None:
        """Publish the latched messages that came before the start offset."""
        latched = [topic for topic in self._topics if topic.latched]
        if latched and self._timing.origin_ns > self._bag.start_ns:
            for topic, _, data in self._bag.raw_messages(
                latched, self._bag.start_ns, self._timing.origin_ns
            ):
                self._publish(topic, data)

    def _publish(self, topic: str, data: bytes) -> None:
        self._publishers[topic].publish(data)

    def _tick(self, time_ns: int) -> None:
        if self._clock is not None:
            seconds, nanoseconds = divmod(time_ns, _S_NS)
            self._clock.publish(Clock(clock=Time(sec=seconds, nanosec=nanoseconds)))

    def close(self) -> None:
        """Destroy the node and its publishers."""
        self._node.destroy_node()


def _require_times_of_clock(bag: BagReader, timing: PlaybackTiming) -> None:
    """Check that /clock can show all times that are played: it would show others instead."""
    first_s, last_s = timing.origin_ns // _S_NS, timing.end_ns // _S_NS
    if first_s < -LAST_S or last_s > LAST_S:
        raise RecordingError(
            f"bag {bag.path}: its times reach from {first_s} s to {last_s} s, but /clock can only"
            f" show up to {LAST_S} s (in the year 2038); --clock-rate 0 plays it without /clock"
        )


def _rest(seconds: float, stopped: Callable[[], bool]) -> None:
    """Wait for a time (s), or until stopped."""
    end = time.monotonic() + seconds
    while not stopped() and time.monotonic() < end:
        time.sleep(_POLL_S)


class _Progress:
    """A progress bar in seconds of the recording, on stderr."""

    _INTERVAL_S = 0.2

    def __init__(self, timing: PlaybackTiming, *, hidden: bool) -> None:
        self._origin_ns = timing.origin_ns
        self._drawn = 0.0
        self._bar = tqdm(
            total=(timing.end_ns - timing.origin_ns) * 1e-9,
            desc="replay",
            disable=hidden or sys.stderr is None,
            bar_format="{desc}: {percentage:3.0f}%|{bar}| {n:.1f}/{total:.1f} s",
        )

    def __enter__(self) -> _Progress:
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.close()

    def reached(self, time_ns: int) -> None:
        """Show the log time reached (ns), a few times a second."""
        now = time.monotonic()
        if now - self._drawn >= self._INTERVAL_S:
            self._drawn = now
            self._bar.n = (time_ns - self._origin_ns) * 1e-9
            self._bar.refresh()

    def restart(self) -> None:
        """Show the start of another pass."""
        self._bar.reset()
