# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Files of another kind beside those of a data set whose names do not tell them apart."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from mtpgo_core.errors import RecordingError
from mtpgo_training.data.readers.checks.reading_remarks import remark


def without_foreign(
    by_name: Mapping[str, Path], is_one: Callable[[Path], bool]
) -> dict[str, Path]:
    """Return the files without those of another kind, which are named in a remark.

    Where none is of the kind asked for, all are returned: what is wrong with them is said where
    they are read. So it is of files that cannot be read.

    Args:
        by_name: files by the names of their recordings.
        is_one: whether a file is of the kind asked for, or a RecordingError.
    """
    if len(by_name) < 2:
        return dict(by_name)
    foreign = {name for name, path in by_name.items() if not _may_be(path, is_one)}
    if len(foreign) == len(by_name):
        return dict(by_name)
    for name in sorted(foreign):
        remark(f"{by_name[name]} is passed over: it has none of the columns of the other files")
    return {name: path for name, path in by_name.items() if name not in foreign}


def _may_be(path: Path, is_one: Callable[[Path], bool]) -> bool:
    try:
        return is_one(path)
    except RecordingError:
        return True
