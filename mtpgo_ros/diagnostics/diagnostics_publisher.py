# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Publishes the diagnostics and the health: regularly, and immediately when a level changes."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Generic, TypeVar

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile

from mtpgo_ros.diagnostics.diagnostic_status import HasState
from mtpgo_ros.diagnostics.event_log import EventLog
from mtpgo_ros.diagnostics.health import HealthMonitor, Verdict

_CHECK_PERIOD_S = 0.1
"""Time between two checks for a change of level (s); chosen."""


AnyStatus = TypeVar("AnyStatus", bound=HasState)


class DiagnosticsPublisher(Generic[AnyStatus]):
    """Publishes on a steady-clock timer, so that a paused simulation is diagnosed as well.

    Args:
        node: the node that is diagnosed.
        events: the counters.
        current_status: returns the state of the node.
        make_statuses: makes the diagnostic statuses of the node's name, its state and its events.

    Attributes:
        on_health: called with every verdict that is published.
    """

    def __init__(
        self,
        node: Node,
        events: EventLog,
        current_status: Callable[[], AnyStatus],
        make_statuses: Callable[[str, AnyStatus, EventLog], list[DiagnosticStatus]],
    ) -> None:
        self._node, self._events, self._current_status = node, events, current_status
        self._make_statuses = make_statuses
        self._name = node.get_fully_qualified_name().lstrip("/")
        self._period_s = 1.0
        self._published_s = float("-inf")
        self._levels: list[bytes] = []
        self._health = HealthMonitor()
        self._health_published: tuple[float, bytes, str] = (float("-inf"), b"", "")
        self.on_health: Callable[[Verdict], None] = lambda _verdict: None
        # Not a lifecycle publisher: an inactive node publishes diagnostics as well.
        self._publisher: Publisher = node.create_publisher(
            DiagnosticArray, "/diagnostics", QoSProfile(depth=10)
        )
        self._health_publisher: Publisher = node.create_publisher(
            DiagnosticStatus,
            "~/health",
            QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL),
        )
        self._timer = node.create_timer(
            _CHECK_PERIOD_S, self._check, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )

    def set_period(self, period_s: float) -> None:
        """Set the time between two diagnostics without a change (s)."""
        self._period_s = period_s

    def _check(self) -> None:
        self._events.flush()
        status = self._current_status()
        found = self._make_statuses(self._name, status, self._events)
        now_s = time.monotonic()
        self._publish_health(self._health.verdict(found, status.state), now_s)
        levels = [one.level for one in found]
        if levels == self._levels and not self._due(self._published_s, now_s):
            return
        self._levels, self._published_s = levels, now_s
        message = DiagnosticArray(status=found)
        message.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(message)

    def _publish_health(self, verdict: Verdict, now_s: float) -> None:
        published_s, level, cause = self._health_published
        if (verdict.level, verdict.cause) == (level, cause) and not self._due(published_s, now_s):
            return
        if (verdict.level, verdict.cause) != (level, cause):
            self._log_change(verdict, level)
        self._health_published = (now_s, verdict.level, verdict.cause)
        self._health_publisher.publish(verdict.message(self._name))
        self.on_health(verdict)

    def _log_change(self, verdict: Verdict, before: bytes) -> None:
        """Log the begin and the end of an ERROR, for those who read the log alone."""
        if verdict.state == "finalized":  # the end of the node, which is logged elsewhere
            return
        if verdict.level == DiagnosticStatus.ERROR:
            self._node.get_logger().error(f"health is ERROR: {verdict.sentence}")
        elif before == DiagnosticStatus.ERROR:
            word = "OK" if verdict.level == DiagnosticStatus.OK else "WARN"
            self._node.get_logger().info(f"health is {word} again: {verdict.sentence}")

    def _due(self, published_s: float, now_s: float) -> bool:
        """Return whether the period has passed, give or take half a check."""
        return now_s - published_s >= self._period_s - 0.5 * _CHECK_PERIOD_S
