# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A file that grows by whole pieces: what was flushed stays, whatever happens afterwards."""

from __future__ import annotations

import os
import threading
from contextlib import suppress
from pathlib import Path


class ChunkFile:
    """A new file, written piece by piece.

    A piece is everything between two calls of :meth:`flush`. If it does not fit on the disk, it is
    taken back as a whole, so the file always ends where a piece ends (unless the process is killed
    while the system is writing).

    Args:
        path: the file; it must not exist.

    Attributes:
        size: bytes of the pieces in the file.

    Raises:
        OSError: it exists or cannot be made.
    """

    def __init__(self, path: Path) -> None:
        self._descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
        self._piece = bytearray()
        self._syncing: threading.Thread | None = None
        self.size = 0

    def write(self, data: bytes | memoryview) -> int:
        """Add to the present piece; nothing is written yet."""
        self._piece += data
        return len(data)

    def tell(self) -> int:
        """Return the size with the present piece (bytes)."""
        return self.size + len(self._piece)

    def flush(self) -> None:
        """Write the present piece; it survives the end of this process from now on.

        Raises:
            OSError: it does not fit; then nothing of it is in the file.
        """
        piece, self._piece = memoryview(bytes(self._piece)), bytearray()
        written = 0
        try:
            while written < len(piece):
                written += os.write(self._descriptor, piece[written:])
        except OSError:
            with suppress(OSError):
                os.ftruncate(self._descriptor, self.size)
                os.lseek(self._descriptor, self.size, os.SEEK_SET)
            raise
        self.size += written

    def sync(self) -> None:
        """Begin to bring the pieces to the disk, where they survive a loss of power.

        A thread does it, since a busy disk may take seconds; there is never more than one.
        """
        if self._syncing is None or not self._syncing.is_alive():
            copy = os.dup(self._descriptor)
            self._syncing = threading.Thread(target=_sync, args=(copy,), daemon=True)
            self._syncing.start()

    def close(self) -> None:
        """Write the present piece, bring the file to the disk and close it.

        Raises:
            OSError: the piece does not fit; the file is closed without it.
        """
        try:
            self.flush()
            os.fsync(self._descriptor)
        finally:
            os.close(self._descriptor)


def _sync(descriptor: int) -> None:
    # A disk that fails is reported by the next piece, or when the file is closed.
    with suppress(OSError):
        os.fdatasync(descriptor)
    os.close(descriptor)
