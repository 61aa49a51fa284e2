# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``predictor``: the executable that runs the node.

All settings are ROS parameters (``--ros-args -p rate:=10.0 -r objects:=/perception/objects``).
SIGINT and SIGTERM end it with status 0, bad input with status 2 and one sentence on stderr.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from contextlib import suppress
from typing import TYPE_CHECKING

from mtpgo_core.errors import MtpgoError
from mtpgo_ros.process import ArgumentParser, fail, ignore_signals, leave, tune_allocator

if TYPE_CHECKING:
    from mtpgo_ros.node import PredictorNode


def main(argv: Sequence[str] | None = None) -> int | None:
    """Entry of the executable ``predictor``.

    Args:
        argv: arguments, by default the process's.

    Returns:
        0 after a signal, 2 for bad input.
    """
    tune_allocator()
    arguments = list(sys.argv[1:] if argv is None else argv)
    try:
        return _run(arguments)
    except KeyboardInterrupt:  # Before the node was up.
        return 0


def _run(arguments: list[str]) -> int:
    import rclpy
    from rclpy.impl.implementation_singleton import rclpy_implementation
    from rclpy.utilities import remove_ros_args

    parser = ArgumentParser(prog="predictor", description=__doc__)
    parser.parse_args(remove_ros_args(["predictor", *arguments])[1:])
    node: PredictorNode | None = None
    try:
        rclpy.init(args=arguments)
        from mtpgo_ros.node import PredictorNode

        node = PredictorNode()
        status = _serve(node)
    except (MtpgoError, rclpy_implementation.RCLError) as error:
        # A signal during the start shuts the context down under our hands: that is no error.
        status = fail("predictor", error) if rclpy.ok() or node is None else 0
    except KeyboardInterrupt:
        status = 0
    ignore_signals()
    idle = node is None or node.stop()
    if not idle:
        leave(status)
    if node is not None:
        node.destroy_node()
    rclpy.try_shutdown()
    return status


def _serve(node: PredictorNode) -> int:
    """Start the node and spin until a signal comes.

    Raises:
        MtpgoError: the node cannot be started.
    """
    from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
    from rclpy.lifecycle import TransitionCallbackReturn

    if node.parameters.autostart:
        node.starting = True
        for trigger in (node.trigger_configure, node.trigger_activate):
            if trigger() != TransitionCallbackReturn.SUCCESS:
                if not node.context.ok():
                    return 0
                raise MtpgoError(node.failure or "the node could not be started")
        node.starting = False
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    with suppress(KeyboardInterrupt, ExternalShutdownException):  # The user's way to end it.
        executor.spin()
    return 0


if __name__ == "__main__":
    leave(main() or 0)
