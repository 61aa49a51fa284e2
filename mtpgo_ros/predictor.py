# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
# PYTHON_ARGCOMPLETE_OK
"""``predictor``: the executable that runs the node.

All settings are ROS parameters (``--ros-args -p rate:=10.0 -r objects:=/perception/objects``).
SIGINT and SIGTERM end it with status 0, bad input with status 2 and one sentence on stderr.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from mtpgo_core.errors import MtpgoError
from mtpgo_ros.runtime.executable import (
    ArgumentParser,
    answered,
    fail,
    leave,
    share_interpreter,
    stop_on_signals,
    tune_allocator,
)
from mtpgo_ros.runtime.supervision import ServiceNotifier, end_with_parent

if TYPE_CHECKING:
    from mtpgo_ros.node.predictor_node import PredictorNode


def main(argv: Sequence[str] | None = None) -> int | None:
    """Run the executable ``predictor``.

    Args:
        argv: arguments, default those of the process.

    Returns:
        0 after a signal, 2 for bad input.
    """
    stopped = stop_on_signals()
    tune_allocator()
    share_interpreter()
    arguments = list(sys.argv[1:] if argv is None else argv)
    if answered("predictor", arguments, _parser):
        return 0
    import rclpy

    from mtpgo_ros.runtime.ros_start import own_arguments, start

    status, node = 0, None
    notifier = ServiceNotifier.from_environment()
    try:
        if _parser().parse_args(own_arguments(arguments)).end_with_parent:
            end_with_parent()
        start(arguments)
        from mtpgo_ros.node.predictor_node import PredictorNode

        node = PredictorNode(arguments=arguments)
        _run(node, stopped, notifier)
    except MtpgoError as error:
        status = fail("predictor", error)
    notifier.stopping()
    if node is not None:
        if not node.stop():
            leave(status)
        node.destroy_node()
    rclpy.try_shutdown()
    return status


def _parser() -> ArgumentParser:
    parser = ArgumentParser(prog="predictor", description=__doc__)
    parser.add_argument(
        "--end-with-parent",
        action="store_true",
        help="end when the parent process ends; the launch files set this",
    )
    return parser


def _run(node: PredictorNode, stopped: Callable[[], bool], notifier: ServiceNotifier) -> None:
    """Start the node, report to the supervisor, and spin until a signal is received.

    Raises:
        MtpgoError: the node cannot be started.
    """
    from rclpy.clock import Clock, ClockType
    from rclpy.lifecycle import TransitionCallbackReturn

    from mtpgo_ros.runtime.ros_start import spin

    if node.parameters.autostart:
        node.starting = True
        for trigger in (node.trigger_configure, node.trigger_activate):
            if stopped():
                break
            if trigger() != TransitionCallbackReturn.SUCCESS and not stopped():
                raise MtpgoError(node.failure or "the node could not be started")
        node.starting = False
    notifier.ready()
    node.on_health(lambda verdict: notifier.status(verdict.sentence))
    if notifier.watchdog_s:
        # From the executor: one that hangs gives no sign of life.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        node.create_timer(notifier.watchdog_s, notifier.alive, clock=steady)
    spin(node, stopped, node.events.failure)


if __name__ == "__main__":
    leave(main() or 0)
