# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Streams that stop, change or carry nothing usable, over real DDS."""

import dataclasses
import time

import numpy as np
import pytest
from fault_harness import ERROR, OK, RELIABLE, WARN, check_invariants
from fault_tools import HealthListener, Resources, Stranger, change_state, reconnected, swap_model
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from ros_helpers import message_of, traffic
from std_msgs.msg import String
from visualization_msgs.msg import MarkerArray

from msg_adapters.inputs.lane_markers import lanes_to_markers
from msg_adapters.types import RclpyTypes


@pytest.fixture(scope="module")
def node(start_predictor):
    """The predictor of this module, which must have the same threads and memory at its end."""
    node = start_predictor(input_timeout=0.5, graph="ego")
    node.healthy(steps=3)
    before = Resources(node)
    yield node
    node.healthy()
    before.check()


@pytest.fixture(scope="module")
def health(node):
    """What a supervisor hears."""
    return HealthListener(node)


@pytest.fixture
def stranger(node):
    """Another participant with a publisher of a wrong type."""
    one = Stranger(node.namespace)
    yield one
    one.close()


def rows(states, kept):
    """Return some of the road users."""
    return dataclasses.replace(
        states, **{k: v[kept] for k, v in vars(states).items() if isinstance(v, np.ndarray)}
    )


def nowhere(states):
    """Return the states with no usable position."""
    return dataclasses.replace(states, position=np.full_like(states.position, np.nan))


def test_silence(node, health):
    node.fresh().healthy()
    node.level("input", ERROR, "stale")
    assert "the last usable observation" in node.statuses["input"].message
    node.level("timing", OK, "no prediction at present")
    health.becomes(ERROR, "stale")
    node.level_while_healthy("input", OK)
    # Its verdict follows a while later, and says since when.
    while health.heard[-1].level == ERROR:
        node.healthy()
        node.spin_for(0.1)
    assert health.heard[-1].level == WARN  # no ego is known yet


def test_a_volatile_publisher_of_the_ego(node):
    node.fresh().healthy()
    node.level("model", WARN, "no ego")
    publisher = node.peer.create_publisher(String, "ego_id", 10)
    node.process.wait_for("what it publishes from now on is heard", node.spin)

    def heard():
        publisher.publish(String(data="3"))
        node.spin()
        return "ego is '3'" in "".join(node.process.err)

    node.until(heard, "the ego")
    node.level_while_healthy("model", OK)


def test_a_latched_publisher_of_the_ego_beside_a_volatile_one(node):
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    publisher = node.peer.create_publisher(String, "ego_id", latched)
    publisher.publish(String(data="2"))
    node.process.wait_for("ego is '2'", node.spin)
    node.fresh().healthy()
    node.level_while_healthy("model", OK)


def test_two_publishers_of_different_egos(node):
    qos = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    one, other = (node.peer.create_publisher(String, "ego_id", qos) for _ in range(2))
    node.fresh().healthy()

    def chosen():
        """Return the log's lines about the ego."""
        return [line for line in node.process.err if "ego is" in line]

    def repeated():
        """Return whether the log sums up that the ego changes all the time."""
        for publisher, name in ((one, "2"), (other, "3")):
            publisher.publish(String(data=name))
            node.spin_for(0.05)
        return any("the choice before is" in line and "more since" in line for line in chosen())

    before, begin_s = len(chosen()), time.monotonic()
    node.until(repeated, "a line with the number of changes")
    # One every five seconds, and the first as information.
    assert len(chosen()) - before <= 2 + (time.monotonic() - begin_s) / 5.0
    node.healthy()


def test_empty_arrays(node):
    node.fresh().healthy()
    with node.counts(empty_messages=4):
        for _ in range(2):  # carried on for half a second
            states = traffic(node.states().stamp_ns * 0 + node.time_s, agents=0)
            node.send(states)
            assert len(node.answer(states.stamp_ns).prediction) == 4
        node.time_s += 0.4
        for _ in range(2):
            states = node.states(agents=0)
            node.send(states)
            assert len(node.answer(states.stamp_ns).prediction) == 0
    node.level("model", OK, "no agent to be predicted")
    node.healthy()


def test_a_track_lost_for_a_third_of_a_second(node):
    node.fresh().healthy(steps=3)
    others = rows(node.states(), [0, 1, 2])
    node.predict(others, served=[1, 2, 3, 4])
    node.healthy(steps=2)


def test_a_track_lost_for_two_seconds(node):
    node.fresh().healthy(steps=3)
    for step in range(10):
        others = rows(node.states(), [0, 1, 2])
        node.predict(others, served=[1, 2, 3, 4] if step < 2 else [1, 2, 3])
    with node.counts(restarted=0):
        node.healthy(steps=2)


def test_an_agent_seen_once(node):
    node.fresh().healthy()
    node.healthy(agents=5)
    for step in range(4):
        node.predict(node.states(), served=[1, 2, 3, 4, 5] if step < 2 else None)


