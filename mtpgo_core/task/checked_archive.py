# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Untrusted zip archives, with limits that are checked before anything is unpacked.

Model files, checkpoints and files of samples are zip archives. A malicious archive of some
megabytes can unpack to gigabytes. Here the size of the file, the number of records and their
unpacked sizes are compared with limits first, then every record is compared with its checksum. The
libraries that read an archive afterwards get exactly the bytes that were checked.
"""

from __future__ import annotations

import hashlib
import io
import stat
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from mtpgo_core.errors import MtpgoError

_MB = 1 << 20


@dataclass(frozen=True)
class ArchiveLimits:
    """Largest archive that is read.

    Attributes:
        file_mb: size of the file (MB).
        unpacked_mb: size of all records (MB).
        deflated_mb: size of the records that are compressed, unpacked (MB).
        records: number of records.
    """

    file_mb: int = 256
    unpacked_mb: int = 256
    deflated_mb: int = 64
    records: int = 20_000


LIMITS = ArchiveLimits()
"""Chosen: the largest model that was ever exported has 2 MB and 80 records, of which 0.5 MB are
compressed, and the checkpoint of its training 6 MB."""


@dataclass(frozen=True)
class CheckedArchive:
    """An archive within the limits, every record of which has its checksum.

    Attributes:
        path: its file, for error messages.
        data: the whole file.
        names: names of the records, without the folder that all have in common.
    """

    path: Path
    data: bytes
    names: dict[str, str]

    @cached_property
    def sha256(self) -> str:
        """SHA-256 of the file, as ``sha256sum`` prints it."""
        return hashlib.sha256(self.data).hexdigest()

    def record(self, name: str) -> bytes:
        """Return the content of a record.

        Raises:
            KeyError: there is none of this name.
        """
        with zipfile.ZipFile(io.BytesIO(self.data)) as archive:
            return archive.read(self.names[name])

    def records(self) -> dict[str, bytes]:
        """Return the content of all records, by name."""
        with zipfile.ZipFile(io.BytesIO(self.data)) as archive:
            return {name: archive.read(full) for name, full in self.names.items()}


def read_archive(
    path: Path,
    refuse: Callable[[str], MtpgoError],
    expected: str,
    limits: ArchiveLimits = LIMITS,
) -> CheckedArchive:
    """Read a zip archive whose records are in one folder.

    Args:
        path: the file.
        refuse: makes the error of what is wrong with the file, given without its name.
        expected: what kind of file it should be, for instance ``TorchScript``.
        limits: largest archive that is read.

    Raises:
        MtpgoError: made by ``refuse``: the file is missing, unreadable, no regular file, damaged,
            or beyond the limits.
    """
    data = _content(path, refuse, expected, limits.file_mb)
    return check_archive(path, data, refuse, expected, limits)


def check_archive(
    path: Path,
    data: bytes,
    refuse: Callable[[str], MtpgoError],
    expected: str,
    limits: ArchiveLimits = LIMITS,
) -> CheckedArchive:
    """Check the content of a file as :func:`read_archive` does."""
    try:
        names = _checked_names(data, limits)
    except _RefusedError as error:
        raise refuse(str(error)) from error
    except Exception as error:  # zipfile and zlib raise whatever they like on damaged bytes
        reason = " ".join(str(error).split())[:120] or type(error).__name__
        raise refuse(f"is truncated or no {expected} file: {reason}") from error
    return CheckedArchive(path, data, names)


class _RefusedError(Exception):
    """An archive is damaged or exceeds a limit; the text is the end of a sentence."""


def _content(
    path: Path, refuse: Callable[[str], MtpgoError], expected: str, largest_mb: int
) -> bytes:
    """Return the bytes of a regular file of limited size."""
    try:
        about = path.stat()
        if stat.S_ISDIR(about.st_mode):
            raise refuse(f"is a directory, expected a {expected} file")
        if not stat.S_ISREG(about.st_mode):  # reading a pipe or a device may never end
            raise refuse(f"is no regular file, expected a {expected} file")
        if about.st_size > largest_mb << 20:
            raise refuse(
                f"has {about.st_size / _MB:.0f} MB, expected a {expected} file of at most"
                f" {largest_mb} MB"
            )
        with path.open("rb") as file:
            return file.read(about.st_size)
    except FileNotFoundError as error:
        raise refuse("does not exist") from error
    except (OSError, ValueError) as error:  # ValueError: a zero byte in the name
        raise refuse(f"cannot be read: {getattr(error, 'strerror', None) or error}") from error


def _checked_names(data: bytes, limits: ArchiveLimits) -> dict[str, str]:
    """Return the full name of each record by its name without the common folder.

    Raises:
        _RefusedError: a limit is exceeded, or two readers could read it differently.
        Exception: the archive is damaged.
    """
    # Counted before the directory is read, of which zipfile makes some 500 bytes an entry.
    entries = data.count(b"PK\x01\x02")
    if entries > limits.records:
        raise _RefusedError(f"has {entries} records, expected at most {limits.records}")
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        infos = archive.infolist()
        _check_sizes(infos, len(data), limits)
        names: dict[str, str] = {}
        folders = {info.filename.partition("/")[0] for info in infos}
        if len(folders) > 1:
            raise _RefusedError("has records in several folders, expected one folder for all")
        for info in infos:
            name = info.filename.partition("/")[2]
            names[name] = info.filename
        # torch takes the first of several records and ignores case, zipfile takes the last.
        if len({name.casefold() for name in names}) < len(infos):
            raise _RefusedError("has two records of the same name, expected each once")
        for info in infos:
            with archive.open(info) as record:
                while record.read(_MB):  # compares the checksum at the end
                    pass
    return names


def _check_sizes(infos: list[zipfile.ZipInfo], size: int, limits: ArchiveLimits) -> None:
    """Compare what the directory of an archive says with the limits."""
    unpacked = sum(info.file_size for info in infos)
    deflated = sum(i.file_size for i in infos if i.compress_type != zipfile.ZIP_STORED)
    for what, given, largest_mb in (
        ("unpacks to", unpacked, limits.unpacked_mb),
        ("has compressed records that unpack to", deflated, limits.deflated_mb),
    ):
        if given > largest_mb << 20:
            raise _RefusedError(f"{what} {given / _MB:.0f} MB, expected at most {largest_mb} MB")
    if sum(info.compress_size for info in infos) > size:
        raise _RefusedError("has records that overlap, expected each in its own place")
    for info in infos:
        if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise _RefusedError(
                f"has a record of compression method {info.compress_type}, expected stored or"
                " deflated"
            )
        if info.flag_bits & 1:
            raise _RefusedError("is encrypted, expected an archive without a password")
