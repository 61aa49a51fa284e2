# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Choice of the topic of a bag that holds the tracked objects."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from rosbags.interfaces import Connection

from msg_adapters.adapter import InputAdapter
from msg_adapters.bags.bag_definitions import obstacle
from msg_adapters.bags.bag_reader import DecodingBagReader
from msg_adapters.registry import INPUTS, adapter_for_type
from mtpgo_core.errors import MessageError, RecordingError, found_names
from mtpgo_training.data.recording_bag import LANES_TOPIC, OBJECTS_TOPIC

MARKERS = "visualization_msgs/msg/MarkerArray"

_ANYTHING = (MARKERS, "sensor_msgs/msg/PointCloud2")
_OUTPUTS = ("predictions", "markers")
_LOOKED_AT = 20
"""Messages read to find out what a topic holds; chosen: the first ones may be empty."""

Usable = dict[tuple[str, str], list[Connection]]
"""Connections that may hold tracked objects, by topic and type."""

_OBJECTS, _EMPTY, _OTHER = 0, 1, 2
"""What the first messages of a topic hold."""


@dataclass(frozen=True)
class ObjectsTopic:
    """The topic of a bag that is read.

    Attributes:
        name: the topic.
        connections: all its channels of the adapter's type; several publishers have several.
        adapter: reads its messages.
        others: the other topics with tracked objects, the next best first.
        remark: why the topic is not read whole, empty if it is.
    """

    name: str
    connections: tuple[Connection, ...]
    adapter: InputAdapter
    others: tuple[str, ...] = ()
    remark: str = ""


def objects_topic(reader: DecodingBagReader, wanted: str = "") -> ObjectsTopic:
    """Return the topic of the tracked objects.

    That is the one asked for, else ``/objects``, else the first of a known type by the number of
    parts of its name and by its name.

    Args:
        reader: the bag.
        wanted: absolute name of the topic, empty to choose one.

    Raises:
        RecordingError: no topic, or not the one asked for, has tracked objects.
    """
    usable = _usable(reader)
    if wanted:
        return _asked_for(reader, usable, wanted)
    if not usable and not any(c.msgcount for c in reader.connections):
        raise RecordingError(f"{reader.path} has no message, it has {_listed(reader)}")
    if not usable:
        raise RecordingError(
            f"{reader.path} has no topic with tracked objects, it has {_listed(reader)}; expected "
            f"one of {', '.join(a.message_type for a in INPUTS.values())}"
        )
    if len(usable) > 1:
        holds = {key: _held(reader, usable[key]) for key in usable if key[1] in _ANYTHING}
        # Clouds and markers may hold anything, also the predictor's own output.
        tracked = [key for key in usable if holds.get(key, _OBJECTS) != _OTHER]
    else:
        holds, tracked = {}, list(usable)
    order = sorted(tracked or usable, key=lambda key: _rank(key, holds.get(key, _OBJECTS)))
    name, message_type = order[0]
    others = tuple(dict.fromkeys(other for other, _ in order[1:] if other != name))
    return _chosen(usable, name, message_type, others)


def nearest_first(topics: Iterable[str], to: str) -> list[str]:
    """Return topics in the order in which they belong to another one, the first the best.

    With several robots in a bag, what belongs to a topic is in its namespace.

    Args:
        topics: their names.
        to: name of the other one.
    """
    return sorted(topics, key=lambda name: (-shared_namespaces(name, to), name.count("/"), name))


def shared_namespaces(topic: str, other: str) -> int:
    """Return how many namespaces, from the first on, two topics have in common.

    ``/r1/odom`` and ``/r1/tracks/objects`` have one, and both have none with ``/r2/odom``.
    """
    pairs = zip(topic.strip("/").split("/")[:-1], other.strip("/").split("/")[:-1], strict=False)
    return sum(1 for _ in itertools.takewhile(lambda pair: pair[0] == pair[1], pairs))


def _rank(key: tuple[str, str], held: int) -> tuple[object, ...]:
    """Return what topics and types are sorted by, the best first."""
    name, message_type = key
    return (
        not name.endswith(OBJECTS_TOPIC),
        message_type in _ANYTHING,
        held,
        name.rpartition("/")[2] in _OUTPUTS,
        name.count("/"),
        name,
    )


def _usable(reader: DecodingBagReader) -> Usable:
    """Return the connections that may hold tracked objects, by topic and type."""
    known = {adapter.message_type for adapter in INPUTS.values()}
    found: Usable = {}
    for connection in reader.connections:
        may_be = connection.msgtype in known and not connection.topic.endswith(LANES_TOPIC)
        if may_be and connection.msgcount > 0 and not obstacle(connection):
            found.setdefault((connection.topic, connection.msgtype), []).append(connection)
    return found


def _asked_for(reader: DecodingBagReader, usable: Usable, wanted: str) -> ObjectsTopic:
    types = [kind for name, kind in usable if name == wanted]
    if types:
        best = max(types, key=lambda kind: sum(c.msgcount for c in usable[wanted, kind]))
        return _chosen(usable, wanted, best)
    there = [c for c in reader.connections if c.topic == wanted]
    if not there:
        raise RecordingError(f"{reader.path} has no topic {wanted}, it has {_listed(reader)}")
    reason = obstacle(there[0]) or (
        f"it has no message of tracked objects but {there[0].msgtype}, expected one of "
        f"{', '.join(a.message_type for a in INPUTS.values())}"
    )
    if not any(c.msgcount for c in there):
        reason = "it has no message"
    raise RecordingError(f"{reader.path}, topic {wanted}: {reason}")


def _chosen(
    usable: Usable, name: str, message_type: str, others: Sequence[str] = ()
) -> ObjectsTopic:
    left_out = [
        f"{sum(c.msgcount for c in connections)} of {kind}"
        for (topic, kind), connections in usable.items()
        if topic == name and kind != message_type
    ]
    remark = ""
    if left_out:
        remark = (
            f"messages of another type than {message_type} are left out: {found_names(left_out)}"
        )
    connections, adapter = tuple(usable[name, message_type]), adapter_for_type(message_type)
    return ObjectsTopic(name, connections, adapter, tuple(others), remark)


def _listed(reader: DecodingBagReader) -> str:
    found = dict.fromkeys(
        f"{c.topic} ({c.msgtype or 'without a type'})" for c in reader.connections
    )
    return found_names(list(found), none="no topic")


def _held(reader: DecodingBagReader, connections: Sequence[Connection]) -> int:
    """Return what the first messages of a topic hold."""
    adapter = adapter_for_type(connections[0].msgtype)
    stored = reader.messages(connections, lambda connection, reason: None)
    for _, received_ns, message in itertools.islice(stored, _LOOKED_AT):
        try:
            if len(adapter.to_states(message, fallback_stamp_ns=received_ns)):
                return _OBJECTS
        except MessageError:
            return _OTHER
    return _EMPTY
