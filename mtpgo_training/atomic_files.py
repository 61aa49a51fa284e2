# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Atomic writing of files and folders, whose errors are sentences for the user."""

from __future__ import annotations

import errno
import fcntl
import json
import os
import shutil
import tempfile
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from mtpgo_core.errors import ConfigurationError, reason_of
from mtpgo_core.whole_file import whole_file


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a temporary path that replaces ``path`` if the block ends without an exception.

    Raises:
        ConfigurationError: the directory cannot be created, or the file not be written, as on a
            full disk.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(path, 0o666 & ~_umask()) as temporary:
            yield temporary
    except OSError as error:
        raise ConfigurationError(f"{path} cannot be written: {reason_of(error)}") from error


@contextmanager
def new_folder(path: Path) -> Iterator[Path]:
    """Yield a temporary folder that becomes ``path`` if the block ends without an exception.

    An empty folder that is there stays, and its files come into it: it may be the working
    directory, or a mounted one.

    Raises:
        ConfigurationError: it cannot be made, or ``path`` exists and is not an empty folder.
    """
    path = Path(os.path.realpath(path))  # a link to an empty folder stays one
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        place = path if path.is_dir() else path.parent
        temporary = Path(tempfile.mkdtemp(prefix=f".{path.name}.", dir=place))
    except OSError as error:
        raise ConfigurationError(f"{path} cannot be written: {reason_of(error)}") from error
    try:
        yield temporary
        if place == path:
            _fill(path, temporary)
        else:
            temporary.chmod(0o777 & ~_umask())
            os.rename(temporary, path)
    except OSError as error:
        raise ConfigurationError(f"{path} cannot be written: {reason_of(error)}") from error
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def _fill(path: Path, temporary: Path) -> None:
    """Move the files of a temporary folder within a folder into that, if it has no others.

    Raises:
        OSError: it has, or they cannot be moved.
    """
    if any(entry != temporary for entry in path.iterdir()):
        raise OSError(errno.ENOTEMPTY, os.strerror(errno.ENOTEMPTY))
    for entry in sorted(temporary.iterdir()):
        os.rename(entry, path / entry.name)


def is_new(path: Path) -> bool:
    """Return whether there is nothing at a path, or an empty folder."""
    return not path.exists() or (path.is_dir() and not any(path.iterdir()))


def require_suffix(option: str, path: Path, suffixes: Sequence[str]) -> None:
    """Check that an output is named as what is written into it.

    Args:
        option: names it on the command line.
        path: the output.
        suffixes: those that are allowed, in lower case.

    Raises:
        ConfigurationError: it has another suffix.
    """
    if path.suffix.lower() not in suffixes:
        raise ConfigurationError(
            f"{option} is {path}, expected a file that ends in {' or '.join(suffixes)}"
        )


def require_writable(path: Path) -> None:
    """Check that a file can be written, before long work rather than after it.

    Raises:
        ConfigurationError: it cannot.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path.parent):
            pass
    except OSError as error:
        raise ConfigurationError(f"{path} cannot be written: {reason_of(error)}") from error
    if path.is_dir():
        raise ConfigurationError(f"{path} is a directory, expected a file to write")


def write_text(path: Path, text: str) -> None:
    """Write a text to a file, atomically.

    Raises:
        ConfigurationError: the file cannot be written.
    """
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


@contextmanager
def only_writer(folder: Path) -> Iterator[None]:
    """Hold an existing folder that one process at a time may write to.

    The lock leaves no file behind and ends with the process, whatever ends it. On a file system
    without locks nothing is held.

    Raises:
        ConfigurationError: another process holds the folder.
    """
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise ConfigurationError(
                f"{folder} is being written by another process, expected one at a time"
            ) from None
        except OSError:  # no locks here, as on some network drives
            pass
        yield
    finally:
        os.close(descriptor)


def read_json(
    path: Path, kind: str, keys: Collection[str] = (), *, otherwise: str = "is damaged"
) -> dict[str, Any]:
    """Return the object in a JSON file that this package wrote.

    Args:
        path: the file.
        kind: what it holds, for the error.
        keys: what the object has at least.
        otherwise: what the error says of a file with another content; one that the user names may
            be any.

    Raises:
        ConfigurationError: it cannot be read or holds something else.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigurationError(f"{path} cannot be read: {reason_of(error)}") from error
    except (ValueError, RecursionError) as error:
        raise ConfigurationError(f"{path} {otherwise}, expected {kind}: {error}") from error
    lacking = [key for key in keys if not isinstance(content, dict) or key not in content]
    if lacking or not isinstance(content, dict):
        what = f"has no {lacking[0]!r}" if lacking else "holds no object"
        raise ConfigurationError(f"{path} {otherwise}, expected {kind}: it {what}")
    return content
