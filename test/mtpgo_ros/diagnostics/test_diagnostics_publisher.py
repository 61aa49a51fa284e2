# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""When diagnostics are published: regularly, and when a level changes."""

import time
from datetime import UTC, datetime
from types import SimpleNamespace

import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from ros_helpers import spin_until

from mtpgo_ros.diagnostics.diagnostic_status import NodeStatus, diagnostic_statuses
from mtpgo_ros.diagnostics.diagnostics_publisher import DiagnosticsPublisher
from mtpgo_ros.diagnostics.event_log import EventLog
from mtpgo_ros.diagnostics.health import Verdict
from mtpgo_ros.diagnostics.input_watch import InputAge


@pytest.fixture
def setup():
    """The publisher of a node, and a list in which its messages are collected."""
    node, published = Node("diagnosed", namespace="/robot"), []
    status, events = NodeStatus(input=InputAge(usable=True)), EventLog()
    publisher = DiagnosticsPublisher(node, events, lambda: status, diagnostic_statuses)
    publisher._publisher.publish = published.append
    yield node, publisher, status, published
    node.destroy_node()


def spin(node, condition):
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    spin_until(executor, condition)
    executor.shutdown()


def test_without_a_change_the_period_passes_between_two_messages(setup):
    node, publisher, _, _ = setup
    publisher.set_period(0.3)
    times = []
    publisher._publisher.publish = lambda message: times.append(time.monotonic())
    spin(node, lambda: len(times) == 3)
    # Checks come every 0.1 s: a message is due when less than half of a check is missing.
    assert times[2] - times[0] >= 2 * 0.2


def test_a_change_of_level_is_published_before_the_period_ends(setup):
    node, publisher, status, published = setup
    publisher.set_period(3600.0)
    spin(node, lambda: published)
    assert [one.name for one in published[0].status] == [
        "robot/diagnosed: input",
        "robot/diagnosed: model",
        "robot/diagnosed: timing",
        "robot/diagnosed: quality",
        "robot/diagnosed: calibration",
    ]
    assert {one.level for one in published[0].status} == {DiagnosticStatus.OK}
    status.degraded = "no file"
    spin(node, lambda: len(published) == 2)
    assert published[1].status[1].level == DiagnosticStatus.ERROR


def test_health_is_latched_and_published_when_it_changes(setup):
    node, publisher, status, published = setup
    publisher.set_period(3600.0)
    spin(node, lambda: published)
    verdicts, heard = [], []
    publisher.on_health = verdicts.append
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    node.create_subscription(DiagnosticStatus, "~/health", heard.append, latched)
    spin(node, lambda: heard)  # published before the subscription
    assert (heard[0].name, heard[0].level) == ("robot/diagnosed: health", DiagnosticStatus.OK)
    assert not verdicts
    status.degraded = "no file"
    spin(node, lambda: len(heard) == 2)
    assert heard[1].level == DiagnosticStatus.ERROR
    assert [verdict.cause for verdict in verdicts] == ["model"]


def test_the_log_says_when_an_error_begins_and_ends(setup):
    node, publisher, _, _ = setup
    lines = []
    node.get_logger = lambda: SimpleNamespace(error=lines.append, info=lines.append)
    now = datetime(2026, 1, 1, tzinfo=UTC)
    ok, warn, error = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR
    for number, (level, sentence, cause, state) in enumerate(
        [
            (warn, "nothing has come", "input", "active"),
            (error, "input is stale", "input", "active"),
            (error, "input is stale since longer", "input", "active"),
            (warn, "odd input", "input", "active"),
            (ok, "receiving", "", "active"),
            (error, "no model", "model", "active"),
            (ok, "receiving", "", "active"),
            (error, "the node is not active", "input", "finalized"),
        ]
    ):
        publisher._publish_health(Verdict(level, sentence, cause, state, now, 0.0), 10.0 * number)
    assert lines == [
        "health is ERROR: input is stale",
        "health is WARN again: odd input",
        "health is ERROR: no model",
        "health is OK again: receiving",
    ]
