# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Publishes the diagnostics: regularly, and immediately when a status changes its level."""

from __future__ import annotations

import time
from collections.abc import Callable

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile

from mtpgo_ros.diagnostics.diagnostic_status import NodeStatus, diagnostic_statuses
from mtpgo_ros.diagnostics.event_log import EventLog

_CHECK_PERIOD_S = 0.1
"""Time between two checks for a change of level (s); chosen."""


class DiagnosticsPublisher:
    """Publishes on a steady-clock timer, so that a paused simulation is diagnosed as well.

    Args:
        node: the node that is diagnosed.
        events: the counters.
        current_status: returns the state of the node.
    """

    def __init__(
        self,
        node: Node,
        events: EventLog,
        current_status: Callable[[], NodeStatus],
    ) -> None:
        self._node, self._events, self._current_status = node, events, current_status
        self._name = node.get_fully_qualified_name().lstrip("/")
        self._period_s = 1.0
        self._published_s = float("-inf")
        self._levels: list[bytes] = []
        # Not a lifecycle publisher: an inactive node publishes diagnostics as well.
        self._publisher: Publisher = node.create_publisher(
            DiagnosticArray, "/diagnostics", QoSProfile(depth=10)
        )
        self._timer = node.create_timer(
            _CHECK_PERIOD_S, self._check, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )

    def set_period(self, period_s: float) -> None:
        """Set the time between two diagnostics without a change (s)."""
        self._period_s = period_s

    def _check(self) -> None:
        found = diagnostic_statuses(self._name, self._current_status(), self._events)
        levels = [status.level for status in found]
        now = time.monotonic()
        elapsed_s = now - self._published_s
        if levels == self._levels and elapsed_s < self._period_s - 0.5 * _CHECK_PERIOD_S:
            return
        self._levels, self._published_s = levels, now
        message = DiagnosticArray(status=found)
        message.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(message)
