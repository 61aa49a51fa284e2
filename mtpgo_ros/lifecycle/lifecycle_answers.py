# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Answers to requests for transitions that the present state does not allow."""

from __future__ import annotations

from typing import Any

from rclpy.lifecycle import LifecycleNode


def answer_invalid_transitions(node: LifecycleNode) -> None:
    """Make the service ``~/change_state`` answer every request.

    rclpy raises an exception for a transition that is unknown or not allowed in the present state,
    and then sends no answer, so that the client waits forever. The answer is ``success: false``,
    as that of rclcpp.
    """
    service = node._service_change_state
    change_state = service.callback

    def answered(request: Any, response: Any) -> Any:
        try:
            return change_state(request, response)
        except Exception:  # rclpy's; what fails within a transition does not come here
            wanted = request.transition.label or f"with id {request.transition.id}"
            possible = [transition[1] for transition in node._state_machine.available_transitions]
            node.get_logger().warning(
                f"transition {wanted} refused: the node is {state_of(node)}, possible are "
                f"{', '.join(possible) or 'none'}"
            )
            response.success = False
            return response

    service.callback = answered


def state_of(node: LifecycleNode) -> str:
    """Return the state of the life cycle, as in lifecycle_msgs/State: ``active``."""
    return str(node._state_machine.current_state[1])