def test_one_message_in_another_frame(node):
    node.fresh().healthy()
    with node.counts(frame_changed=1, wrong_frame=4):
        node.send(node.states(frame_id="odom"))
    node.healthy()
    assert node.said("input", WARN, "another frame")


def test_a_stream_that_changes_its_frame(node):
    node.fresh().healthy()
    for _ in range(3):
        states = node.states(frame_id="odom")
        node.send(states)
    node.check(node.answer(states.stamp_ns).prediction, states)
    for _ in range(3):
        states = node.states()
        node.send(states)
    node.check(node.answer(states.stamp_ns).prediction, states)
    node.healthy()


def test_only_rejected_messages(node, health):
    node.fresh().healthy()
    first = len(node.answers)

    def broken():
        message = message_of(node.states())
        message.data = message.data[:40]
        node.send(message)
        node.spin_for(0.05)
        return node.statuses["input"].level == ERROR

    node.until(broken, "an error")
    assert "messages since were rejected" in node.statuses["input"].message
    assert "could not be read" in node.statuses["input"].message
    assert len(node.answers) == first
    health.becomes(ERROR, "rejected")
    node.level_while_healthy("input", OK)


def test_only_rejected_objects(node):
    node.fresh().healthy()
    first = len(node.answers)

    def rejected():
        node.send(nowhere(node.states()))
        node.spin_for(0.05)
        return node.statuses["input"].level == ERROR

    node.until(rejected, "an error")
    assert "without a finite position" in node.statuses["input"].message
    # What was known is carried on, then nothing is published: the road is not known to be empty.
    assert all(len(a.prediction) == 4 for a in node.answers[first:])
    assert len(node.answers) <= first + 3
    node.level_while_healthy("input", OK)


def test_a_wrong_type_beside_the_right_one_and_the_silence_after_it(node, stranger):
    node.fresh().healthy()
    wrong = stranger.node.create_publisher(String, "objects", 10)
    node.level_while_healthy("input", WARN, "std_msgs")
    stranger.node.destroy_publisher(wrong)
    node.level_while_healthy("input", OK)
    node.level("input", ERROR, "stale")
    node.level_while_healthy("input", OK)


def test_a_publisher_that_dies_and_returns(node):
    node.fresh().healthy()
    node.peer.destroy_publisher(node.objects)
    node.level("input", ERROR, "stale")
    node.objects = node.publisher()
    reconnected(node)
    node.fresh().healthy()
    node.level_while_healthy("input", OK)


def test_a_wrong_type_after_the_right_one(node, stranger):
    node.fresh().healthy()
    node.peer.destroy_publisher(node.objects)
    wrong = stranger.node.create_publisher(String, "objects", 10)
    node.level("input", ERROR, "std_msgs/msg/String")
    assert "stale" in node.statuses["input"].message
    stranger.node.destroy_publisher(wrong)
    node.objects = node.publisher()
    reconnected(node)
    node.level_while_healthy("input", OK)


def test_a_wrong_type_before_the_right_one(node, stranger):
    node.peer.destroy_publisher(node.objects)
    assert change_state(node, "deactivate")
    node.level("input", WARN, "not active (inactive)")
    wrong = stranger.node.create_publisher(String, "objects", 10)
    assert change_state(node, "activate")
    node.level("input", WARN, "std_msgs/msg/String")
    node.objects = node.publisher()
    reconnected(node)
    stranger.node.destroy_publisher(wrong)
    node.level_while_healthy("input", OK)


@pytest.mark.parametrize(
    "qos",
    [
        QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT),
        QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL),
    ],
    ids=["best effort", "latched"],
)
def test_a_publisher_with_another_qos(node, qos):
    node.peer.destroy_publisher(node.objects)
    node.objects = node.publisher(qos=qos)
    reconnected(node)
    first = len(node.answers)
    node.until(lambda: node.send(node.states()) or node.spin() or len(node.answers) > first)
    node.peer.destroy_publisher(node.objects)
    node.objects = node.publisher(qos=RELIABLE)
    reconnected(node)
    node.level_while_healthy("input", OK)


def test_a_volatile_publisher_of_lane_markings(node, models):
    assert swap_model(node, models["lanes"]).successful
    node.fresh().healthy()
    node.level("model", WARN, "lane_markings")
    publisher = node.peer.create_publisher(MarkerArray, "lane_markings", 10)
    lines = [np.array([[-5000.0, y], [5000.0, y]]) for y in (2.0, -2.0)]
    message = lanes_to_markers(lines, RclpyTypes(), stamp_ns=0, frame_id="map")

    def heard():
        publisher.publish(message)
        node.spin()
        return "segments taken" in "".join(node.process.err)

    node.until(heard, "the lanes")
    node.level_while_healthy("model", OK)
    for answer in node.answers:
        check_invariants(answer.prediction)
    assert swap_model(node, models["quick"]).successful
