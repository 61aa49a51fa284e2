# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""How the executables start a lifecycle node and spin it until a signal comes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import TransitionCallbackReturn

from mtpgo_core.errors import MtpgoError
from mtpgo_ros.runtime.ros_start import spin
from mtpgo_ros.runtime.supervision import ServiceNotifier


def run_lifecycle(node: Any, stopped: Callable[[], bool], notifier: ServiceNotifier) -> None:
    """Start the node, report to the supervisor, and spin until a signal is received.

    Args:
        node: a :class:`rclpy.lifecycle.LifecycleNode` with the attributes of
            :class:`mtpgo_ros.lifecycle.recorded_transition.StartedNode`, its parameters, its
            events and ``on_health``.
        stopped: returns whether a signal was received.
        notifier: the supervisor.

    Raises:
        MtpgoError: the node cannot be started.
    """
    if node.parameters.autostart:
        node.starting = True
        for trigger in (node.trigger_configure, node.trigger_activate):
            if stopped():
                return
            if trigger() != TransitionCallbackReturn.SUCCESS and not stopped():
                raise MtpgoError(node.failure or "the node could not be started")
        node.starting = False
    notifier.ready()
    node.on_health(lambda verdict: notifier.status(verdict.sentence))
    node.long_step = notifier.long_step
    if notifier.watchdog_s:
        # On the executor, so that a blocked executor sends no watchdog notification.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        node.create_timer(notifier.watchdog_s, notifier.alive, clock=steady)
    spin(node, stopped, node.events.failure)
