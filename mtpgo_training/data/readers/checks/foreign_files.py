# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Files of another kind beside those of a data set whose names do not tell them apart."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from pathlib import Path

from mtpgo_core.errors import RecordingError
from mtpgo_training.data.readers.reading_unit import Unit


def without_foreign(units: Sequence[Unit], is_one: Callable[[Path], bool]) -> list[Unit]:
    """Return the files without those of another kind, which the first one names in a remark.

    Where none is of the kind asked for, all are returned: what is wrong with them is said where
    they are read. So it is of files that cannot be read.

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


def _may_be(path: Path, is_one: Callable[[Path], bool]) -> bool:
    try:
        return is_one(path)
    except RecordingError:
        return True
