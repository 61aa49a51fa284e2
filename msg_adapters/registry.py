# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Which message kinds there are, by name and by message type."""

from __future__ import annotations

from msg_adapters.adapter import InputAdapter
from msg_adapters.pointcloud2 import POINTCLOUD2
from mtpgo_core.errors import ConfigurationError, MessageError

INPUTS: dict[str, InputAdapter] = {adapter.name: adapter for adapter in (POINTCLOUD2,)}
"""Every message of tracked objects that is understood, by its short name."""


def input_adapter(name: str) -> InputAdapter:
    """The adapter of a short name.

    Raises:
        ConfigurationError: there is none; the sentence lists the names.
    """
    try:
        return INPUTS[name]
    except KeyError:
        raise ConfigurationError(
            f"input type is {name!r}, expected one of {', '.join(map(repr, INPUTS))}"
        ) from None


def adapter_for_type(message_type: str) -> InputAdapter:
    """The adapter of a message type, written ``pkg/msg/Name`` or ``pkg/Name``.

    Raises:
        MessageError: no adapter reads that type; the sentence lists those that are read.
    """
    package, _, rest = message_type.partition("/")
    full = f"{package}/msg/{rest.removeprefix('msg/')}"
    for adapter in INPUTS.values():
        if adapter.message_type == full:
            return adapter
    readable = ", ".join(adapter.message_type for adapter in INPUTS.values())
    raise MessageError(
        f"message type {message_type!r} carries no tracked objects that can be read, expected "
        f"one of {readable}"
    )
