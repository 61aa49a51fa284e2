# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Declaration of the parameters in rclpy, with conversion and check of changes."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import Any, Generic

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.node import Node
from rclpy.parameter import Parameter

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.options import Limits, listed
from mtpgo_ros.parameters.parameter_answers import answer_every_request
from mtpgo_ros.parameters.parameter_change import AnyParameters, Change
from mtpgo_ros.parameters.unknown_parameters import report_unknown_parameters

_TYPE_NAMES = {
    bool: "true or false",
    int: "a whole number",
    float: "a number",
    str: "text",
    list: "a list of text",
}


class ParameterServer(Generic[AnyParameters]):
    """Keeps a node's ROS parameters and a dataclass of them equal.

    A change is checked as a whole before any part of it takes effect. A whole number is accepted
    for a real one (``rate:=5``) and for text (``ego_id:=17``), since the command line and YAML do
    not distinguish them.

    Attributes:
        value: the current parameters.
    """

    def __init__(
        self,
        node: Node,
        defaults: AnyParameters,
        updated: Callable[[AnyParameters, Mapping[str, Any]], AnyParameters],
        *,
        may_reconfigure: Callable[[], bool],
        on_change: Callable[[AnyParameters], None],
        arguments: Sequence[str] = (),
    ) -> None:
        """Declare all parameters on ``node``, with the values of the command line.

        Args:
            node: the node.
            defaults: a dataclass with the default values, whose fields say when they may change.
            updated: returns the parameters with some values replaced, checked as a whole.
            may_reconfigure: returns whether parameters of the configuration may change.
            on_change: called after a change was accepted.
            arguments: of the process, to find out where unknown parameters come from.

        Raises:
            ConfigurationError: a given value is of the wrong type or not allowed.
        """
        self._may_reconfigure = may_reconfigure
        self._on_change = on_change
        self._node = node
        self._committing = False
        self._updated = updated
        self._fields = {field.name: field for field in dataclasses.fields(defaults)}
        fields = list(self._fields.values())
        given = {field.name: _converted(field, _given(node, field)) for field in fields}
        self.value = updated(defaults, given)
        for field in fields:
            node.declare_parameter(
                field.name, given[field.name], descriptor(field), ignore_override=True
            )
        report_unknown_parameters(node, arguments)
        node.add_pre_set_parameters_callback(self._convert)
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._apply)
        answer_every_request(node, self._wrong_type)

    def checked(self, values: Mapping[str, Any]) -> AnyParameters:
        """Return the present parameters with these values, which do not take effect.

        Raises:
            ConfigurationError: they are of the wrong type or not allowed together.
        """
        given = {name: _converted(self._fields[name], value) for name, value in values.items()}
        return self._updated(self.value, given)

    def commit(self, values: Mapping[str, Any]) -> None:
        """Set parameters to values that have already taken effect, at whatever moment."""
        self._committing = True
        try:
            self._node.set_parameters_atomically(
                [Parameter(name, value=value) for name, value in values.items()]
            )
        finally:
            self._committing = False

    def _check(self, parameters: Sequence[Parameter]) -> SetParametersResult:
        values = {p.name: p.value for p in parameters}
        try:
            for field in self._fields.values():
                if field.name in values:
                    self._check_moment(field, values[field.name])
            self._updated(self.value, values)
        except ConfigurationError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _check_moment(self, field: dataclasses.Field[Any], value: Any) -> None:
        if field.metadata["change"] is not Change.CONFIGURE or self._may_reconfigure():
            return
        if self._committing:
            return
        if value != getattr(self.value, field.name):
            raise ConfigurationError(
                f"parameter {field.name} can change only {Change.CONFIGURE.value}: clean the node"
                " up first"
            )

    def _apply(self, parameters: Sequence[Parameter]) -> None:
        new = self._updated(self.value, {p.name: p.value for p in parameters})
        if new != self.value:
            self.value = new
            self._on_change(new)

    def _wrong_type(self, name: str, value: Any) -> str:
        """Return a sentence about a value of another type, empty if it has the right one."""
        try:
            if name in self._fields:
                _converted(self._fields[name], value)
        except ConfigurationError as error:
            return f"{error!s:.500}"
        return ""

    def _convert(self, parameters: Sequence[Parameter]) -> list[Parameter]:
        """Return the parameters with values of a related type converted to the declared one."""
        out = []
        for parameter in parameters:
            field = self._fields.get(parameter.name)
            if field is not None:
                # Other values are kept: rclpy refuses them with a sentence about the type.
                with suppress(ConfigurationError):
                    parameter = Parameter(parameter.name, value=_converted(field, parameter.value))
            out.append(parameter)
        return out


def descriptor(field: dataclasses.Field[Any]) -> ParameterDescriptor:
    """Return the ROS description of a field's parameter."""
    limits: Limits = field.metadata["limits"]
    change: Change = field.metadata["change"]
    constraints = [f"One of {listed(limits.choices)}."] if limits.choices else []
    constraints.append(f"May change {change.value}.")
    out = ParameterDescriptor(
        description=field.metadata["description"],
        additional_constraints=" ".join(constraints),
        read_only=change is Change.START,
    )
    if limits.low is None or limits.high is None:
        return out
    if isinstance(field.default, int):
        whole = IntegerRange(from_value=int(limits.low), to_value=int(limits.high), step=0)
        out.integer_range = [whole]
    else:
        real = FloatingPointRange(from_value=limits.low, to_value=limits.high, step=0.0)
        out.floating_point_range = [real]
    return out


def _given(node: Node, field: dataclasses.Field[Any]) -> Any:
    """Return the value from the command line or a parameter file, else the default.

    rclpy gives it only through a declaration, and refuses values of a related type: the parameter
    is therefore declared temporarily without a type.
    """
    default = list(field.default) if isinstance(field.default, tuple) else field.default
    value = node.declare_parameter(
        field.name, default, ParameterDescriptor(dynamic_typing=True)
    ).value
    node.undeclare_parameter(field.name)
    return value


def _converted(field: dataclasses.Field[Any], value: Any) -> Any:
    """Return ``value`` converted to the type of the field if nothing is lost.

    Raises:
        ConfigurationError: the value is of another type.
    """
    whole = isinstance(value, int) and not isinstance(value, bool)
    if isinstance(field.default, float) and whole:
        return float(value)
    if isinstance(field.default, str) and whole:
        return str(value)
    if isinstance(field.default, tuple) and isinstance(value, str):
        return [value]
    wanted = list if isinstance(field.default, tuple) else type(field.default)
    if isinstance(value, wanted) and isinstance(value, bool) == (wanted is bool):
        return value
    raise ConfigurationError(
        f"parameter {field.name} is {value!r}, expected {_TYPE_NAMES[wanted]}"
    )
