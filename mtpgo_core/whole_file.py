# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Atomic writing of files, and reading of regular files only."""

from __future__ import annotations

import errno
import os
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def whole_file(path: Path, mode: int) -> Iterator[Path]:
    """Yield a temporary path that replaces ``path`` if the block ends without an exception.

    A process that is killed leaves its temporary file, whose name begins with a dot. Where
    ``path`` is a symbolic link, the file that it leads to is replaced and the link stays.

    Args:
        path: the file; its folder exists.
        mode: its permissions.

    Raises:
        OSError: it cannot be written, or ``path`` is a folder, a pipe or a device.
    """
    path = Path(os.path.realpath(path))
    if os.path.exists(path):
        regular_size(path)  # a device is not to be replaced by a file
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        temporary.chmod(mode)
        _to_disk(temporary)
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def _to_disk(path: Path) -> None:
    """Bring a file to the disk: after a loss of power, a name must not lead to an empty file."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def user_path(text: str | Path) -> Path:
    """Return a path as a user means it: ``~`` is a home folder.

    Parameter files and ``-p name:=~/file`` do not pass through a shell. A home folder that is not
    known stays as it is written.
    """
    return Path(os.path.expanduser(text))


def regular_size(path: Path) -> int:
    """Return the size of a regular file (bytes).

    Opening a pipe waits for a writer, and a device may never end: neither is opened.

    Raises:
        OSError: there is no such file, or it is no regular one.
    """
    try:
        about = os.stat(path)
    except ValueError as error:  # a zero byte in the name
        raise OSError(errno.EINVAL, str(error)) from error
    if stat.S_ISDIR(about.st_mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    if not stat.S_ISREG(about.st_mode):
        raise OSError(errno.EINVAL, "it is a pipe or a device, no regular file")
    return about.st_size


def read_regular(path: Path, most_bytes: int) -> bytes:
    """Return the content of a regular file, cut off after ``most_bytes + 1`` bytes.

    Raises:
        OSError: it cannot be read, or is no regular file.
    """
    regular_size(path)
    with path.open("rb") as file:
        return file.read(most_bytes + 1)
