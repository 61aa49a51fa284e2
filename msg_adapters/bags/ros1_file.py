# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Reading of one bag of ROS 1: by rosbags, or up to where it breaks.

The index of such a bag is written when it is closed. A bag whose recorder was killed
(``NAME.bag.active``) has none, and rosbags does not read it; its chunks are scanned here.
"""

from __future__ import annotations

import bz2
import struct
from collections import Counter
from collections.abc import Callable, Collection, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, cast

import lz4.frame
from rosbags.interfaces import (
    Connection,
    ConnectionExtRosbag1,
    ConnectionExtRosbag2,
    MessageDefinition,
    MessageDefinitionFormat,
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag1 import Reader, ReaderError

from msg_adapters.bags.bag_loss import BagLoss, LibraryFile
from msg_adapters.bags.lazy_merge import TimedStream, merge_in_time
from mtpgo_core.errors import reason_of

MAGIC_ROS1 = b"#ROSBAG V"
"""First bytes of a bag of ROS 1."""

ENCODING_ROS1 = "ros1"
"""How the messages of ROS 1 are serialised, as MCAP files call it."""

_NO_TIME = QosTime(0, 0)
_LATCHED = Qos(
    QosHistory.KEEP_LAST,
    1,
    QosReliability.RELIABLE,
    QosDurability.TRANSIENT_LOCAL,
    _NO_TIME,
    _NO_TIME,
    QosLiveliness.AUTOMATIC,
    _NO_TIME,
    False,
)
"""The QoS that a latched topic of ROS 1 comes nearest to."""


class Ros1File(LibraryFile):
    """The messages of a bag of ROS 1, version 2.0.

    Args:
        path: the file.

    Attributes:
        connections: its topics by number, described as those of ROS 2.
        start_ns, end_ns: log times of the first and last message (ns).

    Raises:
        rosbags.rosbag1.ReaderError: it cannot be read.
    """

    def __init__(self, path: Path) -> None:
        reader = Reader(path)
        try:
            reader.open()
        except (AssertionError, ReaderError, ValueError, KeyError, IndexError) as error:
            raise ReaderError(f"it is no complete bag of ROS 1: {reason_of(error)}") from error
        super().__init__(path, reader, reader.start_time, reader.end_time - 1)
        self.connections = {}
        for own in reader.connections:
            latched = cast(ConnectionExtRosbag1, own.ext).latching
            profiles = [_LATCHED] if latched else []
            self.connections[own.id] = own._replace(
                digest="", ext=ConnectionExtRosbag2(ENCODING_ROS1, profiles), owner=self
            )
        rest = _behind_index(path)
        if rest:
            # It may be another bag, or what a loss of power has left.
            self._loss = BagLoss(
                path,
                f"has {rest} bytes behind its end that are not part of it",
                reader.message_count,
                (self.end_ns - self.start_ns) * 1e-9,
            )


_HEADED = b"#ROSBAG V2.0\n"
_MESSAGE, _CHUNK, _CHUNK_INFO, _CONNECTION = b"\x02", b"\x05", b"\x06", b"\x07"
"""Kinds of records, as their field ``op`` names them."""

_LARGEST_CHUNK = 1 << 29
"""Most bytes that are read of a chunk, and of its content; chosen as for MCAP files."""

_INFLATERS: dict[bytes, Callable[[], Any]] = {
    b"bz2": bz2.BZ2Decompressor,
    b"lz4": lz4.frame.LZ4FrameDecompressor,
}
"""Compression of a chunk -> maker of a decompressor that can be given a part of the data."""

_SLICE = 1 << 14
"""Bytes that are decompressed at a time, so that what precedes a damage is kept; chosen."""


@dataclass(frozen=True)
class _Chunk:
    """A chunk of messages, or what there is of it.

    Attributes:
        position: of its data in the file (bytes).
        length: of its data (bytes).
        compression: ``none``, ``bz2`` or ``lz4``.
        size: of its content (bytes), by its own claim.
        start_ns, end_ns: log times of its first and last message (ns).
    """

    position: int
    length: int
    compression: bytes
    size: int
    start_ns: int = 0
    end_ns: int = 0


class UnindexedRos1File:
    """The messages of a bag of ROS 1 that was not closed, up to where it breaks.

    Args:
        path: the file.

    Attributes:
        connections: its topics by number, described as those of ROS 2.
        start_ns, end_ns: log times of the first and last message (ns).

    Raises:
        rosbags.rosbag1.ReaderError: it holds no message that can be read.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.connections: dict[int, Connection] = {}
        self._chunks: list[_Chunk] = []
        self._counts: Counter[int] = Counter()
        self._without_topic = self._damaged = 0
        self._cut_off = False
        self._file = path.open("rb")
        try:
            self._scan(self._file)
        except BaseException:
            self._file.close()
            raise
        if not self._chunks:
            self._file.close()
            raise ReaderError(
                "it is no complete bag of ROS 1: it has neither an index nor a whole message"
            )
        self.start_ns = min(chunk.start_ns for chunk in self._chunks)
        self.end_ns = max(chunk.end_ns for chunk in self._chunks)
        for number, connection in self.connections.items():
            self.connections[number] = connection._replace(msgcount=self._counts[number])

    def _scan(self, file: BinaryIO) -> None:
        size = file.seek(0, 2)
        position = len(_HEADED)
        while position < size:
            head = _record_at(file, position, size)
            # Zeros may follow the break, which file systems leave after a loss of power.
            if head is None or b"op" not in head[0]:
                self._cut_off = True
                return
            fields, begin, end = head
            if fields.get(b"op") == _CHUNK:
                claimed = int.from_bytes(fields.get(b"size", b""), "little")
                length = min(end, size) - begin
                self._add(_Chunk(begin, length, fields.get(b"compression", b""), claimed))
            self._cut_off = end > size
            position = end

    def _add(self, chunk: _Chunk) -> None:
        """Add a chunk with its topics, if it has a message."""
        times = []
        used = 0
        for fields, data, used in _records_of(self._content(chunk)):  # noqa: B007  used below
            number = int.from_bytes(fields.get(b"conn", b""), "little")
            if fields.get(b"op") == _CONNECTION and number not in self.connections:
                self.connections[number] = _connection(number, fields, data, self)
            elif fields.get(b"op") == _MESSAGE and number in self.connections:
                times.append(_time_of(fields))
                self._counts[number] += 1
            elif fields.get(b"op") == _MESSAGE:
                self._without_topic += 1
        self._damaged += used < chunk.size
        if times:
            found = (chunk.position, chunk.length, chunk.compression, chunk.size)
            self._chunks.append(_Chunk(*found, min(times), max(times)))

    def _content(self, chunk: _Chunk) -> bytes:
        """Return the content of a chunk, or its beginning where it is cut off or damaged."""
        self._file.seek(chunk.position)
        data = self._file.read(min(chunk.length, _LARGEST_CHUNK))
        if chunk.compression not in _INFLATERS:
            return data if chunk.compression == b"none" else b""
        inflater = _INFLATERS[chunk.compression]()
        parts: list[bytes] = []
        left = min(chunk.size, _LARGEST_CHUNK)
        with suppress(OSError, RuntimeError, ValueError, EOFError):
            for begin in range(0, len(data), _SLICE):
                parts.append(inflater.decompress(data[begin : begin + _SLICE], left))
                left -= len(parts[-1])
                while left > 0 and not (inflater.eof or inflater.needs_input):
                    parts.append(inflater.decompress(b"", left))
                    left -= len(parts[-1])
                if inflater.eof or left <= 0:
                    break
        return b"".join(parts)

    def messages(
        self, numbers: Collection[int], start_ns: int | None, stop_ns: int | None
    ) -> Iterator[tuple[int, int, bytes]]:
        """Yield log time (ns), number of the topic and bytes of messages, ascending in time."""
        first = 0 if start_ns is None else start_ns
        last = 2**63 if stop_ns is None else stop_ns
        yield from merge_in_time(
            TimedStream(chunk.start_ns, self._messages_of(chunk, frozenset(numbers), first, last))
            for chunk in self._chunks
            if chunk.end_ns >= first and chunk.start_ns < last
        )

    def _messages_of(
        self, chunk: _Chunk, numbers: frozenset[int], first_ns: int, last_ns: int
    ) -> Iterator[tuple[int, int, bytes]]:
        found = [
            (_time_of(fields), int.from_bytes(fields.get(b"conn", b""), "little"), data)
            for fields, data, _ in _records_of(self._content(chunk))
            if fields.get(b"op") == _MESSAGE
        ]
        found.sort(key=lambda item: item[0])
        for time_ns, number, data in found:
            if number in numbers and first_ns <= time_ns < last_ns:
                yield time_ns, number, data

    def loss(self) -> BagLoss | None:
        """Return what is lost."""
        read = sum(self._counts.values())
        read_s = (self.end_ns - self.start_ns) * 1e-9
        if self._cut_off:
            return BagLoss(self._path, "is cut off, as when power is lost", read, read_s)
        reason = "has no index, as when its recorder is killed"
        if self._damaged:
            return BagLoss(self._path, f"{reason}, and is damaged in its chunks", read, read_s)
        if self._without_topic:
            reason += ", and has messages of topics that it does not describe"
        return BagLoss(self._path, reason, read, read_s, messages=self._without_topic, exact=True)

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def open_ros1(path: Path) -> Ros1File | UnindexedRos1File:
    """Return the messages of a bag of ROS 1, by its index or without one.

    Raises:
        rosbags.rosbag1.ReaderError: it cannot be read.
    """
    try:
        return Ros1File(path)
    except ReaderError:
        with path.open("rb") as stream:
            if stream.read(len(_HEADED)) != _HEADED:
                raise
        return UnindexedRos1File(path)


