# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The message types that can be written into a bag, with their definitions."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from msg_adapters.wire.definitions import DEFINITIONS, EARLIER_DEFINITIONS
from mtpgo_core.errors import RecordingError


@functools.cache
def bag_typestore() -> Typestore:
    """Return the types of ROS 2 Jazzy and of the message packages that the adapters support.

    There is one store per process; :func:`require_type` adds to it.
    """
    return _store(Stores.ROS2_JAZZY, DEFINITIONS)


@functools.cache
def earlier_typestore() -> Typestore:
    """Return the types of ROS 2 Foxy: bags recorded before Iron may hold no definitions."""
    return _store(Stores.ROS2_FOXY, EARLIER_DEFINITIONS)


def _store(release: Stores, definitions: Mapping[str, str]) -> Typestore:
    """Return the types of a release, and others of which it has none."""
    store = get_typestore(release)
    types: dict[str, Any] = {}
    for name, text in definitions.items():
        types.update(get_types_from_msg(text, name))
    store.register({name: fields for name, fields in types.items() if name not in store.fielddefs})
    return store


def require_type(message_type: str) -> None:
    """Make sure that :func:`bag_typestore` has a type.

    An unknown type, and the types of its fields, are read from the ``.msg`` files of the installed
    message packages.

    Raises:
        RecordingError: a definition file is not installed.
    """
    store = bag_typestore()
    waiting, types = [message_type], {}
    while waiting:
        name = waiting.pop()
        if name in types or name in store.types:
            continue
        definition = _installed_definition(name)
        types.update(definition)
        for _, fields in definition.values():
            waiting += types_of_fields(fields)
    if types:
        store.register(types)


def _installed_definition(message_type: str) -> dict[str, Any]:
    package, _, short = message_type.partition("/msg/")
    try:
        # Only on a machine with ROS 2, and only for types that the store does not have.
        from ament_index_python.packages import get_package_share_directory

        file = Path(get_package_share_directory(package)) / "msg" / f"{short}.msg"
        return dict(get_types_from_msg(file.read_text(encoding="utf-8"), message_type))
    except (ImportError, LookupError, OSError, ValueError) as error:
        raise RecordingError(
            f"message type {message_type} cannot be recorded: its definition {short}.msg is not"
            " installed"
        ) from error


def types_of_fields(fields: Any) -> list[str]:
    """Return the message types among field descriptions, as rosbags nests them."""
    named = []
    for _, (kind, content) in fields:
        while kind.name in ("ARRAY", "SEQUENCE"):
            kind, content = content[0]
        if kind.name == "NAME":
            named.append(content)
    return named
