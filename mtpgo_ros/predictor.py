# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
# PYTHON_ARGCOMPLETE_OK
"""``predictor``: the executable that runs the node.

All settings are ROS parameters (``--ros-args -p rate:=10.0 -r objects:=/perception/objects``).
SIGINT and SIGTERM end it with status 0, bad input with status 2 and one sentence on stderr.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

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
        from mtpgo_ros.lifecycle.lifecycle_run import run_lifecycle
        from mtpgo_ros.node.predictor_node import PredictorNode

        node = PredictorNode(arguments=arguments)
        run_lifecycle(node, stopped, notifier)
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


if __name__ == "__main__":
    leave(main() or 0)
