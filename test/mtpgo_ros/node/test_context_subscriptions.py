# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Latched context topics: an ego's identity and lane markings."""

import itertools

import numpy as np
import pytest
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from ros_helpers import LATCHED, spin_until
from std_msgs.msg import String
from visualization_msgs.msg import MarkerArray

from msg_adapters.inputs import lane_markers
from msg_adapters.inputs.lane_markers import lanes_to_markers
from msg_adapters.types import RclpyTypes
from mtpgo_ros.diagnostics.event_log import EventLog
from mtpgo_ros.node.context_subscriptions import ContextSubscriptions

_namespaces = itertools.count()


@pytest.fixture
def node():
    one = Node("context", namespace=f"/context{next(_namespaces)}")
    yield one
    one.destroy_node()


def spin(node, condition):
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    spin_until(executor, condition)
    executor.shutdown()


def test_messages_published_before_the_subscription_are_received(node):
    lines = [np.array([[0.0, y], [100.0, y], [200.0, y]]) for y in (2.0, -2.0)]
    node.create_publisher(String, "ego_id", LATCHED).publish(String(data="7"))
    node.create_publisher(MarkerArray, "lane_markings", LATCHED).publish(
        lanes_to_markers(lines, RclpyTypes(), stamp_ns=0, frame_id="map")
    )
    egos, lanes = [], []
    context = ContextSubscriptions(
        node, egos.append, lambda road, frame_id: lanes.append((road, frame_id)), EventLog()
    )
    spin(node, lambda: egos and lanes)
    assert egos == ["7"]
    ((road, frame_id),) = lanes
    assert len(road) == 4  # two lines of two segments
    assert frame_id == "map"
    context.close()
    assert node.count_subscribers("ego_id") == node.count_subscribers("lane_markings") == 0


def test_a_model_without_lanes_does_not_subscribe_to_them(node):
    context = ContextSubscriptions(node, print, None, EventLog())
    assert node.count_subscribers("ego_id") == 1
    assert node.count_subscribers("lane_markings") == 0
    context.close()


def test_markings_that_cannot_be_used_are_refused_and_the_next_ones_taken(node, monkeypatch):
    monkeypatch.setattr(lane_markers, "MOST_BYTES", 500)
    publisher = node.create_publisher(MarkerArray, "lane_markings", LATCHED)
    lanes, refused = [], []
    context = ContextSubscriptions(node, print, None, EventLog())
    context.use_lanes(lambda road, frame_id: lanes.append(road), refused.append)
    spin(node, lambda: publisher.get_subscription_count())
    for x, words in (
        (np.linspace(0.0, 50.0, 51), "bytes, expected at most 500"),
        (np.array([0.0, 1e6]), "1000 km apart"),
    ):
        line = np.stack([x, np.zeros_like(x)], axis=1)
        publisher.publish(lanes_to_markers([line], RclpyTypes(), stamp_ns=0, frame_id="map"))
        spin(node, lambda words=words: refused and words in refused[-1])
    assert not lanes
    line = np.array([[0.0, 0.0], [50.0, 0.0]])
    publisher.publish(lanes_to_markers([line], RclpyTypes(), stamp_ns=0, frame_id="map"))
    spin(node, lambda: lanes)
    assert len(refused) == 2
    context.close()
