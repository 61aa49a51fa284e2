# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The subscription to the objects follows the type of the publisher."""

import itertools
import time

import pytest
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import serialize_message
from ros_helpers import message_of, spin_until, traffic
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import String

from mtpgo_core.errors import MessageError
from mtpgo_ros.diagnostics.event_log import EventLog
from mtpgo_ros.node.objects_subscription import LostMessages, ObjectsSubscription

RELIABLE = QoSProfile(depth=5, reliability=ReliabilityPolicy.RELIABLE)
_namespaces = itertools.count()


class Setup:
    """A node with the subscription and another one that publishes."""

    def __init__(self, input_type="auto"):
        namespace = f"/objects{next(_namespaces)}"
        self.node, self.peer = (Node(name, namespace=namespace) for name in ("node", "peer"))
        self.events, self.received = EventLog(), []
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.executor.add_node(self.peer)
        self.objects = ObjectsSubscription(
            self.node, input_type, lambda *given: self.received.append(given), self.events
        )

    def until(self, condition):
        spin_until(self.executor, condition)

    def close(self):
        self.objects.close()
        self.executor.shutdown()
        self.node.destroy_node()
        self.peer.destroy_node()


@pytest.fixture
def make():
    made = []

    def make(**options):
        made.append(Setup(**options))
        return made[-1]

    yield make
    for one in made:
        one.close()


def test_other_topics_with_objects_are_named_while_there_is_no_publisher(make):
    setup = make()
    for name in ("points", "tracks/fused"):
        setup.peer.create_publisher(PointCloud2, name, 5)
    setup.until(lambda: "objects may be on" in setup.objects.status)
    namespace = setup.node.get_namespace()
    status = setup.objects.status
    assert status.startswith(f"no publisher on {namespace}/objects yet; objects may be on ")
    assert f"{namespace}/tracks/fused (sensor_msgs/msg/PointCloud2)" in status
    assert status.endswith(": remap with -r objects:=TOPIC")
    assert "points" not in status
    setup.peer.create_publisher(PointCloud2, "objects", RELIABLE)
    setup.until(lambda: not setup.objects.status)


def test_it_waits_for_a_publisher_and_takes_its_type(make):
    setup = make()
    assert (setup.objects.message_type, "no publisher" in setup.objects.status) == ("", True)
    publisher = setup.peer.create_publisher(PointCloud2, "objects", RELIABLE)
    setup.until(lambda: publisher.get_subscription_count() == 1)
    assert setup.objects.message_type == "sensor_msgs/msg/PointCloud2"
    assert setup.objects.status == ""
    setup.until(lambda: setup.objects._subscription.get_publisher_count() == 1)
    before_ns = time.monotonic_ns()
    publisher.publish(message_of(traffic(0.0)))
    setup.until(lambda: setup.received)
    message, adapter, receipt = setup.received[0]
    assert (message.width, adapter.name) == (4, "pointcloud2")
    assert before_ns - 1_000_000_000 <= receipt.monotonic_ns <= time.monotonic_ns()
    assert not receipt.sender_set


def test_a_type_without_objects_is_named_in_the_status(make):
    setup = make()
    setup.peer.create_publisher(String, "objects", RELIABLE)
    setup.until(lambda: "std_msgs/msg/String" in setup.objects.status)
    assert setup.objects.message_type == ""


def test_a_given_type_is_subscribed_immediately(make):
    setup = make(input_type="markers")
    assert setup.objects.message_type == "visualization_msgs/msg/MarkerArray"


def test_a_given_type_that_is_not_installed_is_an_error():
    node = Node("not_installed")
    with pytest.raises(MessageError, match="ros-jazzy-autoware-perception-msgs"):
        ObjectsSubscription(node, "autoware", print, EventLog())
    node.destroy_node()


def test_corrections_of_lost_messages_are_not_counted():
    lost = LostMessages()
    wrapped = 2**64 - 3  # minus three
    assert [lost.add(change) for change in (5, wrapped, 2, 4, wrapped)] == [5, 0, 0, 3, 0]


def test_a_message_that_cannot_be_decoded_is_passed_as_its_error(make):
    setup = make()
    publisher = setup.peer.create_publisher(PointCloud2, "objects", RELIABLE)
    setup.until(lambda: publisher.get_subscription_count() == 1)
    setup.until(lambda: setup.objects._subscription.get_publisher_count() == 1)
    publisher.publish(serialize_message(message_of(traffic(0.0)))[:-40])
    setup.until(lambda: setup.received)
    error, _, _ = setup.received[0]
    assert isinstance(error, MessageError)
    assert "cannot be decoded" in str(error)


def test_a_best_effort_publisher_is_heard_beside_a_reliable_one(make):
    setup = make()
    setup.objects._choice.reliable = True
    first = setup.peer.create_publisher(PointCloud2, "objects", RELIABLE)
    setup.until(lambda: first.get_subscription_count() == 1)
    other = setup.peer.create_publisher(
        PointCloud2, "objects", QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
    )
    setup.until(lambda: other.get_subscription_count() == 1)
    setup.until(lambda: setup.objects._subscription.get_publisher_count() == 2)
    other.publish(message_of(traffic(0.0)))
    first.publish(message_of(traffic(0.2)))
    setup.until(lambda: len(setup.received) == 2)
    assert setup.events.counts() == {}
