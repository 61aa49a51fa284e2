# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Files in a directory of recordings that are skipped: files of another kind, and archives."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from pathlib import Path

from mtpgo_core.errors import RecordingError, found_names
from mtpgo_training.data.readers.drone_files import visible_files
from mtpgo_training.data.readers.reading_unit import Unit

_PACKED = (".zip", ".7z", ".rar", ".tar", ".tgz", ".gz", ".bz2", ".xz")
"""Endings of archives and compressed files, in small letters."""

_MOST_NAMES = 3
"""Archives that a sentence lists; chosen."""


def without_foreign(units: Sequence[Unit], is_one: Callable[[Path], bool]) -> list[Unit]:
    """Return the files of the wanted kind; a remark on the first file names the others.

    If no file is of that kind, all are returned, so that reading them reports the problem. Files
    that cannot be opened are returned for the same reason.

    Args:
        units: the files of a directory, one in each.
        is_one: whether a file is of the kind asked for, or a RecordingError.
    """
    if len(units) < 2:
        return list(units)
    kept, remarks = [], []
    for unit in units:
        if _may_be(unit.files[0], is_one):
            kept.append(unit)
        else:
            remarks.append(
                f"{unit.files[0]} is passed over: it has none of the columns of the other files"
            )
    if not kept:
        return list(units)
    return [dataclasses.replace(kept[0], remarks=remarks), *kept[1:]]


def with_packed_named(units: Sequence[Unit], directory: Path) -> list[Unit]:
    """Return the files of a directory; a remark on the first names archives that are not read.

    An archive is skipped without a remark if its unpacked content seems to be beside it.

    Args:
        units: the files that are read.
        directory: where they are.
    """
    if not units or not directory.is_dir():
        return list(units)
    names = [path.name for path in visible_files(directory.iterdir(), directory)]
    read = {file.name for unit in units for file in unit.files}
    unpacked = {_stem(name) for name in names if not _is_packed(name)}
    packed = [
        name
        for name in names
        if _is_packed(name) and name not in read and _stem(name) not in unpacked
    ]
    if not packed:
        return list(units)
    sentence = (
        f"{directory}: what is packed is passed over, expected it unpacked:"
        f" {found_names(packed, _MOST_NAMES)}"
    )
    return [dataclasses.replace(units[0], remarks=[*units[0].remarks, sentence]), *units[1:]]


def _is_packed(name: str) -> bool:
    return name.lower().endswith(_PACKED)


def _stem(name: str) -> str:
    """Return the name of an archive, or of its content, without suffixes."""
    return name.partition(".")[0]


def _may_be(path: Path, is_one: Callable[[Path], bool]) -> bool:
    try:
        return is_one(path)
    except RecordingError:
        return True
