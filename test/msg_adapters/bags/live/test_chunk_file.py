# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A piece is in the file as a whole or not at all."""

import errno
import os

import pytest

from msg_adapters.bags.live.chunk_file import ChunkFile


def test_pieces_are_in_the_file_when_they_are_flushed(tmp_path):
    path = tmp_path / "a"
    file = ChunkFile(path)
    file.write(b"one")
    assert (path.read_bytes(), file.tell(), file.size) == (b"", 3, 0)
    file.flush()
    file.write(memoryview(b"two"))
    assert (path.read_bytes(), file.tell(), file.size) == (b"one", 6, 3)
    file.sync()
    file.sync()
    file.close()
    assert path.read_bytes() == b"onetwo"
    with pytest.raises(FileExistsError):
        ChunkFile(path)


def test_a_piece_that_does_not_fit_is_taken_back(tmp_path, monkeypatch):
    path = tmp_path / "a"
    file = ChunkFile(path)
    file.write(b"one")
    file.flush()
    write = os.write
    room = [4]

    def full(descriptor, data):
        if not room[0]:
            raise OSError(errno.ENOSPC, "No space left on device")
        written = write(descriptor, data[: room[0]])
        room[0] -= written
        return written

    monkeypatch.setattr(os, "write", full)
    file.write(b"twotwo")
    with pytest.raises(OSError, match="No space"):
        file.flush()
    assert (path.read_bytes(), file.tell()) == (b"one", 3)
    monkeypatch.undo()
    file.write(b"three")
    file.close()
    assert path.read_bytes() == b"onethree"
