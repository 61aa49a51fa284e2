# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Cache of columns that are costly to read or to compute from a recording.

An entry is a folder of ``.npy`` files, one for each column, and ``entry.json``, which lists them
with their check sums. The files are mapped into memory, so only the rows in use are read and the
memory of a training does not grow with its recordings. The name of an entry is a hash over
everything that determines its content: the SHA-256 of the recording's files, the settings, and the
code that computes it (:mod:`mtpgo_training.data.code_hash`). So no entry has to be deleted by hand
when one of them changes, and the whole cache may be deleted at any time.

An entry is written under a temporary name and renamed; of several processes that need the same
one, one computes it and the others wait. A damaged entry is computed again.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import logging
import shutil
import tempfile
import zlib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from platformdirs import user_cache_path

from mtpgo_training.data.code_hash import code_sha256
from mtpgo_training.data.recording import Columns, Recording

FORMAT = 1
"""Number of the layout of an entry on disk; to be raised when that changes."""

_INDEX = "entry.json"

_ROWS = ("frame", "track", "position", "velocity", "acceleration", "yaw", "key")
"""What of a recording's rows and tracks columns are computed from."""

_LOCKS = 16
"""Lock files that all entries share; chosen: few files, and few processes that wait for others."""

_log = logging.getLogger("mtpgo")


class DamagedEntryError(Exception):
    """An entry differs from what was written."""


class RecordingCache:
    """The cache entries in one folder.

    Args:
        folder: the folder; made when an entry is written.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def columns(
        self,
        recording: Recording,
        purpose: str,
        settings: object,
        make: Callable[[], Columns],
        *code: Callable[..., Any],
    ) -> Columns:
        """Return columns computed from a recording, from the cache if they are there.

        Args:
            recording: what they are computed from; one without ``sha256`` is not cached.
            purpose: name of the columns.
            settings: everything else that determines them, as JSON can write it.
            make: computes them; its code is part of the entry's name.
            code: other functions that determine them.
        """
        if not recording.sha256:
            return make()
        facts = {
            "what": purpose,
            "settings": settings,
            "name": recording.name,
            "sha256": recording.sha256,
            # A part of a recording has the hash of the whole, and the same files may be read with
            # other columns, units or topics.
            "rows": _checksum(*(getattr(recording, column) for column in _ROWS)),
            "times": [float(recording.frame_rate), int(recording.start_time_ns)],
        }
        return self.entry(facts, make, code=(make, *code))

    def entry(
        self,
        facts: dict[str, Any],
        make: Callable[[], Columns],
        *,
        code: Sequence[Callable[..., Any]],
    ) -> Columns:
        """Return the columns of an entry, computed if it is not there.

        Where the folder cannot be written, they are computed and not kept, with a warning.

        Args:
            facts: what determines the columns besides the code, as JSON can write it.
            make: computes them.
            code: the functions that compute them.
        """
        facts = {"format": FORMAT, "code": code_sha256(*code), **facts}
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
        new = Path(tempfile.mkdtemp(prefix=".new-", dir=self.folder))
        try:
            sums = {}
            for name, column in columns.items():
                np.save(new / f"{name}.npy", column, allow_pickle=False)
                sums[name] = _checksum(column)
            (new / _INDEX).write_text(json.dumps({**facts, "columns": sums}, indent=1))
            shutil.rmtree(path, ignore_errors=True)  # only a damaged one can be there
            new.rename(path)
        finally:
            shutil.rmtree(new, ignore_errors=True)


def _read_or_none(path: Path, *, warn: bool = False) -> Columns | None:
    """Return the columns of an entry, None if it is not there or damaged."""
    if not path.is_dir():
        return None
    try:
        return _read(path)
    except Exception as error:  # numpy and json raise many things on damaged bytes
        if warn:
            _log.warning(
                "mtpgo: the cache entry %s is damaged and computed again (%s)", path, error
            )
        return None


def _read(path: Path) -> Columns:
    sums = json.loads((path / _INDEX).read_text())["columns"]
    columns: Columns = {}
    if {file.stem for file in path.glob("*.npy")} != set(sums):
        raise DamagedEntryError(f"{_INDEX} does not name the columns that are there")
    for name, expected in sums.items():
        file = path / f"{name}.npy"
        column = np.load(file, mmap_mode="r", allow_pickle=False)
        # A plain array on the mapped memory: memmap's own methods cost time at every look-up.
        columns[name] = np.asarray(column).view(np.ndarray)
        if _checksum(columns[name]) != expected:
            raise DamagedEntryError(f"{file.name} has another check sum")
    return columns


def _checksum(*columns: NDArray[Any]) -> int:
    """Return the CRC-32 over the contents, in that order."""
    value = 0
    for column in columns:
        flat = np.ascontiguousarray(column).reshape(-1)
        value = zlib.crc32(flat.view(np.uint8).data, value)
    return value


@contextlib.contextmanager
def _locked(path: Path) -> Iterator[None]:
    """Hold a lock file that only one process has at a time."""
    # Imported late: it is slow to import, and only a command that reads recordings locks.
    from filelock import FileLock

    with contextlib.ExitStack() as held:
        # A file system without locks: two processes may then compute the same entry.
        with contextlib.suppress(OSError, NotImplementedError):
            held.enter_context(FileLock(path))
        yield


def default_folder() -> Path:
    """Return the user's cache folder for this project: ``~/.cache/mtpgo`` on Linux.

    ``$XDG_CACHE_HOME`` takes the place of ``~/.cache``.
    """
    return user_cache_path("mtpgo", appauthor=False)
