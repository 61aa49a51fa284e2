# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Shared by the executables of lifecycle nodes: arguments, start, end and exit status."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from typing import Any

from mtpgo_core.errors import MtpgoError
from mtpgo_core.processes.parent_process import end_with_parent
from mtpgo_ros.runtime.executable import (
    ArgumentParser,
    Interrupted,
    add_end_with_parent,
    answered,
    fail,
    interruptible,
    leave,
)
from mtpgo_ros.runtime.supervision import ServiceNotifier


def run_executable(
    name: str,
    description: str | None,
    argv: Sequence[str] | None,
    stopped: Callable[[], bool],
    node_class: Callable[[], Callable[..., Any]],
) -> int:
    """Run a lifecycle node until a signal comes.

    Args:
        name: of the executable.
        description: for ``--help``.
        argv: arguments, default those of the process.
        stopped: returns whether a signal was received.
        node_class: imports and returns the node's class, a
            :class:`mtpgo_ros.lifecycle.resource_node.ResourceNode`; not called for ``--help`` and
            ``--version``.

    Returns:
        0 after a signal, 2 for bad input. Where a part of the node cannot be ended, the process
        ends here.
    """

    def parser() -> ArgumentParser:
        options = ArgumentParser(prog=name, description=description, parameters=True)
        add_end_with_parent(options)
        return options

    arguments = list(sys.argv[1:] if argv is None else argv)
    if answered(name, arguments, parser):
        return 0
    try:
        with interruptible():
            import rclpy

            from mtpgo_ros.runtime.dds_transport import avoid_shared_memory
            from mtpgo_ros.runtime.ros_start import node_errors, own_arguments, start
    except Interrupted:
        return 0

    status, node = 0, None
    notifier = ServiceNotifier.from_environment()
    try:
        if parser().parse_args(own_arguments(arguments)).end_with_parent:
            end_with_parent()
        avoid_shared_memory(rclpy.get_rmw_implementation_identifier())
        start(arguments)
        with interruptible():
            from mtpgo_ros.lifecycle.lifecycle_run import run_lifecycle

            make = node_class()
        with node_errors():
            node = make(arguments=arguments)
        run_lifecycle(node, stopped, notifier)
    except MtpgoError as error:
        status = fail(name, error)
    except Interrupted:
        pass  # It was asked to stop before there was anything to do.
    finally:
        notifier.stopping()
        ended = node is None or node.stop()
        if node is not None:
            node.destroy_node()
    if not ended:
        leave(status)
    rclpy.try_shutdown()
    return status
