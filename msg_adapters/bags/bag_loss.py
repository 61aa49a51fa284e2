# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What of a damaged bag is read, what is lost and why, in words."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from rosbags.interfaces import Connection

from mtpgo_core.errors import reason_of


def counted(messages: int) -> str:
    """Return a number of messages in words."""
    return f"{messages} message{'' if messages == 1 else 's'}"


@dataclass(frozen=True)
class BagLoss:
    """Loss in one file of a bag.

    Attributes:
        file: the file.
        reason: what is wrong with it, after its name: ``is cut off at byte 1234``.
        read: messages that are read.
        read_s: from the first to the last of them (s).
        messages: messages that are lost; None if unknown.
        seconds: duration that is lost (s); None if unknown.
        exact: ``messages`` is counted, not estimated from the size of what is missing.
    """

    file: Path
    reason: str
    read: int
    read_s: float
    messages: int | None = None
    seconds: float | None = None
    exact: bool = False

    def sentence(self) -> str:
        """Return the loss as a sentence."""
        read = f"{counted(self.read)} ({self.read_s:.1f} s) read"
        if not self.read:
            read = "nothing of it is read"
        return f"{self.file} {self.reason}: {read}, {self._lost()}"

    def _lost(self) -> str:
        if self.messages is None and self.seconds is None:
            return "how much is lost is not known"
        if self.messages is None:
            return f"up to {self.seconds:.1f} s lost, of how many messages is not known"
        number = f"{'' if self.exact else 'about '}{counted(self.messages)}"
        if self.messages == 0:
            return "no message of what was written is lost"
        if self.seconds is None:
            return f"{number} lost"
        return f"{number} ({self.seconds:.1f} s) lost"


class LibraryReader(Protocol):
    """An open reader of rosbags."""

    @property
    def connections(self) -> list[Connection]:
        """Its topics."""

    def messages(
        self,
        connections: Collection[Connection],
        start: int | None = None,
        stop: int | None = None,
    ) -> Iterator[tuple[Connection, int, bytes]]:
        """Yield topic, log time (ns) and bytes of messages."""

    def close(self) -> None:
        """Close the file."""


class LibraryFile:
    """A file that rosbags reads, up to where it breaks.

    Args:
        path: the file.
        reader: of it, open.
        start_ns: log time of the first message (ns).
        end_ns: log time of the last message (ns).
    """

    def __init__(self, path: Path, reader: LibraryReader, start_ns: int, end_ns: int) -> None:
        self._path, self._reader = path, reader
        self.start_ns, self.end_ns = start_ns, end_ns
        self._loss: BagLoss | None = None

    def messages(
        self, numbers: Collection[int], start_ns: int | None, stop_ns: int | None
    ) -> Iterator[tuple[int, int, bytes]]:
        """Yield log time (ns), number of the topic and bytes of messages, ascending in time."""
        wanted = [c for c in self._reader.connections if c.id in numbers]
        read, last_ns, broken = 0, self.start_ns, 0
        try:
            for connection, time_ns, data in self._reader.messages(wanted, start_ns, stop_ns):
                # Cells of an SQLite database have any type, whatever its columns are called.
                if not isinstance(time_ns, int) or not isinstance(data, bytes | memoryview):
                    broken += 1
                    continue
                yield time_ns, connection.id, data
                read, last_ns = read + 1, time_ns
        except Exception as error:  # a damaged file fails the library in many ways
            count = sum(c.msgcount for c in wanted)
            self._loss = BagLoss(
                self._path,
                f"is damaged ({reason_of(error)})",
                read,
                (last_ns - self.start_ns) * 1e-9,
                max(0, count - read),
                (self.end_ns - last_ns) * 1e-9,
                exact=start_ns is None and stop_ns is None,
            )
            return
        if broken:
            reason = "has messages without a time or without content"
            seconds = (last_ns - self.start_ns) * 1e-9
            self._loss = BagLoss(self._path, reason, read, seconds, broken, exact=True)

    def loss(self) -> BagLoss | None:
        """Return what is lost as far as it is known by now, None if nothing is."""
        return self._loss

    def close(self) -> None:
        """Close the file."""
        self._reader.close()
