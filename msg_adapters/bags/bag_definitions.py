# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Decoders of recorded messages, each made from the definition of its own type.

A definition is read only with the first message of its type, so unreadable definitions of other
types do not matter. A missing or unreadable definition is replaced by the one of this package.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from typing import Any, cast

from rosbags.interfaces import (
    Connection,
    ConnectionExtRosbag2,
    MessageDefinition,
    MessageDefinitionFormat,
    Nodetype,
)
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from msg_adapters.bags.bag_types import bag_typestore, earlier_typestore, types_of_fields
from mtpgo_core.errors import MessageError

Decoder = Callable[[bytes], Any]

_SEPARATOR = "=" * 80 + "\n"
"""Line between the definitions of several types in one text, as rosbag2 writes it."""

_IDL_COMMENT = re.compile(r'("(?:[^"\\]|\\.)*")|/\*.*?\*/|//[^\n]*|^[ \t]*#[^\n]*', re.S | re.M)
"""Comments and includes of an IDL text, and quoted texts, which may look like them."""

_KEPT_CHARACTERS = 1 << 16
"""Longest definition whose types are kept for the next bag; chosen, ten times the longest known
one: with at most 64 of them a hostile file cannot fill the memory."""


def qos_and_encoding(connection: Connection) -> ConnectionExtRosbag2:
    """Return the QoS that a connection was offered with, and how its messages are serialised."""
    return cast(ConnectionExtRosbag2, connection.ext)


def encoding_of(connection: Connection) -> str:
    """Return how the messages of a connection are serialised, such as ``cdr``."""
    return qos_and_encoding(connection).serialization_format


def obstacle(connection: Connection) -> str:
    """Return why the messages of a connection cannot be decoded, as far as its description shows.

    Empty if no obstacle is known; the definition itself is not read.
    """
    encoding = encoding_of(connection)
    if encoding not in ("cdr", "ros1"):
        return f"its messages are encoded as {encoding or 'nothing known'!r}, expected 'cdr'"
    if not connection.msgtype:
        return "its messages have no type"
    without = connection.msgdef.format is MessageDefinitionFormat.NONE
    if without and connection.msgtype not in _own_types(encoding).fielddefs:
        return f"the bag has no definition of {connection.msgtype}"
    return ""


class BagDefinitions:
    """The decoders of a bag's messages, made when they are first asked for.

    Args:
        connections: all connections of the bag: one may have the definition that another lacks.
    """

    def __init__(self, connections: Sequence[Connection]) -> None:
        self._connections = connections
        self._decoders: dict[tuple[str, MessageDefinition, str], Decoder] = {}

    def decoder(self, connection: Connection) -> Decoder:
        """Return the function that decodes the messages of a connection.

        Raises:
            MessageError: the type has no definition that can be read, or the messages are encoded
                in a way that ROS does not have.
        """
        key = (connection.msgtype, connection.msgdef, encoding_of(connection))
        if key not in self._decoders:
            self._decoders[key] = self._make(connection)
        return self._decoders[key]

    def type_hash(self, connection: Connection) -> str:
        """Return the hash by which ROS 2 names the definition of a connection's type.

        Raises:
            MessageError: the type has no definition that can be read.
        """
        name, encoding = connection.msgtype, encoding_of(connection)
        return connection.digest or str(self._store(connection, encoding).hash_rihs01(name))

    def layout(self, connection: Connection) -> list[tuple[str, str]]:
        """Return path and type of all fields of a type, in order, as the bag defines them.

        Those within another message follow it. Names of types are those of ``.msg`` files, with
        ``[]`` or ``[n]`` behind that of a list, and ``message`` for another message. Empty where
        the bag has no definition that can be read.
        """
        if not self._defined(connection.msgtype):
            return []
        try:
            store = self._store(connection, encoding_of(connection))
        except MessageError:
            return []
        return list(_fields_within(store, connection.msgtype))

    def _make(self, connection: Connection) -> Decoder:
        name, encoding = connection.msgtype, encoding_of(connection)
        if encoding not in ("cdr", "ros1") or not name:
            raise MessageError(obstacle(connection))
        store = self._store(connection, encoding)
        if encoding == "ros1":
            return lambda data: store.deserialize_ros1(data, name)
        stores = [store]
        if store is bag_typestore() and not self._defined(name):
            stores += [one for one in (earlier_typestore(),) if name in one.fielddefs]
        return _first_that_reads([functools.partial(_cdr, one, name) for one in stores])

    def _defined(self, name: str) -> bool:
        """Return whether the bag has a definition of a type."""
        return any(
            one.msgtype == name and one.msgdef.format is not MessageDefinitionFormat.NONE
            for one in self._connections
        )

    def _store(self, connection: Connection, encoding: str) -> Typestore:
        """Return a store with the type of a connection and all that it is made of."""
        name, own = connection.msgtype, _own_types(encoding)
        reason = f"the bag has no definition of {name}"
        others = [
            other
            for other in self._connections
            if other.msgtype == name and other.msgdef != connection.msgdef
        ]
        for candidate in [connection, *others]:
            if candidate.msgdef.format is MessageDefinitionFormat.NONE:
                continue
            try:
                return _types_of(candidate.msgdef, name, encoding)
            except Exception as error:  # a damaged text fails the library in many ways
                reason = f"the definition of {name} in the bag cannot be read: {_short(error)}"
        if name in own.fielddefs:
            return own
        raise MessageError(reason)


