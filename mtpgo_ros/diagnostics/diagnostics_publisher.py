# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Publishes the diagnostics: regularly, and at once when a status changes its level."""

from __future__ import annotations

import time
from collections.abc import Callable

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile

from mtpgo_ros.diagnostics.counters import Statistics
from mtpgo_ros.diagnostics.diagnostic_status import Facts, statuses

_LOOK_S = 0.1
"""A change of level is noticed after this long at most."""


class DiagnosticsPublisher:
    """A timer on the steady clock, so that a simulation that stands still is diagnosed too.

    Args:
        node: the node that is diagnosed.
        facts: what is reported, kept up to date by ``refresh``.
        statistics: gives the counters.
        refresh: called before each look at the facts.
    """

    def __init__(
        self,
        node: Node,
        facts: Facts,
        statistics: Callable[[], Statistics],
        refresh: Callable[[], None],
    ) -> None:
        self._node, self._facts = node, facts
        self._statistics, self._refresh = statistics, refresh
        self._name = node.get_fully_qualified_name().lstrip("/")
        self._period_s = 1.0
        self._published_s = float("-inf")
        self._levels: list[bytes] = []
        # A plain publisher: an inactive node has something to say, too.
        self._publisher: Publisher = node.create_publisher(
            DiagnosticArray, "/diagnostics", QoSProfile(depth=10)
        )
        self._timer = node.create_timer(
            _LOOK_S, self._look, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )

    def set_period(self, period_s: float) -> None:
        """Time between two diagnostics without a change (s)."""
        self._period_s = period_s

    def _look(self) -> None:
        self._refresh()
        found = statuses(self._name, self._facts, self._statistics())
        levels = [status.level for status in found]
        now = time.monotonic()
        if levels == self._levels and now - self._published_s < self._period_s - 0.5 * _LOOK_S:
            return
        self._levels, self._published_s = levels, now
        message = DiagnosticArray(status=found)
        message.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(message)
