# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Records of the MCAP format: their fields, and the content of a chunk up to where it breaks.

The format is specified at https://mcap.dev/spec. Nothing here trusts a length: every field is
checked against the bytes that are there, and nothing is allocated that the file does not justify.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import lz4.frame
from backports import zstd

MAGIC = b"\x89MCAP0\r\n"
"""First and last bytes of a complete file."""

FOOTER_BYTES = 9 + 20 + len(MAGIC)
"""Size of the footer record with the magic after it (bytes)."""

HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX = 1, 2, 3, 4, 5, 6, 7
CHUNK_INDEX, STATISTICS, DATA_END = 0x08, 0x0B, 0x0F

DEFINITIONS = (SCHEMA, CHANNEL)
"""Kinds of the records that :func:`note_definition` takes."""

_PREFIX = struct.Struct("<BQ")
"""Before every record: its kind and the length of its content (bytes)."""

PREFIX_BYTES = _PREFIX.size

_MESSAGE = struct.Struct("<HIQQ")
"""Before a message's data: channel, sequence number, log time and publish time (ns)."""

_LAST_NS = 2**63 - 1
"""Latest log time that is taken for one (ns): rosbag2's times are int64."""

LARGEST_CHUNK = 1 << 29
"""Most bytes that a chunk is decompressed to; chosen: 128 times the chunk of rosbag2's fast
preset, and bounds the memory that a small malicious file can ask for."""

_FIRST_FREE = 1 << 16
"""First number for what is defined under a number that is taken; those of a file have 16 bits."""

_SLICE = 1 << 14
"""Bytes that are decompressed at a time where a chunk is damaged; chosen: less than one block."""


class McapError(Exception):
    """Bytes that are not what the format asks for."""


@dataclass(frozen=True)
class McapSchema:
    """The definition of a message type.

    Attributes:
        name: the type, for instance ``sensor_msgs/msg/PointCloud2``.
        encoding: language of the definition: ``ros2msg``, ``ros2idl``, ``jsonschema``, ...
        text: the definition; replacement characters where it is no text.
    """

    name: str
    encoding: str
    text: str


@dataclass(frozen=True)
class McapChannel:
    """A topic with its type, from one or several publishers.

    Attributes:
        schema_id: number of its schema, 0 for none.
        topic: name.
        encoding: of the messages: ``cdr``, ``json``, ...
        metadata: names and values; rosbag2 stores ``offered_qos_profiles`` here.
    """

    schema_id: int
    topic: str
    encoding: str
    metadata: dict[str, str]

    def is_same_as(self, other: McapChannel) -> bool:
        """Return whether two definitions of a channel differ in no more than the metadata."""
        return replace(self, metadata={}) == replace(other, metadata={})


class StoredMessage(NamedTuple):
    """Place of a message in the content of a chunk.

    Attributes:
        time_ns: log time (ns).
        channel_id: number of its channel.
        start, end: its data in the content (bytes).
    """

    time_ns: int
    channel_id: int
    start: int
    end: int


@dataclass
class ChunkContent:
    """What the content of a chunk holds, up to where it breaks.

    Attributes:
        data: the content, or what there is of it.
        messages: in the order of the file.
        schemas, channels: definitions by their number.
        used: bytes of complete records.
        missing: bytes that should follow them.
        problem: why the content ends early, empty if it is complete.
    """

    data: bytes
    messages: list[StoredMessage] = field(default_factory=list)
    schemas: dict[int, McapSchema] = field(default_factory=dict)
    channels: dict[int, McapChannel] = field(default_factory=dict)
    used: int = 0
    missing: int = 0
    problem: str = ""

    @property
    def message_bytes(self) -> int:
        """Size of the records of the messages (bytes)."""
        before = PREFIX_BYTES + _MESSAGE.size
        return sum(message.end - message.start + before for message in self.messages)

    def numbered(self, numbers: Mapping[int, int]) -> list[StoredMessage]:
        """Return the messages with other numbers of their channels.

        Args:
            numbers: of a channel -> the one that it gets, where they differ.
        """
        if not numbers:
            return self.messages
        return [
            message._replace(channel_id=numbers.get(message.channel_id, message.channel_id))
            for message in self.messages
        ]