def _behind_index(path: Path) -> int:
    """Return how many bytes, other than zeros, lie behind the index of a bag."""
    with path.open("rb") as file:
        size = file.seek(0, 2)
        head = _record_at(file, len(_HEADED), size)
        position = int.from_bytes(head[0].get(b"index_pos", b""), "little") if head else 0
        while 0 < position < size:
            found = _record_at(file, position, size)
            if found is None or found[0].get(b"op") not in (_CONNECTION, _CHUNK_INFO):
                break
            position = found[2]
        file.seek(position)
        return len(file.read(_LARGEST_CHUNK).strip(b"\0")) if position else 0


def _record_at(
    file: BinaryIO, position: int, size: int
) -> tuple[dict[bytes, bytes], int, int] | None:
    """Return fields, begin and end of the data of the record at a position, None without one."""
    file.seek(position)
    length = int.from_bytes(file.read(4), "little")
    if position + 4 + length + 4 > size:
        return None
    fields = _fields(file.read(length))
    begin = position + 4 + length + 4
    return fields, begin, begin + int.from_bytes(file.read(4), "little")


def _records_of(content: bytes) -> Iterator[tuple[dict[bytes, bytes], bytes, int]]:
    """Yield fields, data and end of the records in the content of a chunk, until it breaks."""
    position = 0
    while position + 4 <= len(content):
        begin = position + 4 + int.from_bytes(content[position : position + 4], "little")
        if begin + 4 > len(content):
            return
        end = begin + 4 + int.from_bytes(content[begin : begin + 4], "little")
        fields = _fields(content[position + 4 : begin])
        if end > len(content) or b"op" not in fields:
            return
        yield fields, content[begin + 4 : end], end
        position = end


