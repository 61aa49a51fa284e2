# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The publishers of a node, without the node's other parts."""

import itertools

import pytest
from rclpy.executors import SingleThreadedExecutor
from rclpy.lifecycle import LifecycleNode
from rclpy.node import Node
from ros_helpers import START_NS, RecordingLogger, spin_until, traffic
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Float64
from visualization_msgs.msg import Marker, MarkerArray

from msg_adapters.predictions import prediction_from_pointcloud2
from mtpgo_core.history.track_history import TrackHistory
from mtpgo_core.prediction.constant_velocity import predict_constant_velocity
from mtpgo_core.task.task_description import HistoryConfig
from mtpgo_ros.diagnostics.event_log import EventLog
from mtpgo_ros.node.publishers import Publishers

_namespaces = itertools.count()


def prediction(agents=2, modes=3):
    history = TrackHistory(HistoryConfig())
    history.update(traffic(0.0, agents))
    return predict_constant_velocity(history.window(), horizon_steps=5, dt_s=0.2, modes=modes)


class Outputs:
    """Publishers on an active node and a subscriber for each topic."""

    def __init__(self, kinds, max_modes=3):
        namespace = f"/publishers{next(_namespaces)}"
        self.node = LifecycleNode("predictor", namespace=namespace)
        self.peer = Node("peer", namespace=namespace)
        self.logger = RecordingLogger()
        self.publishers = Publishers(self.node, kinds, max_modes, EventLog(self.logger))
        self.node.trigger_configure()
        self.node.trigger_activate()
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.executor.add_node(self.peer)
        self.clouds, self.markers, self.times = [], [], []

    def subscribe(self, kind, topic, received):
        self.peer.create_subscription(kind, f"predictor/{topic}", received.append, 10)
        name = self.peer.resolve_topic_name(f"predictor/{topic}")
        self.until(lambda: self.peer.count_publishers(name) == 1)
        publishers = [self.publishers._time, *self.publishers._publishers.values()]
        publisher = next(p for p in publishers if p.topic_name == name)
        self.until(lambda: publisher.get_subscription_count() == 1)

    def until(self, condition):
        spin_until(self.executor, condition)

    def close(self):
        self.publishers.close()
        self.executor.shutdown()
        self.node.destroy_node()
        self.peer.destroy_node()


@pytest.fixture
def make():
    made = []

    def make(*arguments, **options):
        made.append(Outputs(*arguments, **options))
        return made[-1]

    yield make
    for one in made:
        one.close()


def test_the_cloud_is_published_immediately_with_the_time_of_processing(make):
    outputs = make(("pointcloud2",))
    outputs.subscribe(PointCloud2, "predictions", outputs.clouds)
    outputs.subscribe(Float64, "debug/processing_time_ms", outputs.times)
    sent = prediction()
    outputs.publishers.publish(sent)
    outputs.until(lambda: outputs.clouds)
    received = prediction_from_pointcloud2(outputs.clouds[0])
    assert received.stamp_ns == START_NS
    assert received.mean == pytest.approx(sent.mean, abs=1e-4)
    assert not outputs.times
    outputs.publishers.publish_secondary(sent, 12.5)
    outputs.until(lambda: outputs.times)
    assert outputs.times[0].data == 12.5


def test_kinds_whose_messages_are_not_installed_are_left_out(make):
    outputs = make(("autoware", "pointcloud2"))
    assert outputs.publishers._kinds == ("pointcloud2",)
    assert "output autoware is left out: " in outputs.publishers.left_out["autoware"]
    assert not outputs.publishers.nothing
    outputs.publishers.configure(("autoware",), 3)
    assert outputs.publishers.nothing
    outputs.publishers.configure(("pointcloud2",), 3)
    assert not outputs.publishers.left_out
    assert not outputs.publishers.nothing


def test_fewer_modes_are_published_after_a_change(make):
    outputs = make(("pointcloud2",))
    outputs.subscribe(PointCloud2, "predictions", outputs.clouds)
    outputs.publishers.configure(("pointcloud2",), 1)
    outputs.publishers.publish(prediction(modes=3))
    outputs.until(lambda: outputs.clouds)
    assert prediction_from_pointcloud2(outputs.clouds[0]).weight.shape == (2, 1)


def test_a_kind_that_is_not_selected_is_not_published(make):
    outputs = make(("pointcloud2", "markers"))
    outputs.subscribe(PointCloud2, "predictions", outputs.clouds)
    outputs.subscribe(MarkerArray, "markers", outputs.markers)
    outputs.publishers.configure(("markers",), 3)
    outputs.publishers.publish(prediction())
    outputs.publishers.publish_secondary(prediction(), 1.0)
    outputs.until(lambda: outputs.markers)
    assert not outputs.clouds


def test_markers_are_deleted_from_the_displays_when_they_are_deselected(make):
    outputs = make(("pointcloud2", "markers"))
    outputs.subscribe(MarkerArray, "markers", outputs.markers)
    outputs.publishers.publish_secondary(prediction(), 1.0)
    outputs.until(lambda: outputs.markers)
    outputs.publishers.configure(("pointcloud2",), 3)
    outputs.until(lambda: len(outputs.markers) == 2)
    assert [marker.action for marker in outputs.markers[1].markers] == [Marker.DELETEALL]


def test_a_failing_secondary_output_is_logged_and_does_not_end_the_thread(make):
    outputs = make(("markers",))
    outputs.subscribe(MarkerArray, "markers", outputs.markers)
    writer = outputs.publishers._writers["markers"]

    def failing(_prediction):
        raise ValueError("no good")

    outputs.publishers._writers["markers"] = failing
    outputs.publishers.publish_secondary(prediction(), 1.0)
    outputs.until(lambda: outputs.logger.warnings)
    line = "output markers could not be published: ValueError: no good"
    assert outputs.logger.warnings == [line]
    outputs.publishers._writers["markers"] = writer
    outputs.publishers.publish_secondary(prediction(), 1.0)
    outputs.until(lambda: outputs.markers)
