# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The recorder's subscriptions and remarks, in this process."""

import time

import pytest
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from ros_helpers import LATCHED, LIMIT_S
from rosbags.interfaces import QosDurability, QosReliability
from std_msgs.msg import Float32, String

from msg_adapters.bags.bag_reader import BagReader, DecodingBagReader
from msg_adapters.bags.live.live_bag_writer import LiveBagWriter
from mtpgo_ros.bags import recorder_node
from mtpgo_ros.bags.recorder_node import Recorder, predictor_types

LOSSY = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)


class Recording:
    """A recorder and a node that publishes, in one executor."""

    def __init__(self, path, peer, topics):
        self.path, self.peer = path, peer
        self.bag = LiveBagWriter(path)
        self.node = Recorder(self.bag, topics, predictor_types("/some/predictor"))
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)

    def until(self, condition):
        end = time.monotonic() + LIMIT_S
        while not condition():
            assert time.monotonic() < end, "the condition did not come true in time"
            self.executor.spin_once(timeout_sec=0.02)

    def publisher(self, topic, qos, kind=String):
        """Return a publisher whose topic the recorder has subscribed to, both sides knowing."""
        publisher = self.peer.create_publisher(kind, topic, qos)
        self.until(lambda: publisher.get_subscription_count() > 0)

        def subscribed():
            return [s for s in self.node.subscriptions if s.topic_name == topic]

        self.until(lambda: subscribed() and subscribed()[0].get_publisher_count() > 0)
        return publisher

    def publish(self, topic, qos, *texts):
        publisher = self.publisher(topic, qos)
        for text in texts:
            publisher.publish(String(data=text))
        return publisher

    def texts(self, topic):
        with DecodingBagReader(self.path) as bag:
            return [m.data for c, _, m in bag.messages(bag.connections) if c.topic == topic]


@pytest.fixture
def recording(tmp_path, peer):
    """Return a function that starts a recording; all are closed at the end."""
    made = []

    def make(*topics):
        made.append(Recording(tmp_path / "bag.mcap", peer, topics))
        return made[-1]

    yield make
    for one in made:
        one.executor.shutdown()
        one.node.destroy_node()
        one.bag.discard()


def test_a_topic_is_recorded_with_what_its_publisher_offers(recording):
    one = recording("/kept", "/lossy")
    one.publish("/kept", LATCHED, "a")
    one.publish("/lossy", LOSSY, "b", "c")
    one.until(lambda: one.bag.messages == 3)
    one.bag.close()
    with BagReader(one.path) as bag:
        offered = {c.topic: c.ext.offered_qos_profiles[0] for c in bag.connections}
    assert offered["/kept"].durability is QosDurability.TRANSIENT_LOCAL
    assert offered["/kept"].reliability is QosReliability.RELIABLE
    assert offered["/lossy"].durability is QosDurability.VOLATILE
    assert offered["/lossy"].reliability is QosReliability.BEST_EFFORT
    assert one.texts("/lossy") == ["b", "c"]
    assert one.node.remarks() == ""


def test_the_predictors_own_topics_are_subscribed_to_before_they_are_published(recording):
    one = recording("/some/predictor/predictions", "/diagnostics", "/unknown", "/x/predictions")
    subscribed = {s.topic_name for s in one.node.subscriptions}
    assert {"/some/predictor/predictions", "/diagnostics"} <= subscribed
    assert not {"/unknown", "/x/predictions"} & subscribed
    # The type of a topic without a publisher is not written down: it is not known.
    assert not one.bag.has_topic("/diagnostics")
    assert one.node.remarks() == (
        "; no publisher on /some/predictor/predictions, /diagnostics, /unknown, /x/predictions"
    )


@pytest.fixture
def stranger():
    """A node that may use a topic for another type than the nodes of this process do."""
    context = Context()
    rclpy.init(context=context, signal_handler_options=SignalHandlerOptions.NO)
    node = Node("stranger", context=context)
    yield node
    node.destroy_node()
    context.shutdown()


def test_the_publishers_type_counts_whatever_a_topic_is_called(recording, stranger):
    names = ("/some/predictor/predictions", "/other/predictions", "/x/processing_time_ms")
    one = recording(*names)
    one.peer = stranger
    for name in names[:2]:
        one.publish(name, 10, name)
    one.publisher(names[2], 10, Float32).publish(Float32(data=1.5))
    one.until(lambda: one.bag.messages == 3)
    one.bag.close()
    with BagReader(one.path) as bag:
        assert {(c.topic, c.msgtype) for c in bag.connections} == {
            (names[0], "std_msgs/msg/String"),
            (names[1], "std_msgs/msg/String"),
            (names[2], "std_msgs/msg/Float32"),
        }
    assert one.texts(names[0]) == [names[0]]


def test_a_publisher_that_comes_back_after_one_of_another_type_is_recorded(recording, stranger):
    one = recording("/x")
    one.peer = stranger
    for number, (kind, data) in enumerate([(String, "a"), (Float32, 1.5), (String, "b")]):
        publisher = one.publisher("/x", 10, kind)
        publisher.publish(kind(data=data))
        one.until(lambda number=number: one.bag.messages == number + 1)
        stranger.destroy_publisher(publisher)
        one.until(lambda: not one.node.get_publishers_info_by_topic("/x"))
    assert one.node.remarks() == ""
    one.bag.close()
    assert one.texts("/x") == ["a", 1.5, "b"]


def test_a_later_publisher_that_offers_less_is_heard_as_well(recording):
    one = recording("/x")
    first = one.publish("/x", LATCHED, "a")
    one.until(lambda: one.bag.messages == 1)
    one.publish("/x", LOSSY, "b")
    one.until(lambda: one.bag.messages == 2)
    one.until(lambda: first.get_subscription_count() > 0)
    first.publish(String(data="c"))
    one.until(lambda: one.bag.messages == 3)
    one.bag.close()
    assert one.texts("/x") == ["a", "b", "c"]


def test_topics_without_a_message_and_types_that_are_not_installed_are_named(recording):
    one = recording("/silent", "/nothing")
    one.publisher("/silent", 10)
    assert one.node.remarks() == (
        "; no publisher on /nothing; no message on /silent (std_msgs/msg/String)"
    )
    one.node._subscribe("/nothing", "no_msgs/msg/Nothing", reliable=True, latched=False)
    one.node._topics["/nothing"].published = True
    assert "; /nothing is not recorded: " in one.node.remarks()
    assert "no publisher" not in one.node.remarks()


def test_messages_before_the_first_simulated_time_are_counted_and_left_out(recording):
    one = recording("/early")
    one.node.set_parameters([Parameter("use_sim_time", value=True)])
    one.publish("/early", 10, "a", "b")
    one.until(lambda: "2 came before" in one.node.remarks())
    assert one.node.remarks().startswith("; 2 came before /clock and were left out")
    assert one.bag.messages == 0


def test_another_installed_definition_is_the_one_that_is_recorded(monkeypatch):
    kind = "std_msgs/msg/Header"
    assert recorder_node._other_definition(kind) == ""
    monkeypatch.setattr(recorder_node, "known_layout", lambda name: [("seq", "uint32")])
    text = recorder_node._other_definition(kind)
    assert text.startswith("builtin_interfaces/Time stamp\nstring frame_id\n")
    assert "MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n" in text