def _cdr(store: Typestore, name: str, data: bytes) -> Any:
    return store.deserialize_cdr(data, name)


def _first_that_reads(decoders: list[Decoder]) -> Decoder:
    """Return a decoder that reads with the first of several that can, and then keeps to it."""
    if len(decoders) == 1:
        return decoders[0]

    def read(data: bytes) -> Any:
        try:
            return decoders[0](data)
        except Exception as error:  # bytes of another version fail in many ways
            for place, decoder in enumerate(decoders[1:], start=1):
                with suppress(Exception):
                    message = decoder(data)
                    decoders.insert(0, decoders.pop(place))
                    return message
            raise error

    return read


def _own_types(encoding: str) -> Typestore:
    """Return the types that are known without a bag."""
    return _ros1_types() if encoding == "ros1" else bag_typestore()


@functools.cache
def _ros1_types() -> Typestore:
    """Return the types of ROS 1; their code is made once, which takes 40 ms for markers."""
    return get_typestore(Stores.ROS1_NOETIC)


def _types_of(definition: MessageDefinition, name: str, encoding: str) -> Typestore:
    """Return a store with a type as a text defines it.

    Bags have the same definitions again and again, and to read that of markers takes 10 ms.

    Raises:
        Exception: the text cannot be read, or does not define the type.
    """
    if len(definition.data) > _KEPT_CHARACTERS:
        return _read_types(definition, name, encoding)
    return _kept_types(definition, name, encoding)


def _read_types(definition: MessageDefinition, name: str, encoding: str) -> Typestore:
    return _registered(name, _parsed(definition, name), _own_types(encoding))


_kept_types = functools.lru_cache(maxsize=64)(_read_types)


def _parsed(definition: MessageDefinition, name: str) -> dict[str, Any]:
    """Return the types of a definition text."""
    if definition.format is MessageDefinitionFormat.MSG:
        return dict(get_types_from_msg(definition.data, name))
    types: dict[str, Any] = {}
    for part in definition.data.split(_SEPARATOR):
        head, _, rest = part.partition("\n")
        text = rest if head.startswith("IDL:") else part
        text = _IDL_COMMENT.sub(lambda found: found[1] or " ", text)
        if text.strip():
            types.update(get_types_from_idl(text))
    return types


def _registered(name: str, types: dict[str, Any], own: Typestore) -> Typestore:
    """Return a store of a type and of what it consists of, where missing from the own types."""
    needed: dict[str, Any] = {}
    waiting = [name]
    while waiting:
        wanted = waiting.pop()
        if wanted in needed:
            continue
        found = types.get(wanted) or own.fielddefs.get(wanted)
        if found is None:
            raise MessageError(f"it does not define {wanted}")
        needed[wanted] = found
        waiting += types_of_fields(found[1])
    if all(_fields(own, part) == fields for part, (_, fields) in needed.items()):
        return own  # whose code is made once
    store = get_typestore(Stores.EMPTY)
    store.register(needed)
    store.get_msgdef(name)
    return store


def _fields(store: Typestore, name: str) -> Any:
    """Return the fields of a type, None if the store does not have it."""
    return store.fielddefs[name][1] if name in store.fielddefs else None


def known_layout(message_type: str) -> list[tuple[str, str]]:
    """Return path and type of all fields of a type as it is known without a bag.

    See :meth:`BagDefinitions.layout`; empty where it is not known.
    """
    store = bag_typestore()
    return list(_fields_within(store, message_type)) if message_type in store.fielddefs else []


def _fields_within(store: Typestore, name: str, before: str = "") -> Iterator[tuple[str, str]]:
    """Yield path and type of the fields of a type, each followed by those of the message in it."""
    for field, description in store.fielddefs[name][1]:
        kind, inner = _kind_of(description)
        yield before + field, kind
        if inner:
            yield from _fields_within(store, inner, f"{before}{field}.")


def _kind_of(description: Any) -> tuple[str, str]:
    """Return the type of a field, and the type of the message in it, empty if there is none."""
    node, content = description
    if node is Nodetype.BASE:
        return str(content[0]), ""
    if node is Nodetype.NAME:
        return "message", str(content)
    kind, inner = _kind_of(content[0])
    return f"{kind}[{content[1] if node is Nodetype.ARRAY else ''}]", inner


def _short(error: Exception) -> str:
    """Return the beginning of an error's text: that of the parser repeats the definition."""
    text = " ".join(str(error).split()) or type(error).__name__
    return text if len(text) <= 120 else text[:117] + "..."
