# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Files that belong together, found by their names in a directory and the folders below it."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path

from mtpgo_core.errors import RecordingError
from mtpgo_training.data.readers.drone_files import (
    NoRecordingsError,
    existing_directory,
    files_below,
)

GENERIC = {"data", "recorded_trackfiles", "trajectories_filtered", "train", "val", "test"}
"""Folders of the data sets' archives that say nothing of a recording."""


def grouped_files(
    directory: Path,
    pattern: re.Pattern[str],
    expected: str,
    accept: Callable[[Path], bool] = lambda path: True,
) -> dict[str, dict[str, Path]]:
    """Return the files of each recording, by its name and the kind of file.

    Args:
        directory: the directory, or a single file.
        pattern: matches the names of the files; its group ``kind`` is the kind, its group ``name``
            (either may be missing) and the folder are the name of the recording.
        expected: what the files are called, for the error.
        accept: whether a file that matches is one of them.

    Raises:
        RecordingError: no file matches, or two have the same name and kind.
    """
    if directory.is_file():
        paths, root = [directory], directory.parent
    else:
        existing_directory(directory)
        paths, root = files_below(directory), directory
    named: list[tuple[str, str, str, Path]] = []
    for path in paths:
        match = pattern.fullmatch(path.name)
        if match is None or not accept(path):
            continue
        groups = match.groupdict()
        folders = path.parent.relative_to(root).parts
        telling = [part for part in folders if part.lower() not in GENERIC]
        last = groups.get("name") or ""
        kind = (groups.get("kind") or "").lower()
        named.append(
            (kind, _joined([*telling, last], root), _joined([*folders, last], root), path)
        )
    # Where train and test have files of one name, their folders tell them apart.
    number = Counter((kind, short) for kind, short, _, _ in named)
    doubled = {short for (_, short), count in number.items() if count > 1}
    found: dict[str, dict[str, Path]] = {}
    for kind, short, long, path in named:
        name = long if short in doubled else short
        files = found.setdefault(name, {})
        if kind in files:
            raise RecordingError(
                f"{directory} has two recordings {name!r}, {files[kind]} and {path}, expected one"
            )
        files[kind] = path
    if not found:
        raise NoRecordingsError(f"{directory} has no recordings, expected {expected}")
    return dict(sorted(found.items()))


def _joined(parts: Sequence[str], root: Path) -> str:
    return "-".join(part for part in parts if part) or root.resolve().name
