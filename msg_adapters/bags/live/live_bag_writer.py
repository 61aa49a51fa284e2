# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Writing of a bag while it is recorded: what was written stays, whatever happens."""

from __future__ import annotations

import shutil
import tempfile
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rosbags.rosbag2 import Writer, WriterError

from msg_adapters.bags.bag_metadata import METADATA
from msg_adapters.bags.live.chunk_file import ChunkFile
from msg_adapters.bags.mcap_writer import McapWriter, is_single_file
from mtpgo_core.errors import RecordingError

FLUSH_PERIOD_S = 1.0
"""Longest time that messages are kept in memory (s); chosen: what a user who pulls the plug may
lose, at the price of chunks that are smaller than usual."""


class LiveBagWriter(McapWriter):
    """A bag that has its own name from the beginning and is never removed; a context manager.

    Its messages are written every second. When the disk is full or the process is killed, all that
    was written until then can be read (:class:`~msg_adapters.bags.stored_bag.StoredBag`). Leaving
    the ``with`` block, also with an error, writes the index.

    Args:
        path: the bag: a file if it ends in ``.mcap``, else a directory.

    Raises:
        RecordingError: ``path`` exists, or cannot be written.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._flushed = _Progress.of(self._writer, 0)
        self._flushed_s = time.monotonic()

    def _temporary_folder(self) -> Path:
        # The library only writes the file's header here; a killed process leaves nothing beside
        # the bag.
        return Path(tempfile.mkdtemp())

    def _opened(self) -> None:
        """Let the library go on writing at the path itself.

        Raises:
            OSError: the path cannot be written.
        """
        storage: Any = self._writer.storage
        storage.bio.close()
        header = storage.path.read_bytes()
        shutil.rmtree(self._folder)
        single = is_single_file(self.path)
        place = self.path if single else self.path / f"{self.path.name}.mcap"
        if not single:
            self.path.mkdir()
        try:
            self._file = _begun(place, header)
        except OSError:
            if not single:
                self.path.rmdir()
            raise
        storage.path, storage.bio = place, self._file
        self._writer.path = self.path
        metadata: Any = _NoFile() if single else self.path / METADATA
        self._writer.metapath = metadata

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None:
            self.close()
        else:
            self.discard()

    def write_bytes(self, topic: str, time_ns: int, data: bytes | memoryview) -> None:
        """Append a serialised message (CDR); see :meth:`write`."""
        super().write_bytes(topic, time_ns, data)
        if self._file.tell() > self._file.size:
            self.flush()  # a chunk is full

    def flush_if_due(self) -> None:
        """Write the messages if that was last done ``FLUSH_PERIOD_S`` ago; to be called often.

        A message then survives the end of the process after that time, and a loss of power after
        about twice that time.

        Raises:
            RecordingError: the disk is full.
        """
        if time.monotonic() - self._flushed_s >= FLUSH_PERIOD_S:
            self.flush()
            self._file.sync()

    def flush(self) -> None:
        """Write all messages that there are.

        Raises:
            RecordingError: the disk is full; the bag is then as it was after the last flush.
        """
        storage: Any = self._writer.storage
        self._flushed_s = time.monotonic()
        if storage.chunk.msgs:
            storage.close_chunk()
        try:
            self._file.flush()
        except OSError as error:
            self._flushed.restore(self._writer)
            self.messages = self._flushed.messages
            raise self._not_written(error) from error
        self._flushed = _Progress.of(self._writer, self.messages)

    @property
    def duration_s(self) -> float:
        """Time from the first to the last message written (s)."""
        if not self.messages:
            return 0.0
        return float(self._writer.max_timestamp - self._writer.min_timestamp) * 1e-9

    def close(self) -> None:
        """Write what is left, and the index.

        Raises:
            RecordingError: the disk is full; the bag then has the messages of the last flush, and
                an index if that fits.
        """
        if self._writer.storage is None:
            return
        problem: RecordingError | None = None
        try:
            self.flush()
        except RecordingError as error:
            problem = error
        try:
            self._writer.close()
        except (OSError, WriterError) as error:
            self._writer.storage = None
            if self.path.is_dir():
                # What the library leaves of an incomplete one.
                self._writer.metapath.with_suffix(".yaml.tmp").unlink(missing_ok=True)
            problem = problem or self._not_written(error)
        if problem is not None:
            raise problem

    def discard(self) -> None:
        """Close the bag after an error; nothing that was written is removed."""
        with suppress(RecordingError):
            self.close()


def _begun(path: Path, header: bytes) -> ChunkFile:
    """Return a new file that begins with a header.

    Raises:
        OSError: it exists or cannot be made; nothing is left of it then.
    """
    file = ChunkFile(path)
    try:
        file.write(header)
        file.flush()
    except OSError:
        with suppress(OSError):
            file.close()
        path.unlink()
        raise
    return file


@dataclass(frozen=True)
class _Progress:
    """What the library has counted when a chunk was written, to go back to if the next fails."""

    messages: int
    chunks: int
    stored: dict[str, Any]
    counts: dict[int, int]
    times_ns: tuple[int, int]

    @classmethod
    def of(cls, writer: Writer, messages: int) -> _Progress:
        storage: Any = writer.storage
        return cls(
            messages,
            len(storage.chunks),
            {
                "channel_stats": dict(storage.channel_stats),
                "message_start_time": storage.message_start_time,
                "message_end_time": storage.message_end_time,
            },
            dict(writer.counts),
            (writer.min_timestamp, writer.max_timestamp),
        )

    def restore(self, writer: Writer) -> None:
        storage: Any = writer.storage
        del storage.chunks[self.chunks :]
        # Topics that were added since have no message.
        channels = dict.fromkeys(storage.channel_stats, 0)
        for name, value in self.stored.items():
            setattr(storage, name, value)
        storage.channel_stats = {**channels, **self.stored["channel_stats"]}
        writer.counts = {**dict.fromkeys(writer.counts, 0), **self.counts}
        writer.min_timestamp, writer.max_timestamp = self.times_ns


class _NoFile:
    """Takes the place of the path of ``metadata.yaml`` where a bag is a single file."""

    def with_suffix(self, _: str) -> _NoFile:
        return self

    def write_text(self, text: str, _: str) -> int:
        return len(text)

    def replace(self, _: object) -> None:
        """Do nothing."""