def _fields(header: bytes) -> dict[bytes, bytes]:
    """Return the fields of a record by name, as far as they can be read."""
    found: dict[bytes, bytes] = {}
    position = 0
    while position + 4 <= len(header):
        end = position + 4 + int.from_bytes(header[position : position + 4], "little")
        name, equals, value = header[position + 4 : end].partition(b"=")
        if not equals or end > len(header):
            break
        found[name] = value
        position = end
    return found


def _time_of(fields: dict[bytes, bytes]) -> int:
    """Return the log time of a message (ns)."""
    value = fields.get(b"time", b"")
    seconds, nanoseconds = struct.unpack("<II", value) if len(value) == 8 else (0, 0)
    return seconds * 10**9 + nanoseconds


def _connection(number: int, fields: dict[bytes, bytes], data: bytes, owner: object) -> Connection:
    """Return a topic of a bag of ROS 1 as rosbags describes one of ROS 2."""
    about = _fields(data)
    package, _, name = about.get(b"type", b"").decode(errors="replace").partition("/")
    text = about.get(b"message_definition", b"").decode(errors="replace")
    kind = MessageDefinitionFormat.MSG if text.strip() else MessageDefinitionFormat.NONE
    latched = about.get(b"latching") == b"1"
    return Connection(
        id=number,
        topic=fields.get(b"topic", b"").decode(errors="replace"),
        msgtype=f"{package}/msg/{name}" if name else "",
        msgdef=MessageDefinition(kind, text if text.strip() else ""),
        digest="",
        msgcount=0,
        ext=ConnectionExtRosbag2(ENCODING_ROS1, [_LATCHED] if latched else []),
        owner=owner,
    )
