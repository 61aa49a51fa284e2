# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Choice of the topic of a bag that holds the tracked objects."""

from __future__ import annotations

import itertools

from rosbags.interfaces import Connection

from msg_adapters.adapter import InputAdapter
from msg_adapters.bags.bag_reader import DecodingBagReader
from msg_adapters.registry import INPUTS
from mtpgo_core.errors import MessageError, RecordingError
from mtpgo_training.data.recording_bag import LANES_TOPIC, OBJECTS_TOPIC

MARKERS = "visualization_msgs/msg/MarkerArray"

_ANYTHING = (MARKERS, "sensor_msgs/msg/PointCloud2")
_OUTPUTS = ("predictions", "markers")
_LOOKED_AT = 20
"""Messages read to find out what a topic holds; chosen: the first ones may be empty."""


def objects_topic(reader: DecodingBagReader) -> tuple[Connection, InputAdapter]:
    """Return the topic of the tracked objects: ``/objects``, else the first of a known type.

    Raises:
        RecordingError: no topic has a known type.
    """
    by_type = {adapter.message_type: adapter for adapter in INPUTS.values()}
    usable = [
        c
        for c in reader.connections
        if c.msgtype in by_type and not c.topic.endswith(LANES_TOPIC) and c.msgcount > 0
    ]
    # Clouds and markers may hold anything, also the predictor's own output; the other types hold
    # tracked objects only.
    usable.sort(
        key=lambda c: (
            not c.topic.endswith(OBJECTS_TOPIC),
            c.msgtype in _ANYTHING,
            c.topic.rpartition("/")[2] in _OUTPUTS,
            c.topic,
        )
    )
    if not usable:
        topics = ", ".join(f"{c.topic} ({c.msgtype})" for c in reader.connections) or "no topic"
        raise RecordingError(
            f"{reader.path} has no topic with tracked objects, it has {topics}; expected one of "
            f"{', '.join(by_type)}"
        )
    by_name = usable[0].topic.endswith(OBJECTS_TOPIC)
    if len(usable) > 1 and usable[0].msgtype in _ANYTHING and not by_name:
        usable.sort(key=lambda c: not _holds_objects(reader, c, by_type[c.msgtype]))
    return usable[0], by_type[usable[0].msgtype]


def _holds_objects(
    reader: DecodingBagReader, connection: Connection, adapter: InputAdapter
) -> bool:
    """Return whether the first messages of a topic can be read as tracked objects."""
    stored = reader.messages([connection])
    for _, received_ns, message in itertools.islice(stored, _LOOKED_AT):
        try:
            if len(adapter.to_states(message, fallback_stamp_ns=received_ns)):
                return True
        except MessageError:
            return False
    return False
