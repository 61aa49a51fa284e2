# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What is costly to read or to compute from a recording, kept on disk in columns.

An entry is a folder of ``.npy`` files, one a column, and ``entry.json``, which names them with
their check sums. The files are mapped into memory, so only what is looked at is read and the
memory of a training does not grow with its recordings; numpy needs no help for either. The name of
an entry is a hash over everything that determines its content: the SHA-256 of the recording's
files, the settings, and the code that computes it. So nothing has to be thrown away by hand when
one of them changes, and the whole cache may be deleted at any time.

An entry is written aside and renamed; of several processes that want the same one, one writes it
and the others wait. A damaged entry is made anew.
"""

from __future__ import annotations

import contextlib
import fcntl
import functools
import hashlib
import json
import logging
import os
import shutil
import tempfile
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import msg_adapters
import mtpgo_core
import mtpgo_training
from mtpgo_training.data.readers.reading_unit import Unit
from mtpgo_training.data.recording import Columns, Recording
from mtpgo_training.data.recording_columns import pack, unpack

FORMAT = 1
"""Raised when entries are laid out in another way."""

_INDEX = "entry.json"
_LOCKS = 16
_log = logging.getLogger("mtpgo")


class DamagedEntryError(Exception):
    """An entry that is not what was written."""


class RecordingCache:
    """Entries below one folder.

    Args:
        folder: where they lie; made when something is written.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def recordings(self, unit: Unit) -> list[Recording]:
        """The recordings of a unit of files, read from the files only the first time.

        Raises:
            RecordingError: a defect of the files; nothing is kept then.
        """
        facts = {
            "what": "recordings",
            "layout": unit.layout,
            "name": unit.name,
            "sha256": unit.sha256,
        }
        return unpack(self.entry(facts, lambda: pack(unit.read())))

    def columns(
        self, recording: Recording, purpose: str, settings: object, make: Callable[[], Columns]
    ) -> Columns:
        """Columns computed from a recording, or as they were computed before.

        Args:
            recording: what they are computed from; one without ``sha256`` is not cached.
            purpose: what they are.
            settings: everything else that determines them, as JSON can write it.
            make: computes them.
        """
        if not recording.sha256:
            return make()
        facts = {
            "what": purpose,
            "settings": settings,
            "name": recording.name,
            "sha256": recording.sha256,
            # A part of a recording has the hash of the whole.
            "rows": _checksum(recording.frame, recording.track, recording.position),
        }
        return self.entry(facts, make)

    def entry(self, facts: dict[str, Any], make: Callable[[], Columns]) -> Columns:
        """The columns of the entry that ``facts`` determine, made if it is not there.

        Where the folder cannot be written, they are made and not kept, with a warning.
        """
        facts = {"format": FORMAT, "code": code_sha256(), **facts}
        text = json.dumps(facts, sort_keys=True)
        key = hashlib.sha256(text.encode()).hexdigest()[:32]
        path = self.folder / key
        found = _read_or_none(path)
        if found is not None:
            return found
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            with _locked(self.folder / f".lock-{int(key[:8], 16) % _LOCKS:02d}"):
                # Another process may have written it in the meantime.
                found = _read_or_none(path, warn=True)
                if found is None:
                    self._write(path, facts, make())
                return _read(path) if found is None else found
        except OSError as error:
            _log.warning("mtpgo: the cache %s cannot be used: %s", self.folder, error.strerror)
            return make()

    def _write(self, path: Path, facts: dict[str, Any], columns: Columns) -> None:
        aside = Path(tempfile.mkdtemp(prefix=".new-", dir=self.folder))
        try:
            sums = {}
            for name, column in columns.items():
                np.save(aside / f"{name}.npy", column, allow_pickle=False)
                sums[name] = _checksum(column)
            (aside / _INDEX).write_text(json.dumps({**facts, "columns": sums}, indent=1))
            shutil.rmtree(path, ignore_errors=True)  # only a damaged one can stand there
            aside.rename(path)
        finally:
            shutil.rmtree(aside, ignore_errors=True)


def _read_or_none(path: Path, *, warn: bool = False) -> Columns | None:
    """The columns of an entry; None where there is none or it is damaged."""
    if not path.is_dir():
        return None
    try:
        return _read(path)
    except (DamagedEntryError, OSError, ValueError, KeyError, TypeError) as error:
        if warn:
            _log.warning("mtpgo: the cache entry %s is damaged and made anew (%s)", path, error)
        return None


def _read(path: Path) -> Columns:
    sums = json.loads((path / _INDEX).read_text())["columns"]
    columns: Columns = {}
    for name, expected in sums.items():
        file = path / f"{name}.npy"
        column = np.load(file, mmap_mode="r", allow_pickle=False)
        # A plain array on the mapped memory: memmap's own methods cost time at every look-up.
        columns[name] = np.asarray(column).view(np.ndarray)
        if _checksum(columns[name]) != expected:
            raise DamagedEntryError(f"{file.name} has another check sum")
    return columns


def _checksum(*columns: NDArray[Any]) -> int:
    """CRC-32 over the contents, in that order."""
    value = 0
    for column in columns:
        flat = np.ascontiguousarray(column).reshape(-1)
        value = zlib.crc32(flat.view(np.uint8).data, value)
    return value


@contextlib.contextmanager
def _locked(path: Path) -> Iterator[None]:
    """Alone among the processes that lock ``path``."""
    with path.open("a") as file:
        # A file system without locks: two processes may then do the same work, and both are right.
        with contextlib.suppress(OSError):
            fcntl.flock(file, fcntl.LOCK_EX)
        yield


@functools.cache
def code_sha256() -> str:
    """Hash over the modules that read recordings and compute columns from them."""
    digest = hashlib.sha256()
    training = Path(mtpgo_training.__file__).parent
    folders = (
        Path(mtpgo_core.__file__).parent,
        Path(msg_adapters.__file__).parent,
        training / "data",
        training / "scenes",
    )
    for path in sorted(path for folder in folders for path in folder.rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def default_folder() -> Path:
    """``$XDG_CACHE_HOME/mtpgo``, by default ``~/.cache/mtpgo``."""
    base = os.environ.get("XDG_CACHE_HOME", "")
    return (Path(base) if os.path.isabs(base) else Path.home() / ".cache") / "mtpgo"
