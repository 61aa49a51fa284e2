# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Reads one MCAP file: by its index, or without one from the beginning up to where it breaks.

A recorder that is killed or loses power leaves a file without index and footer, whose last chunk
may be incomplete. Such a file is scanned once when it is opened. Where a chunk in the middle is
damaged, the messages before the damage and all other chunks are read.
"""

from __future__ import annotations

import re
import zlib
from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

from msg_adapters.bags.bag_loss import BagLoss
from msg_adapters.bags.lazy_merge import TimedStream, merge_in_time
from msg_adapters.bags.mcap_records import (
    CHUNK,
    CHUNK_INDEX,
    DATA_END,
    DEFINITIONS,
    FOOTER,
    FOOTER_BYTES,
    HEADER,
    LARGEST_CHUNK,
    MAGIC,
    MESSAGE,
    MESSAGE_INDEX,
    PREFIX_BYTES,
    STATISTICS,
    ChunkContent,
    McapChannel,
    McapDefinitions,
    McapError,
    McapSchema,
    RecordFields,
    decompress,
    note_definition,
    prefix_of,
    read_content,
    records,
)

_RUN_BYTES = 1 << 16
"""Messages outside of chunks are read in runs of up to this size (bytes). Chosen: where runs are
short, little is read twice."""

_WINDOW = 1 << 20
"""Bytes that are searched at a time for the next chunk behind a damage; chosen."""

_CHUNK_HEAD = re.compile(
    rb"\x06.{4}\x00{4}.{20}\x00{4}.{4}(?:\x04\x00{3}zstd|\x03\x00{3}lz4|\x00{4})", re.DOTALL
)
"""Beginning of a chunk below 4 GB: kind, length, times, size, check sum, compression."""

_HEAD_BYTES = PREFIX_BYTES + 8 + 8 + 8 + 4 + 4 + 4
"""Longest match of the pattern (bytes)."""

_NAME_BYTES = 64
"""Longest name of a compression that is read (bytes); chosen: known names have at most four."""

Key = TypeVar("Key")


@dataclass
class McapChunk:
    """A chunk, or a run of messages outside of chunks.

    Attributes:
        position: of its record in the file (bytes).
        length: of its record, or of what there is of it (bytes).
        start_ns, end_ns: log times of its first and last message (ns), as its header states.
        messages: number of messages that it should hold, None if unknown.
        plain: it is a run of messages outside of chunks.
        numbers: channel numbers in the file by those in the chunk, where they differ.
    """

    position: int
    length: int
    start_ns: int
    end_ns: int
    messages: int | None = None
    plain: bool = False
    numbers: Mapping[int, int] = field(default_factory=dict)


@dataclass
class _ChunkLoss:
    """The part of a chunk that cannot be read, and why."""

    problem: str
    messages: int = 0
    start_ns: int = 0
    end_ns: int = 0
    exact: bool = False

    @property
    def seconds(self) -> float:
        """Duration that is lost (s)."""
        return max(0, self.end_ns - self.start_ns) * 1e-9


class _CutOffError(McapError):
    """A record that goes beyond the end of the file.

    Args:
        kind: of the record.
    """

    def __init__(self, kind: int) -> None:
        super().__init__("a record is cut off")
        self.kind = kind


class McapFile:
    """The messages of one MCAP file.

    Args:
        path: the file.

    Attributes:
        path: the file.
        schemas: by their number.
        channels: by their number. A number that the file defines again with other content is
            replaced by a free one from there on.
        counts: messages by the number of their channel.
        start_ns, end_ns: log times of the first and last message (ns); both 0 without messages.
        chunks: its chunks, in the order of the file.

    Raises:
        McapError: it is not an MCAP file.
        OSError: it cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.schemas: dict[int, McapSchema] = {}
        self.channels: dict[int, McapChannel] = {}
        self.counts: Counter[int] = Counter()
        self.start_ns = self.end_ns = 0
        self.chunks: list[McapChunk] = []
        self._lost: dict[int, _ChunkLoss] = {}
        self._break = ""
        self._mean = (0, 0)  # messages and bytes of the chunks scanned so far
        self._scanned = False
        self._definitions = McapDefinitions(self.schemas, self.channels)
        self._file = path.open("rb")
        try:
            self._size = self._file.seek(0, 2)
            data_start = self._head()
            try:
                indexed = self._read_index(data_start)
            except McapError:
                indexed = False
            if not indexed:
                self._scan(data_start)
        except BaseException:
            self._file.close()
            raise

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def messages(
        self, channels: Collection[int], start_ns: int | None = None, stop_ns: int | None = None
    ) -> Iterator[tuple[int, int, bytes]]:
        """Yield log time (ns), channel and bytes of messages, ascending in time.

        Args:
            channels: numbers of the channels wanted.
            start_ns: earliest log time (ns).
            stop_ns: first log time that is left out (ns).
        """
        start_ns = 0 if start_ns is None else start_ns
        stop_ns = 2**64 if stop_ns is None else stop_ns
        wanted = frozenset(channels)
        read: Counter[int] = Counter()
        yield from merge_in_time(
            TimedStream(
                chunk.start_ns, self._chunk_messages(chunk, wanted, start_ns, stop_ns, read)
            )
            for chunk in self.chunks
            if chunk.end_ns >= start_ns and chunk.start_ns < stop_ns and chunk.messages != 0
        )
        if not self._scanned and start_ns <= self.start_ns and stop_ns > self.end_ns:
            self._compare_with_statistics(read, wanted)

    def _compare_with_statistics(self, read: Mapping[int, int], wanted: Collection[int]) -> None:
        """Note a loss if the summary counts more messages than were read.

        Args:
            read: number of messages read, by channel.
            wanted: channels of which all messages were read.
        """
        missing = sum(max(0, self.counts[number] - read.get(number, 0)) for number in wanted)
        if missing > sum(loss.messages for loss in self._lost.values()):
            end_ns = self.end_ns
            problem = "its chunks hold fewer messages than its summary counts"
            self._lost = {-1: _ChunkLoss(problem, missing, end_ns, end_ns, exact=True)}

    def loss(self) -> BagLoss | None:
        """Return the loss that is known so far, None if there is none.

        In a file with an index, damage in a chunk is found only when the chunk is read.
        """
        if not self._lost and not self._break:
            return None
        losses = list(self._lost.values())
        read, lost = sum(self.counts.values()), sum(loss.messages for loss in losses)
        if not self._scanned:
            read -= lost
        within_s = sum(loss.seconds for loss in losses if loss.end_ns <= self.end_ns)
        return BagLoss(
            file=self.path,
            reason=self._break or f"is damaged ({losses[0].problem})",
            read=read,
            read_s=max(0.0, (self.end_ns - self.start_ns) * 1e-9 - within_s),
            messages=lost,
            seconds=sum(loss.seconds for loss in losses),
            exact=all(loss.exact for loss in losses),
        )

    def _read(self, position: int, length: int) -> bytes:
        self._file.seek(position)
        return self._file.read(max(0, min(length, self._size - position)))

    def _head(self) -> int:
        """Check the beginning and return the position of the first record after the header."""
        begin = self._read(0, len(MAGIC))
        if not begin:
            raise McapError("it is empty")
        if begin != MAGIC:
            raise McapError("it does not begin as an MCAP file")
        position = self._behind_header(0)
        if position is None:
            raise McapError("its header is cut off or damaged")
        return position

    def _behind_header(self, start: int) -> int | None:
        """Return where the records of an MCAP file begin, None if none begins at ``start``."""
        begin = self._read(start, len(MAGIC) + PREFIX_BYTES)
        if begin[: len(MAGIC)] != MAGIC or len(begin) < len(MAGIC) + PREFIX_BYTES:
            return None
        kind, length = begin[len(MAGIC)], int.from_bytes(begin[len(MAGIC) + 1 :], "little")
        position = start + len(begin) + length
        return position if kind == HEADER and position <= self._size else None

    # By the index

    def _read_index(self, data_start: int) -> bool:
        """Read the summary at the end; return whether it tells all that is needed.

        Raises:
            McapError: there is none, or it is damaged.
        """
        end = max(0, self._size - FOOTER_BYTES)
        footer = self._read(end, FOOTER_BYTES)
        if end < data_start or footer[-len(MAGIC) :] != MAGIC or prefix_of(footer) != (FOOTER, 20):
            raise McapError("no footer")
        fields = RecordFields(footer[PREFIX_BYTES:])
        summary_start, _, checksum = fields.number(8), fields.number(8), fields.number(4)
        if not data_start <= summary_start <= end:
            raise McapError("no summary")
        summary = self._read(summary_start, end - summary_start)
        if checksum and zlib.crc32(summary + footer[: PREFIX_BYTES + 16]) != checksum:
            raise McapError("the check sum of the summary is wrong")
        statistics = None
        for kind, data in records(summary):
            if kind in DEFINITIONS:
                note_definition(kind, data, self.schemas, self.channels)
            elif kind == CHUNK_INDEX:
                self.chunks.append(self._indexed_chunk(data))
            elif kind == STATISTICS:
                statistics = data
        return statistics is not None and self._read_statistics(statistics)

    def _indexed_chunk(self, data: bytes) -> McapChunk:
        fields = RecordFields(data)
        start_ns, end_ns, position, length = (fields.number(8) for _ in range(4))
        offsets = sorted(offset for _, offset in fields.numbers(2, 8))
        index_length = fields.number(8)
        # A message index has 15 bytes and 16 for each message.
        ends = [*offsets[1:], position + length + index_length]
        sizes = (after - before for before, after in zip(offsets, ends, strict=False))
        count = sum(max(0, size - 15) // 16 for size in sizes)
        if position + length > self._size:
            raise McapError("a chunk lies behind the end of the file")
        return McapChunk(position, length, start_ns, end_ns, count if index_length else None)

    def _read_statistics(self, data: bytes) -> bool:
        """Take the counts; return whether they agree with schemas, channels and chunks."""
        fields = RecordFields(data)
        total = fields.number(8)
        schemas, channels = fields.number(2), fields.number(4)
        fields.take(8)
        chunks = fields.number(4)
        start_ns, end_ns = fields.number(8), fields.number(8)
        self.counts = Counter(dict(fields.numbers(2, 8)))  # type: ignore[arg-type]
        if total:
            self.start_ns, self.end_ns = start_ns, end_ns
        return (
            (schemas, channels, chunks)
            == (len(self.schemas), len(self.channels), len(self.chunks))
            and sum(self.counts.values()) == total
            and not set(+self.counts) - set(self.channels)
            and (chunks > 0 or total == 0)
            # Some writers leave the times of chunks out.
            and not any(chunk.messages and not chunk.end_ns for chunk in self.chunks)
        )

    # Without an index

    def _scan(self, data_start: int) -> None:
        """Read the whole file once, up to where it breaks."""
        self.schemas, self.channels, self.chunks = {}, {}, []
        self._definitions = McapDefinitions(self.schemas, self.channels)
        self.counts, self._scanned = Counter(), True
        self.start_ns = self.end_ns = 0
        position, complete, broken, files = data_start, False, "", 1
        indexed: Counter[int] = Counter()  # messages by the position of their chunk
        while position < self._size:
            try:
                kind, length = self._prefix(position)
                if kind in (DATA_END, FOOTER):
                    complete, position = True, self._behind_footer(position)
                    following = self._behind_header(position)
                    if following is None:
                        break
                    # Files may have been written one behind the other.
                    complete, position, files = False, following, files + 1
                    continue
                end = self._scan_record(position, kind, length, indexed)
                if kind == CHUNK and position in self._lost and not self._is_record(end):
                    # Its length is wrong, too, or it ends where another file begins.
                    following = self._next_chunk(position + 1)
                    if following is not None:
                        problem = self._lost[position].problem
                        broken = broken or f"at byte {position}: {problem}"
                        end = following
                position = end
            except McapError as error:
                following = self._next_chunk(position + 1)
                if following is None and isinstance(error, _CutOffError):
                    # A message outside of chunks that is cut off is the only loss.
                    self._lost[position] = _ChunkLoss(str(error), int(error.kind == MESSAGE))
                    break
                broken = broken or f"at byte {position}: {error}"
                if following is None:
                    break
                position = following
        self._count_losses_by_index(indexed)
        self._finish_scan(position, broken, files, complete=complete)

    def _prefix(self, position: int) -> tuple[int, int]:
        """Return kind and length (bytes) of the record at a position.

        Raises:
            McapError: there is no record, or its prefix is cut off.
        """
        if position + PREFIX_BYTES > self._size:
            raise _CutOffError(0)
        return prefix_of(self._read(position, PREFIX_BYTES))

    def _scan_record(self, position: int, kind: int, length: int, indexed: Counter[int]) -> int:
        """Take in a record of the data section; return where the next one should begin.

        Args:
            position: of the record (bytes).
            kind: of the record.
            length: of its content (bytes).
            indexed: messages by the position of their chunk, counted by the message indices.

        Raises:
            McapError: the record is damaged or cut off.
        """
        end = position + PREFIX_BYTES + length
        if kind == CHUNK:
            end = min(end, self._size)
            self._scan_chunk(McapChunk(position, end - position, 0, 2**63 - 1))
            return end
        if end > self._size:
            raise _CutOffError(kind)
        if kind == MESSAGE:
            return self._scan_run(position)
        if kind == MESSAGE_INDEX and self.chunks:
            # A channel and a list of 16 bytes for each of its messages.
            indexed[self.chunks[-1].position] += max(0, length - 6) // 16
        elif kind in DEFINITIONS:
            found = ChunkContent(b"")
            data = self._read(position + PREFIX_BYTES, length)
            note_definition(kind, data, found.schemas, found.channels)
            self._definitions.add(found)
        return end

    def _count_losses_by_index(self, indexed: Mapping[int, int]) -> None:
        """Replace estimated numbers of lost messages where a message index gives the number."""
        for position, loss in self._lost.items():
            if position in indexed:
                held = next(c.messages or 0 for c in self.chunks if c.position == position)
                loss.messages, loss.exact = max(0, indexed[position] - held), True

    def _is_record(self, position: int) -> bool:
        """Return whether a record begins at a position, as far as its kind and length tell."""
        if position + PREFIX_BYTES > self._size:
            return False
        try:
            _, length = prefix_of(self._read(position, PREFIX_BYTES))
        except McapError:
            return False
        return position + PREFIX_BYTES + length <= self._size

    def _behind_footer(self, position: int) -> int:
        """Return where a file ends whose data end at a position; beyond the size if it is cut."""
        while self._is_record(position):
            kind, length = prefix_of(self._read(position, PREFIX_BYTES))
            position += PREFIX_BYTES + length
            if kind == FOOTER:
                ended = self._read(position, len(MAGIC)) == MAGIC
                return position + len(MAGIC) if ended else self._size + 1
        return self._size + 1

    def _scan_chunk(self, chunk: McapChunk) -> None:
        """Add a chunk with its definitions and messages."""
        content, head = self._load(chunk)
        if head is None:
            # Nothing is lost if only the beginning of a chunk was written.
            whole = chunk.length >= PREFIX_BYTES + _HEAD_BYTES
            lost = self._estimated_messages(chunk.length, *self._mean) if whole else 0
            self._lost[chunk.position] = _ChunkLoss(content.problem, lost)
            chunk.messages = 0
            self.chunks.append(chunk)  # the message index that follows refers to it
            return
        chunk.start_ns, chunk.end_ns = head.start_ns, head.end_ns
        self._add(chunk, content)

    def _scan_run(self, position: int) -> int:
        """Add the messages from a position to the next chunk; return where they end."""
        data = self._read(position, _RUN_BYTES)
        length = prefix_of(data)[1] + PREFIX_BYTES
        if length > len(data):
            data = self._read(position, length)
        end = 0
        while end < len(data):
            try:
                kind, length = prefix_of(data, end)
            except McapError:
                break
            behind = kind in (CHUNK, DATA_END, FOOTER)
            if behind or end + PREFIX_BYTES + length > len(data):
                break
            end += PREFIX_BYTES + length
        content = read_content(data[:end])
        if content.problem or not content.messages:
            end = content.used
        if not end:
            raise McapError(content.problem or "a message is damaged")
        times = [message.time_ns for message in content.messages]
        self._add(McapChunk(position, end, min(times), max(times), plain=True), content)
        return position + end

    def _add(self, chunk: McapChunk, content: ChunkContent) -> None:
        chunk.numbers = self._definitions.add(content)
        content.messages = content.numbered(chunk.numbers)
        known = [m for m in content.messages if m.channel_id in self.channels]
        if not content.problem and len(known) < len(content.messages):
            content.problem = "the definition of a topic is lost"
            chunk.messages, content.messages = len(content.messages), known
        if content.problem:
            self._note_loss(chunk, content)
        chunk.messages = len(known)
        if known:
            first, last = min(m.time_ns for m in known), max(m.time_ns for m in known)
            chunk.start_ns = min(chunk.start_ns, first)
            chunk.end_ns = max(chunk.end_ns, last)
            self.start_ns = min(self.start_ns, first) if self.counts else first
            self.end_ns = max(self.end_ns, last)
            self.counts.update(m.channel_id for m in known)
        self.chunks.append(chunk)
        self._mean = (self._mean[0] + len(known), self._mean[1] + content.message_bytes)

    def _next_chunk(self, position: int) -> int | None:
        """Return where the next readable chunk begins, None if there is none."""
        while position < self._size:
            window = self._read(position, _WINDOW + _HEAD_BYTES)
            for match in _CHUNK_HEAD.finditer(window):
                place = position + match.start()
                length = prefix_of(window, match.start())[1]
                fields = RecordFields(self._read(place + PREFIX_BYTES, _HEAD_BYTES))
                try:
                    fields.take(28)
                    fields.text()
                    whole = fields.number(8) == length - fields.position
                except McapError:
                    continue
                chunk = McapChunk(place, length + PREFIX_BYTES, 0, 2**63 - 1)
                if whole and place + chunk.length <= self._size and self._load(chunk)[0].used:
                    return place
            position += _WINDOW
        return None

    def _finish_scan(self, position: int, broken: str, files: int, *, complete: bool) -> None:
        """Set the reason why the file as a whole is not intact, if there is one.

        Args:
            position: where the scan ended, beyond the file's size if the index is cut off.
            broken: where and why the file is damaged, empty if it is not.
            files: number of MCAP files that were written into it one behind the other.
            complete: the end of the data section was found.
        """
        if broken:
            self._break = f"is damaged {broken}"
        elif not complete and self._lost:
            self._break = "is cut off, as when power is lost"
        elif not complete:
            self._break = "has no end, as when its recorder is killed"
        elif position > self._size:
            self._break = "is cut off within its index"
        elif position < self._size:
            rest = self._size - position
            self._break = f"has {rest} bytes behind its end that are not part of it"
        elif files > 1:
            self._break = f"holds {files} MCAP files, one behind the other"
        if broken and not self._lost:
            self._lost[position] = _ChunkLoss(broken)

    # Chunks

    def _chunk_messages(
        self,
        chunk: McapChunk,
        wanted: frozenset[int],
        start_ns: int,
        stop_ns: int,
        read: Counter[int],
    ) -> Iterator[tuple[int, int, bytes]]:
        content, _ = self._load(chunk)
        if not self._scanned and not content.problem:
            self._refuse_missing(chunk, content)
        if content.problem and chunk.position not in self._lost:
            self._note_loss(chunk, content)
        data = content.data
        if not content.problem:
            self._mean = (len(content.messages), content.used)
        found = [
            message
            for message in content.numbered(chunk.numbers)
            if message.channel_id in wanted and start_ns <= message.time_ns < stop_ns
        ]
        read.update(message.channel_id for message in found)
        found.sort(key=lambda message: message.time_ns)
        for time_ns, channel_id, start, end in found:
            yield time_ns, channel_id, data[start:end]

    def _load(self, chunk: McapChunk) -> tuple[ChunkContent, McapChunk | None]:
        """Return the content of a chunk and the chunk as its header describes it.

        The header is None where even that is cut off.
        """
        if chunk.plain:
            return read_content(self._read(chunk.position, chunk.length)), chunk
        try:
            begin = self._read(chunk.position, PREFIX_BYTES + _HEAD_BYTES + _NAME_BYTES)
            kind, length = prefix_of(begin)
            fields = RecordFields(begin[PREFIX_BYTES:])
            start_ns, end_ns, size = (fields.number(8) for _ in range(3))
            checksum, compression, stored = fields.number(4), fields.text(), fields.number(8)
            if kind != CHUNK or fields.position + stored != length:
                raise McapError("a chunk is damaged")
            compressed = self._read(chunk.position + PREFIX_BYTES + fields.position, stored)
        except McapError as error:
            return ChunkContent(b"", problem=str(error)), None
        if not self._scanned:
            start_ns, end_ns = chunk.start_ns, chunk.end_ns
        head = McapChunk(chunk.position, chunk.length, start_ns, end_ns, chunk.messages)
        try:
            data = decompress(compression, compressed, size)
        except McapError as error:
            return ChunkContent(b"", problem=str(error), missing=min(size, LARGEST_CHUNK)), head
        whole = len(compressed) == stored
        verified = whole and checksum != 0
        if verified and (len(data) < size or zlib.crc32(data) != checksum):
            # The check sum does not tell which of its messages are wrong.
            problem = "the check sum of a chunk is wrong"
            return ChunkContent(b"", problem=problem, missing=min(size, LARGEST_CHUNK)), head
        # Without a check sum, times outside of those that the header states reveal damage.
        content = read_content(data) if verified else read_content(data, start_ns, end_ns)
        if not whole:
            content.problem = "a chunk is cut off"
        elif len(data) < size:
            content.problem = "a chunk is damaged"
        if content.problem:
            # The number of lost messages is estimated from the missing bytes.
            content.missing = size - content.used
        if not self._scanned:
            self._refuse_other_channels(content)
        return content, head

    def _refuse_missing(self, chunk: McapChunk, content: ChunkContent) -> None:
        """Set the problem of a readable chunk that does not match the index."""
        known = [m for m in content.messages if m.channel_id in self.channels]
        if len(known) < len(content.messages):
            content.problem = "the definition of a topic is lost"
            chunk.messages, content.messages = len(content.messages), known
        elif len(known) < (chunk.messages or 0):
            content.problem = "a chunk holds fewer messages than the index counts"

    def _refuse_other_channels(self, content: ChunkContent) -> None:
        """Leave out the messages of channels that the file's index defines differently."""
        for number, channel in content.channels.items():
            known = self.channels.get(number)
            if known is not None and not channel.is_same_as(known):
                content.messages = [m for m in content.messages if m.channel_id != number]
                content.problem = (
                    f"channel {number} is {channel.topic} in a chunk, {known.topic} in the index"
                )

    def _note_loss(self, chunk: McapChunk, content: ChunkContent) -> None:
        """Record how many messages of a chunk are lost, and why."""
        read = len(content.messages)
        last_ns = max((m.time_ns for m in content.messages), default=chunk.start_ns)
        if chunk.messages is not None:
            lost, exact = max(0, chunk.messages - read), True
        else:
            # Estimated by the mean size of a message so far.
            mean = (read, content.message_bytes) if read else self._mean
            lost, exact = self._estimated_messages(content.missing, *mean), False
        self._lost[chunk.position] = _ChunkLoss(
            content.problem, lost, last_ns, chunk.end_ns, exact
        )

    @staticmethod
    def _estimated_messages(missing: int, number: int, size: int) -> int:
        """Estimate the messages in missing bytes if ``number`` messages have ``size`` bytes."""
        return max(1, round(missing * number / max(1, size)))