class McapDefinitions:
    """The definitions of a file, in the order of the file.

    A number that stands for something else already, as where files were joined, is replaced by a
    free one from there on.

    Args:
        schemas: to which schemas are added.
        channels: to which channels are added.
    """

    def __init__(self, schemas: dict[int, McapSchema], channels: dict[int, McapChannel]) -> None:
        self._schemas, self._channels = schemas, channels
        self._schema_numbers: dict[int, int] = {}
        self._channel_numbers: dict[int, int] = {}

    def add(self, content: ChunkContent) -> Mapping[int, int]:
        """Add what a part of the file defines.

        Returns:
            number of a channel in this part -> in the file, where they differ.
        """
        for number, schema in content.schemas.items():
            place = self._schema_numbers.get(number, number)
            if self._schemas.setdefault(place, schema) != schema:
                place = max(_FIRST_FREE, max(self._schemas) + 1)
                self._schemas[place] = schema
                self._schema_numbers[number] = place
        for number, channel in content.channels.items():
            schema_id = self._schema_numbers.get(channel.schema_id, channel.schema_id)
            own = replace(channel, schema_id=schema_id)
            place = self._channel_numbers.get(number, number)
            if not own.is_same_as(self._channels.setdefault(place, own)):
                place = max(_FIRST_FREE, max(self._channels) + 1)
                self._channels[place] = own
                # Another mapping: that of the parts before stays as it is.
                self._channel_numbers = {**self._channel_numbers, number: place}
        return self._channel_numbers


class RecordFields:
    """Reads the fields of one record, one after the other.

    Args:
        data: the content of the record.
    """

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.position = 0

    def take(self, size: int) -> bytes:
        """Return the next bytes.

        Raises:
            McapError: the record is shorter.
        """
        end = self.position + size
        if end > len(self.data):
            raise McapError("a record is too short")
        taken = self.data[self.position : end]
        self.position = end
        return taken

    def number(self, size: int) -> int:
        """Return an unsigned number of ``size`` bytes."""
        return int.from_bytes(self.take(size), "little")

    def text(self) -> str:
        """Return a string, with replacement characters where it is not UTF-8."""
        return self.take(self.number(4)).decode("utf-8", "replace")

    def numbers(self, *sizes: int) -> list[tuple[int, ...]]:
        """Return a list of tuples of numbers, each of ``sizes`` bytes."""
        inner = RecordFields(self.take(self.number(4)))
        rows = []
        while inner.position < len(inner.data):
            rows.append(tuple(inner.number(size) for size in sizes))
        return rows

    def texts(self) -> dict[str, str]:
        """Return names and values."""
        inner = RecordFields(self.take(self.number(4)))
        found = {}
        while inner.position < len(inner.data):
            name = inner.text()
            found[name] = inner.text()
        return found


def _schema_of(data: bytes) -> tuple[int, McapSchema]:
    """Return number and schema of a schema record."""
    fields = RecordFields(data)
    return fields.number(2), McapSchema(fields.text(), fields.text(), fields.text())


def _channel_of(data: bytes) -> tuple[int, McapChannel]:
    """Return number and channel of a channel record."""
    fields = RecordFields(data)
    number, schema_id = fields.number(2), fields.number(2)
    return number, McapChannel(schema_id, fields.text(), fields.text(), fields.texts())


def prefix_of(data: bytes, position: int = 0) -> tuple[int, int]:
    """Return kind and length (bytes) of the record at a position.

    Raises:
        McapError: there is no record of a kind that the format knows.
    """
    if position + PREFIX_BYTES > len(data):
        raise McapError("a record is too short")
    kind, length = _PREFIX.unpack_from(data, position)
    # Kinds from 0x80 on belong to applications, the others are reserved.
    if not (HEADER <= kind <= DATA_END or kind >= 0x80):
        raise McapError(f"no record begins there (kind {kind:#04x})")
    return kind, length


