# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
# PYTHON_ARGCOMPLETE_OK
"""``risk``: the executable that tells how likely predicted road users are in the ego's way.

All settings are ROS parameters (``--ros-args -p plan_type:=path -r plan:=/planner/path``). SIGINT
and SIGTERM end it with status 0, bad input with status 2 and one sentence on stderr.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from mtpgo_core.errors import MtpgoError
from mtpgo_ros.runtime.executable import (
    ArgumentParser,
    answered,
    fail,
    leave,
    stop_on_signals,
)
from mtpgo_ros.runtime.supervision import ServiceNotifier, end_with_parent

if TYPE_CHECKING:
    from mtpgo_ros.risk_node.risk_lifecycle import RiskNode


def main(argv: Sequence[str] | None = None) -> int | None:
    """Run the executable ``risk``.

    Args:
        argv: arguments, default those of the process.

    Returns:
        0 after a signal, 2 for bad input.
    """
    stopped = stop_on_signals()
    arguments = list(sys.argv[1:] if argv is None else argv)
    if answered("risk", arguments, _parser):
        return 0
    import rclpy

    from mtpgo_ros.runtime.ros_start import own_arguments, start

    status = 0
    node: RiskNode | None = None
    notifier = ServiceNotifier.from_environment()
    try:
        if _parser().parse_args(own_arguments(arguments)).end_with_parent:
            end_with_parent()
        start(arguments)
        from mtpgo_ros.lifecycle.lifecycle_run import run_lifecycle
        from mtpgo_ros.risk_node.risk_lifecycle import RiskNode

        node = RiskNode(arguments=arguments)
        run_lifecycle(node, stopped, notifier)
    except MtpgoError as error:
        status = fail("risk", error)
    notifier.stopping()
    if node is not None:
        node.stop()
        node.destroy_node()
    rclpy.try_shutdown()
    return status


def _parser() -> ArgumentParser:
    parser = ArgumentParser(prog="risk", description=__doc__)
    parser.add_argument(
        "--end-with-parent",
        action="store_true",
        help="end when the parent process ends; the launch files set this",
    )
    return parser


if __name__ == "__main__":
    leave(main() or 0)
