# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Starting and spinning rclpy with our own handling of signals.

The executables handle signals themselves: rclpy's handlers would shut the context down while a
node is being created or still has a bag to close.
"""

from __future__ import annotations

import contextlib
import os
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import rclpy
from rcl_interfaces.msg import ParameterEvent
from rclpy.exceptions import NameValidationException, ParameterException
from rclpy.executors import SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.options import is_unicode
from mtpgo_ros.runtime.clock_watch import set_sentence, watched_clock
from mtpgo_ros.runtime.log_folder import choose_log_folder

_CHECK_PERIOD_S = 0.1
"""A request to stop is noticed after at most this time (s); chosen."""

_LAST_DOMAIN = 232
"""Last domain whose ports exist: the DDS standard's 7400 + 250 domain + 11 is below 65536."""

_IDLE_PASSES = 10
"""Passes without a handled message after which none is left: a pass may also run a timer."""

_RULES = {"parameter override": "-p NAME:=VALUE", "remap": "-r OLD:=NEW"}
"""What rcl calls rules on a command line, and their form."""


def own_arguments(arguments: Sequence[str]) -> list[str]:
    """Return the arguments without those after ``--ros-args``.

    Raises:
        ConfigurationError: the ROS arguments cannot be read, or an argument is no text in UTF-8.
    """
    for argument in arguments:
        if not is_unicode(argument):
            raise ConfigurationError(f"argument {argument!a} is no text in UTF-8, as ROS needs it")
    try:
        return remove_ros_args(["program", *arguments])[1:]
    except RuntimeError as error:
        raise ConfigurationError(f"ROS arguments: {_first_sentence(error)}") from error


def start(arguments: Sequence[str]) -> None:
    """Start rclpy without its signal handlers, and with log files only where they can be written.

    Raises:
        ConfigurationError: the ROS arguments or the middleware are not usable.
    """
    check_domain(os.environ.get("ROS_DOMAIN_ID", ""))
    arguments = [*arguments, *choose_log_folder(Path(sys.argv[0]).stem)]
    try:
        rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:
        raise ConfigurationError(f"ROS cannot start: {_first_sentence(error)}") from error


def check_domain(text: str) -> None:
    """Check the domain of ROS as the environment gives it, empty for the default.

    Fast DDS ends the process at a larger one, and takes one beyond 32 bits for another one.

    Raises:
        ConfigurationError: there is no such domain.
    """
    if text and not (
        text.isascii() and text.isdigit() and int(text.lstrip("0")[:4] or 0) <= _LAST_DOMAIN
    ):
        raise ConfigurationError(
            f"ROS_DOMAIN_ID is {text!r:.80}, expected a whole number from 0 to {_LAST_DOMAIN}"
        )


@contextlib.contextmanager
def node_errors() -> Iterator[None]:
    """Report what rclpy refuses while a node or a topic is made.

    These are its own parameters (use_sim_time), names, and two types on one topic, as after a
    wrong remapping.

    Raises:
        ConfigurationError: it refuses something.
    """
    try:
        yield
    except (ParameterException, NameValidationException) as error:
        text = " ".join(str(error).split()).removesuffix(" ^")
        raise ConfigurationError(f"not accepted by ROS: {text}") from error
    except rclpy_implementation.RCLError as error:
        raise ConfigurationError(f"not accepted by ROS: {_first_sentence(error)}") from error


def spin(
    node: Node,
    stopped: Callable[[], bool],
    failed: Callable[[str, Exception], None] | None = None,
    handled: Callable[[], int] | None = None,
) -> None:
    """Run the node's callbacks until asked to stop.

    Args:
        node: the node.
        stopped: returns whether to stop.
        failed: called with a description and an exception that a callback or rclpy raised, after
            which spinning continues; without it the exception is raised.
        handled: returns the number of handled messages. If given, messages that arrived before the
            stop are handled as well, until the number no longer changes.
    """
    executor = SingleThreadedExecutor()
    executor.add_node(node)

    def clock_was_set(change_s: float) -> None:
        node.get_logger().warning(set_sentence(change_s))

    try:
        with watched_clock(clock_was_set, lambda: executor.create_task(wake_middleware, node)):
            while not stopped():
                try:
                    executor.spin_once(timeout_sec=_CHECK_PERIOD_S)
                except Exception as error:
                    if failed is None:
                        raise
                    failed("a callback failed", error)
            if handled is not None:
                _drain(executor, handled)
    finally:
        executor.shutdown()


def wake_middleware(node: Node) -> None:
    """Make the middleware look at its timers; call it when the machine's clock was set back.

    Fast DDS as built for pip waits until a time of the system clock, that of the wait's begin plus
    its length, so that the wait is longer by what the clock is set back meanwhile. Its timers
    announce the node: after 20 s without them it is forgotten by all others. A new publisher has
    timers of its own, for which the thread that waits is woken.
    """
    node.destroy_publisher(node.create_publisher(ParameterEvent, "/parameter_events", 1))


def _drain(executor: SingleThreadedExecutor, handled: Callable[[], int]) -> None:
    """Handle the waiting messages, for at most one second."""
    end = time.monotonic() + 1.0
    idle = 0
    while idle < _IDLE_PASSES and time.monotonic() < end:
        before = handled()
        executor.spin_once(timeout_sec=0.0)
        idle = 0 if handled() > before else idle + 1


def _first_sentence(error: Exception) -> str:
    """Return the reason without the positions in rcl's source that follow it."""
    text = str(error).partition(", at /")[0].removeprefix("Failed to parse ROS arguments: ")
    for rule, expected in _RULES.items():
        if f"parse {rule} rule: " in text:
            given, _, reason = text.partition("rule: ")[2].rpartition(". Error: ")
            # A lexeme is a number of rcl's parser, which says nothing to the user.
            why = "" if "lexeme type" in reason else f": {reason}"
            return f"{given or text}{why}, expected {expected}"
        if f"No {rule} rule found" in text:
            return f"nothing follows the last option, expected {expected}"
    return f"unknown {text}" if text.startswith("[") else text
