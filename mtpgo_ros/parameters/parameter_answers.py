# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Answers to requests for parameters that rclpy cannot read."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.node import Node

from mtpgo_core.errors import reason_of


def answer_every_request(node: Node) -> None:
    """Make the services that set parameters answer every request.

    rclpy raises an exception for a value of a type that there is not, and for whatever fails while
    a change takes effect, and then sends no answer, so that the client waits forever.
    """
    for service in node.services:
        callback = service.callback
        if service.srv_type is SetParameters:
            service.callback = _each(node, callback)
        elif service.srv_type is SetParametersAtomically:
            service.callback = _together(node, callback)


def _each(node: Node, callback: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    def answered(request: Any, response: Any) -> Any:
        for parameter in request.parameters:
            one = SetParameters.Request(parameters=[parameter])
            try:
                response.results += callback(one, SetParameters.Response()).results
            except Exception as error:  # rclpy's have no common base
                response.results.append(_refused(node, parameter.name, error))
        return response

    return answered


def _together(node: Node, callback: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    def answered(request: Any, response: Any) -> Any:
        try:
            return callback(request, response)
        except Exception as error:  # rclpy's have no common base
            names = ", ".join(parameter.name for parameter in request.parameters)
            response.result = _refused(node, names, error)
            return response

    return answered


def _refused(node: Node, names: str, error: Exception) -> SetParametersResult:
    reason = f"parameter {names:.200} was not set: {reason_of(error):.500}"
    node.get_logger().error(reason)
    return SetParametersResult(successful=False, reason=reason)
