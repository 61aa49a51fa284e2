# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Checks that the messages of a bag have the same definition as the installed message packages.

The recorded bytes are played unchanged. If a field was added, removed or moved since, subscribers
would decode wrong values.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator, Sequence
from typing import Any

from msg_adapters.types import message_class
from mtpgo_core.errors import MessageError

_BASIC = {
    **{"boolean": "bool", "double": "float64", "float": "float32"},
    **{"octet": "uint8", "byte": "uint8", "char": "uint8"},
}
"""Other names of basic types, of the same bytes each."""

_PADDING = "structure_needs_at_least_one_member"
"""Field that stands for a message without fields."""

_SEQUENCE = re.compile(r"sequence<(?P<item>.+?)(?:, *\d+)?>")
_ARRAY = re.compile(r"(?P<item>.+)\[(?P<size>\d+)\]")
_BOUND = re.compile(r"(w?string)<.*>")


def require_installed_layout(message_type: str, recorded: Sequence[tuple[str, str]]) -> None:
    """Check that messages of a type can be read by what is installed.

    Args:
        message_type: the type.
        recorded: path and type of its fields in the bag, see ``BagDefinitions.layout``; nothing is
            checked without any.

    Raises:
        MessageError: they have another definition than the installed one, or none is installed.
    """
    ours = [(path, _named(kind)) for path, kind in recorded if not path.endswith(_PADDING)]
    if not ours:
        return
    for one, other in itertools.zip_longest(ours, _installed(message_type)):
        if one != other:
            field = (one or other or ("", ""))[0]
            raise MessageError(
                f"its messages were recorded with another definition of {message_type} than the "
                f"installed one, they differ from the field {field} on"
            )


def installed_definition(message_type: str) -> str:
    """Return the installed definition of a type and of all within it, as text of ``.msg`` files.

    Comments and constants, which are not installed in a form that can be read, are missing.

    Raises:
        MessageError: one of the types is not installed.
    """
    waiting, parts = [message_type], {}
    while waiting:
        name = waiting.pop()
        if name in parts:
            continue
        installed: Any = message_class(name)
        fields = installed.get_fields_and_field_types()
        parts[name] = "".join(f"{_as_in_file(text)} {field}\n" for field, text in fields.items())
        waiting += filter(None, (_kind_of(text)[1] for text in fields.values()))
    own = parts.pop(message_type)
    others = (
        f"{'=' * 80}\nMSG: {name.replace('/msg/', '/')}\n{text}" for name, text in parts.items()
    )
    return own + "".join(others)


def _as_in_file(text: str) -> str:
    """Return the type of a field in the notation of ``.msg`` files, without bounds."""
    kind, inner = _kind_of(text)
    return kind.replace("message", inner.replace("/msg/", "/"), 1) if inner else kind


def _installed(message_type: str, before: str = "") -> Iterator[tuple[str, str]]:
    """Yield path and type of the fields of an installed type, as ``BagDefinitions.layout``."""
    installed: Any = message_class(message_type)
    for field, text in installed.get_fields_and_field_types().items():
        if field == _PADDING:
            continue
        kind, inner = _kind_of(text)
        yield before + field, kind
        if inner:
            yield from _installed(inner, f"{before}{field}.")


def _kind_of(text: str) -> tuple[str, str]:
    """Return the type of a field, and the type of the message in it, empty if there is none."""
    found = _SEQUENCE.fullmatch(text) or _ARRAY.fullmatch(text)
    if found is not None:
        kind, inner = _kind_of(found["item"])
        return f"{kind}[{found.groupdict().get('size') or ''}]", inner
    package, slash, short = text.partition("/")
    return ("message", f"{package}/msg/{short}") if slash else (_named(text), "")


def _named(kind: str) -> str:
    """Return the canonical name of a primitive type."""
    name, bracket, size = _BOUND.sub(r"\1", kind).partition("[")
    return _BASIC.get(name, name) + bracket + size
