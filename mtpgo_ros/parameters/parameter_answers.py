# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Answers to requests for parameters that rclpy cannot read, or that the node does not have."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.node import Node
from rclpy.parameter import Parameter

from mtpgo_core.errors import reason_of
from mtpgo_ros.parameters.unknown_parameters import nearest

Problem = Callable[[str, Any], str]
"""Returns a sentence about a value that a parameter cannot have, empty if it may."""


def _no_problem(name: str, value: Any) -> str:
    return ""


def answer_every_request(node: Node, problem: Problem = _no_problem) -> None:
    """Make the services that set parameters answer every request.

    rclpy raises an exception for a value of a type that there is not, and for whatever fails while
    a change takes effect, and then sends no answer, so that the client waits forever. A parameter
    that the node does not have is named.

    Args:
        node: the node.
        problem: asked before rclpy, whose sentence on a wrong type does not name the parameter.
    """
    for service in node.services:
        callback = service.callback
        if service.srv_type is SetParameters:
            service.callback = _each(node, problem, callback)
        elif service.srv_type is SetParametersAtomically:
            service.callback = _together(node, problem, callback)


def _each(
    node: Node, problem: Problem, callback: Callable[[Any, Any], Any]
) -> Callable[[Any, Any], Any]:
    def answered(request: Any, response: Any) -> Any:
        for parameter in request.parameters:
            if unusable := _unusable(node, problem, [parameter]):
                response.results.append(unusable)
                continue
            one = SetParameters.Request(parameters=[parameter])
            try:
                response.results += callback(one, SetParameters.Response()).results
            except Exception as error:  # rclpy's have no common base
                response.results.append(_refused(node, parameter.name, error))
        return response

    return answered


def _together(
    node: Node, problem: Problem, callback: Callable[[Any, Any], Any]
) -> Callable[[Any, Any], Any]:
    def answered(request: Any, response: Any) -> Any:
        if unusable := _unusable(node, problem, request.parameters):
            response.result = unusable
            return response
        try:
            return callback(request, response)
        except Exception as error:  # rclpy's have no common base
            names = ", ".join(parameter.name for parameter in request.parameters)
            response.result = _refused(node, names, error)
            return response

    return answered


def _unusable(
    node: Node, problem: Problem, parameters: Sequence[Any]
) -> SetParametersResult | None:
    """Return the answer about the first parameter that is unknown or cannot have its value."""
    for parameter in parameters:
        name = parameter.name
        if not node.has_parameter(name):
            reason = f"the node has no parameter {name:.200}{nearest(node, name)}"
        else:
            try:
                value = Parameter.from_parameter_msg(parameter).value
            except Exception:  # of a type that there is not: rclpy's answer follows
                continue
            reason = "" if value is None else problem(name, value)
        if reason:
            return SetParametersResult(successful=False, reason=reason)
    return None


def _refused(node: Node, names: str, error: Exception) -> SetParametersResult:
    reason = f"parameter {names:.200} was not set: {reason_of(error):.500}"
    node.get_logger().error(reason)
    return SetParametersResult(successful=False, reason=reason)