def note_definition(
    kind: int, data: bytes, schemas: dict[int, McapSchema], channels: dict[int, McapChannel]
) -> None:
    """Add what a record defines, by its number.

    Args:
        kind: of the record, one of :data:`DEFINITIONS`.
        data: its content.
        schemas: to which a schema is added.
        channels: to which a channel is added.

    Raises:
        McapError: the record is broken.
    """
    if kind == SCHEMA:
        number, schema = _schema_of(data)
        schemas[number] = schema
    else:
        number, channel = _channel_of(data)
        channels[number] = channel


def records(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield kind and content of records that follow each other.

    Raises:
        McapError: a record is broken.
    """
    position = 0
    while position < len(data):
        kind, length = prefix_of(data, position)
        position += PREFIX_BYTES
        if position + length > len(data):
            raise McapError("a record is too short")
        yield kind, data[position : position + length]
        position += length


def read_content(data: bytes, start_ns: int = 0, end_ns: int = _LAST_NS) -> ChunkContent:
    """Return what the content of a chunk holds, up to where it breaks.

    Args:
        data: the decompressed content.
        start_ns: earliest log time that the chunk claims (ns).
        end_ns: latest log time that the chunk claims (ns).
    """
    content = ChunkContent(data)
    position, size = 0, len(data)
    add, unpack, prefix = content.messages.append, _MESSAGE.unpack_from, _PREFIX.unpack_from
    end_ns = min(end_ns, _LAST_NS)
    try:
        while position < size:
            if position + PREFIX_BYTES > size:
                raise McapError("a record is too short")
            kind, length = prefix(data, position)
            begin = position + PREFIX_BYTES
            end = begin + length
            if end > size:
                raise McapError("a record is too short")
            if kind == MESSAGE:
                start = begin + _MESSAGE.size
                if start > end:
                    raise McapError("a message is too short")
                channel_id, _, time_ns, _ = unpack(data, begin)
                if not start_ns <= time_ns <= end_ns:
                    raise McapError("a message lies outside the times of its chunk")
                add(StoredMessage(time_ns, channel_id, start, end))
            elif kind in DEFINITIONS:
                note_definition(kind, data[begin:end], content.schemas, content.channels)
            else:
                prefix_of(data, position)
            position = content.used = end
    except McapError as error:
        content.problem = str(error)
    return content


def decompress(compression: str, data: bytes, size: int) -> bytes:
    """Return the content of a chunk, or its beginning if the data are cut off or damaged.

    Args:
        compression: ``""``, ``zstd`` or ``lz4``.
        data: what there is of the compressed data.
        size: number of bytes that the chunk claims to hold.

    Raises:
        McapError: the compression is not known, or the chunk is too large.
    """
    if compression == "":
        return data[:size]
    if compression not in _DECOMPRESSORS:
        raise McapError(f"the compression {compression!r} is not known")
    if size > LARGEST_CHUNK:
        raise McapError(f"a chunk claims {size} bytes, expected at most {LARGEST_CHUNK}")
    make = _DECOMPRESSORS[compression]
    try:
        return _inflate(make, data, size, len(data))
    except (OSError, RuntimeError, ValueError, EOFError, zstd.ZstdError):
        return _inflate(make, data, size, _SLICE, until_error=True)


def _inflate(
    make: Callable[[], Any], data: bytes, size: int, step: int, *, until_error: bool = False
) -> bytes:
    """Decompress frames that follow each other, ``step`` bytes at a time."""
    parts: list[bytes] = []
    held, inflater = 0, make()
    for position in range(0, len(data), max(1, step)):
        given = data[position : position + step]
        while held < size:
            try:
                part = inflater.decompress(given, size - held)
            except (OSError, RuntimeError, ValueError, EOFError, zstd.ZstdError):
                if until_error:
                    return b"".join(parts)
                raise
            parts.append(part)
            held += len(part)
            if inflater.eof and inflater.unused_data:
                given, inflater = inflater.unused_data, make()
            elif inflater.eof:
                inflater = make()
                break
            else:
                break
    return b"".join(parts)


_DECOMPRESSORS: dict[str, Callable[[], Any]] = {
    "zstd": zstd.ZstdDecompressor,
    "lz4": lz4.frame.LZ4FrameDecompressor,
}
"""Compression of a chunk -> maker of a decompressor that can be given a part of the data."""
