# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Follows an MCAP file while it is recorded, without reading anything twice."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from msg_adapters.bags.bag_definitions import BagDefinitions, Decoder
from msg_adapters.bags.mcap_records import (
    CHUNK,
    DATA_END,
    DEFINITIONS,
    FOOTER,
    MAGIC,
    PREFIX_BYTES,
    McapChannel,
    McapError,
    McapSchema,
    RecordFields,
    decompress,
    note_definition,
    prefix_of,
    read_content,
)
from msg_adapters.bags.stored_bag import mcap_connection
from mtpgo_core.errors import MessageError, RecordingError


class FollowedMessage(NamedTuple):
    """A message that came.

    Attributes:
        topic: its topic.
        message_type: its type.
        time_ns: when it was recorded (ns).
        message: decoded.
    """

    topic: str
    message_type: str
    time_ns: int
    message: Any


class GrowingBag:
    """The messages of an MCAP file that is being written by whole chunks.

    Args:
        path: the file; it may not exist yet.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._position = 0
        self._ended = False
        self._schemas: dict[int, McapSchema] = {}
        self._channels: dict[int, McapChannel] = {}
        self._decoders: dict[int, tuple[str, Decoder | None]] = {}

    def new_messages(self) -> Iterator[FollowedMessage]:
        """Yield the messages of the chunks that have been completed since the last call.

        Messages whose definition cannot be read are left out.

        Raises:
            RecordingError: the file is damaged.
        """
        if self._ended or not self._path.exists():
            return
        with self._path.open("rb") as file:
            size = file.seek(0, 2)
            if self._position == 0:
                if size < len(MAGIC):
                    return
                self._position = len(MAGIC)
            while self._position + PREFIX_BYTES <= size:
                file.seek(self._position)
                try:
                    kind, length = prefix_of(file.read(PREFIX_BYTES))
                    if self._position + PREFIX_BYTES + length > size:
                        return
                    if kind in (DATA_END, FOOTER):
                        self._ended = True
                        return
                    found = self._messages_in(kind, file.read(length))
                except McapError as error:
                    raise RecordingError(f"{self._path} is damaged: {error}") from error
                self._position += PREFIX_BYTES + length
                yield from found

    def _messages_in(self, kind: int, data: bytes) -> list[FollowedMessage]:
        """Return the messages of a record; note its definitions."""
        if kind in DEFINITIONS:
            note_definition(kind, data, self._schemas, self._channels)
        if kind != CHUNK:
            return []
        fields = RecordFields(data)
        _, _, size, _ = (fields.number(n) for n in (8, 8, 8, 4))
        compression, stored = fields.text(), fields.number(8)
        content = read_content(decompress(compression, fields.take(stored), size))
        if content.problem:
            raise McapError(content.problem)
        self._schemas.update(content.schemas)
        self._channels.update(content.channels)
        found = []
        for place in content.messages:
            message_type, decode = self._decoder(place.channel_id)
            if decode is not None:
                message = decode(content.data[place.start : place.end])
                topic = self._channels[place.channel_id].topic
                found.append(FollowedMessage(topic, message_type, place.time_ns, message))
        return found

    def _decoder(self, number: int) -> tuple[str, Decoder | None]:
        """Return type and decoder of a channel, None for one that cannot be decoded."""
        if number not in self._channels:
            return "", None
        if number not in self._decoders:
            channel = self._channels[number]
            schema = self._schemas.get(channel.schema_id)
            connection = mcap_connection(number, channel, schema, 0, self)
            try:
                decoder: Decoder | None = BagDefinitions([connection]).decoder(connection)
            except MessageError:
                decoder = None
            self._decoders[number] = connection.msgtype, decoder
        return self._decoders[number]
