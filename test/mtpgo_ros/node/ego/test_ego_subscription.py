# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The ego in the running node: in the graph, predicted or not, lost, and without doubles."""

import dataclasses

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.parameter import Parameter
from ros_helpers import START_NS, message_of, traffic

from mtpgo_core.history.odd_input import ODD_INPUT
from mtpgo_core.identity import keys_from_texts
from mtpgo_core.schema import AgentClass, Source
from mtpgo_ros.diagnostics.event_log import EventLog
from mtpgo_ros.node.ego.ego_subscription import EgoSubscription, NoEgo, ego_source
from mtpgo_ros.parameters.predictor_parameters import PredictorParameters

EGO = keys_from_texts(["ego"])[0]
OK, WARN = DiagnosticStatus.OK, DiagnosticStatus.WARN


def odometry(time_s, *, frame="map", y=7.0):
    """The ego beside the traffic, at the same speed."""
    message = Odometry(child_frame_id="base_link")
    message.header.frame_id = frame
    stamp_ns = START_NS + round(time_s * 1e9)
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, 10**9)
    message.pose.pose.position.x, message.pose.pose.position.y = 10.0 * time_s, y
    message.pose.pose.orientation.w = 1.0
    message.twist.twist.linear.x = 10.0
    return message


class Ego:
    """A publisher of odometry that waits until the node has it."""

    def __init__(self, bench):
        self._bench = bench
        self._publisher = bench.peer.create_publisher(Odometry, "odom", 10)
        bench.until(lambda: self._publisher.get_subscription_count() > 0)
        self._buffer = bench.node._pipeline.ego._odometry

    def publish(self, message):
        stamp_ns = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
        self._publisher.publish(message)
        self._bench.until(lambda: (self._buffer._newest_ns or 0) >= stamp_ns)


def test_the_ego_lives_in_the_node_from_first_odometry_to_its_loss(bench):
    b = bench(ego_topic="odom", ego_class="truck", graph="ego")
    nothing = b.predict(traffic(0.0))
    assert len(nothing) == 4
    values = b.status("input", WARN, "no ego from")
    assert values["ego_topic"] == f"{b.namespace}/odom"
    assert b.count("ego_missing") == 1

    ego = Ego(b)
    for k in range(1, 6):
        ego.publish(odometry(0.2 * k))
        prediction = b.predict(traffic(0.2 * k))
        (row,) = np.flatnonzero((prediction.key == EGO).all(axis=1))
        assert len(prediction) == 5
    assert prediction.agent_class[row] == AgentClass.TRUCK
    assert prediction.source[row] == Source.MODEL
    assert prediction.mean[row, 0, 0, :2] == pytest.approx([12.0, 7.0], abs=2.0)
    b.status("model", OK)  # the policy ego needs no ego_id
    report = b.node._pipeline._model.predictor.last_report
    assert (report.graphs, report.largest_graph, report.by_model) == (1, 5, 5)

    # The tracker lists it too.
    states = traffic(1.2, agents=5)
    position = states.position.copy()
    position[4] = [12.5, 7.2]
    ego.publish(odometry(1.2))
    prediction = b.predict(dataclasses.replace(states, position=position))
    assert len(prediction) == 5
    assert not (prediction.key[:, 0] == 5).any()
    assert b.count("ego_doubles") == 1

    # In the graph, but not predicted.
    assert b.node.set_parameters_atomically(_values(ego_predicted=False)).successful
    ego.publish(odometry(1.4))
    prediction = b.predict(traffic(1.4))
    assert len(prediction) == 4
    assert not (prediction.key == EGO).all(axis=1).any()
    assert b.node._pipeline._model.predictor.last_report.largest_graph == 5
    assert b.node.set_parameters_atomically(_values(ego_predicted=True)).successful

    # A message whose objects are all unusable is no sign of life because of the ego.
    ego.publish(odometry(1.6))
    broken = traffic(1.6)
    b.send(message_of(dataclasses.replace(broken, position=np.full((4, 2), np.nan))))
    b.until(lambda: b.node._pipeline.watch.age(1.0).rejected == 1)

    # Lost: carried on for half a second, then gone.
    assert len(b.predict(traffic(2.0))) == 5
    assert len(b.predict(traffic(2.2))) == 4
    b.status("input", WARN, "its last odometry is 0.6 s older")
    ego.publish(odometry(2.4))
    assert len(b.predict(traffic(2.4))) == 5


def _values(**values):
    return [Parameter(name, value=value) for name, value in values.items()]


@pytest.fixture
def node():
    one = Node("ego")
    yield one
    one.destroy_node()


def parameters(**values):
    return dataclasses.replace(PredictorParameters(), **values)


def test_without_a_topic_the_objects_are_unchanged(node):
    source = ego_source(node, parameters(), EventLog())
    states = traffic(0.0)
    assert isinstance(source, NoEgo)
    assert source.join(states, None, lambda ego: ego).states is states


def test_unusable_odometry_is_counted_with_the_reason(node):
    events = EventLog()
    source = ego_source(node, parameters(ego_topic="odom"), events)
    assert isinstance(source, EgoSubscription)
    message = odometry(0.0)
    message.pose.pose.position.x = np.nan
    source._on_odometry(message)
    assert events.counts() == {"ego_refused": 1}
    (said,) = events.recent(ODD_INPUT)
    assert "could not be used (odometry" in said
    source.close()
    assert node.count_subscribers("odom") == 0
