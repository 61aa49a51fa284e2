# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""When parameters may change, and how a set of them is changed. No ROS in here."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from enum import Enum
from typing import Any, TypeVar

from mtpgo_core.options import option


class Change(Enum):
    """When a parameter may change, and when the new value takes effect."""

    NOW = "at any time"
    CONFIGURE = "while the node is unconfigured, and takes effect at the next configuration"
    START = "only at the start of the process"


AnyParameters = TypeVar("AnyParameters", bound=Any)
"""A frozen dataclass whose fields are made by :func:`parameter_field`."""


def parameter_field(
    default: Any, description: str, *, change: Change = Change.NOW, **limits: Any
) -> Any:
    """Return a dataclass field with everything that rclpy needs to declare the parameter."""
    return option(default, description=description, change=change, **limits)


def replaced(current: AnyParameters, values: Mapping[str, Any]) -> AnyParameters:
    """Return ``current`` with ``values`` replaced.

    Names that are not among its fields (``use_sim_time``, QoS overrides) are ignored.
    """
    names = {field.name for field in dataclasses.fields(current)}
    known: dict[str, Any] = {
        name: tuple(value) if isinstance(value, list) else value
        for name, value in values.items()
        if name in names
    }
    new: AnyParameters = dataclasses.replace(current, **known)
    return new
