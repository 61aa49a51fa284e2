# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Transitions whose failure is stored and logged: rclpy itself ignores exceptions."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, Protocol, TypeVar

from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn

from mtpgo_core.errors import MtpgoError
from mtpgo_ros.runtime.executable import Interrupted


class StartedNode(Protocol):
    """A lifecycle node that an executable starts.

    Attributes:
        failure: why the last transition failed, empty if it did not.
        starting: the executable starts the node and prints a failure itself.
    """

    failure: str
    starting: bool

    def get_logger(self) -> Any:
        """Return the node's logger."""


AnyNode = TypeVar("AnyNode", bound=StartedNode)
Transition = Callable[[AnyNode, LifecycleState], TransitionCallbackReturn]


def record_failure(transition: Transition[AnyNode]) -> Transition[AnyNode]:
    """Return a transition that stores and logs why it failed."""

    @functools.wraps(transition)
    def recorded(node: AnyNode, state: LifecycleState) -> TransitionCallbackReturn:
        try:
            node.failure = ""
            return transition(node, state)
        except Interrupted:
            node.failure = "a signal interrupted it"
            return TransitionCallbackReturn.FAILURE
        except MtpgoError as error:
            node.failure = str(error)
            result = TransitionCallbackReturn.FAILURE
        except Exception as error:
            name = getattr(transition, "__name__", "transition")
            node.failure = f"{name}: {type(error).__name__}: {error}"
            result = TransitionCallbackReturn.ERROR
        if not node.starting:
            node.get_logger().error(f"transition refused: {node.failure}")
        return result

    return recorded
