# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The recorder's subscriptions and remarks, in this process."""

import time

import pytest
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, ReliabilityPolicy
from ros_helpers import LATCHED, LIMIT_S
from rosbags.interfaces import QosDurability, QosReliability
from std_msgs.msg import String

from msg_adapters.bags.bag_reader import BagReader, DecodingBagReader
from msg_adapters.bags.mcap_writer import McapWriter
from mtpgo_ros.bags.recorder_node import Recorder


class Recording:
    """A recorder and a node that publishes, in one executor."""

    def __init__(self, path, peer, topics):
        self.path, self.peer = path, peer
        self.bag = McapWriter(path)
        self.node = Recorder(self.bag, topics)
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)

    def until(self, condition):
        end = time.monotonic() + LIMIT_S
        while not condition():
            assert time.monotonic() < end, "the condition did not come true in time"
            self.executor.spin_once(timeout_sec=0.02)

    def publish(self, topic, qos, *texts):
        """Publish when the recorder has subscribed and both sides have found each other."""
        publisher = self.peer.create_publisher(String, topic, qos)
        self.until(lambda: publisher.get_subscription_count() > 0)
        (subscription,) = (s for s in self.node.subscriptions if s.topic_name == topic)
        self.until(lambda: subscription.get_publisher_count() > 0)
        for text in texts:
            publisher.publish(String(data=text))


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
    lossy = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
    one.publish("/lossy", lossy, "b", "c")
    one.until(lambda: one.bag.messages == 3)
    one.bag.close()
    with BagReader(one.path) as bag:
        offered = {c.topic: c.ext.offered_qos_profiles[0] for c in bag.connections}
    assert offered["/kept"].durability is QosDurability.TRANSIENT_LOCAL
    assert offered["/kept"].reliability is QosReliability.RELIABLE
    assert offered["/lossy"].durability is QosDurability.VOLATILE
    assert offered["/lossy"].reliability is QosReliability.BEST_EFFORT
    with DecodingBagReader(one.path) as bag:
        texts = [m.data for c, _, m in bag.messages(bag.connections) if c.topic == "/lossy"]
    assert texts == ["b", "c"]


def test_the_predictors_own_topics_are_subscribed_to_before_they_are_published(recording):
    one = recording("/some/predictor/predictions", "/diagnostics", "/unknown")
    assert one.bag.has_topic("/some/predictor/predictions")
    assert one.bag.has_topic("/diagnostics")
    assert not one.bag.has_topic("/unknown")
    assert one.node.remarks() == "; no publisher on /unknown"


def test_messages_before_the_first_simulated_time_are_counted_and_left_out(recording):
    one = recording("/early")
    one.node.set_parameters([Parameter("use_sim_time", value=True)])
    one.publish("/early", 10, "a", "b")
    one.until(lambda: "2 came before" in one.node.remarks())
    assert one.node.remarks() == "; 2 came before /clock and were left out"
    assert one.bag.messages == 0
