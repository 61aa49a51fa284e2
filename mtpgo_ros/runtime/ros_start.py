# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""rclpy's start and spinning, with our own way to end.

The executables take signals themselves: rclpy's handlers would shut the context down under a
node that is being made or that still has a bag to close.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

from mtpgo_core.errors import ConfigurationError

_LOOK_S = 0.1
"""A wish to stop is noticed after this long at most."""

_IDLE_PASSES = 10
"""So many times nothing was handled: a pass may also serve a timer."""


def own_arguments(arguments: Sequence[str]) -> list[str]:
    """The arguments without those that ``--ros-args`` begins.

    Raises:
        ConfigurationError: the ROS arguments cannot be read.
    """
    try:
        return remove_ros_args(["program", *arguments])[1:]
    except RuntimeError as error:
        raise ConfigurationError(f"ROS arguments: {_first_sentence(error)}") from error


def start(arguments: Sequence[str]) -> None:
    """Start rclpy, without its signal handlers.

    Raises:
        ConfigurationError: the ROS arguments or the middleware are not usable.
    """
    try:
        rclpy.init(args=list(arguments), signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:
        raise ConfigurationError(f"ROS cannot start: {_first_sentence(error)}") from error


def spin(
    node: Node,
    stopped: Callable[[], bool],
    failed: Callable[[str, Exception], None] | None = None,
    handled: Callable[[], int] | None = None,
) -> None:
    """Serve the node until asked to stop.

    Args:
        node: the node.
        stopped: says whether to stop.
        failed: told of an exception that a callback or rclpy raised, after which the node is
            served on; without it the exception ends the spinning.
        handled: a count of what was handled; given, what has arrived by the stop is handled too,
            until the count stands still.
    """
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        while not stopped():
            try:
                executor.spin_once(timeout_sec=_LOOK_S)
            except Exception as error:
                if failed is None:
                    raise
                failed("a callback failed", error)
        if handled is not None:
            _drain(executor, handled)
    finally:
        executor.shutdown()


def _drain(executor: SingleThreadedExecutor, handled: Callable[[], int]) -> None:
    """Handle what waits, for a second at most."""
    end = time.monotonic() + 1.0
    idle = 0
    while idle < _IDLE_PASSES and time.monotonic() < end:
        before = handled()
        executor.spin_once(timeout_sec=0.0)
        idle = 0 if handled() > before else idle + 1


def _first_sentence(error: Exception) -> str:
    """The reason without the places in rcl's source that follow it."""
    text = str(error).partition(", at /")[0].removeprefix("Failed to parse ROS arguments: ")
    return f"unknown {text}" if text.startswith("[") else text
