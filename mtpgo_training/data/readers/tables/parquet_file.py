# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Columns of Parquet and Feather files; pyarrow, from the extra ``datasets``, reads them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from mtpgo_core.errors import RecordingError

_LONGEST_TYPE = 40
"""Characters of a type that a sentence shows; chosen."""


def parquet_columns(path: Path) -> list[str]:
    """Return the column names of a Parquet file, also of those within another: ``pose.x``.

    Raises:
        RecordingError: it cannot be read.
    """
    import pyarrow
    from pyarrow import parquet

    try:
        return _names(parquet.read_schema(path))
    except (pyarrow.ArrowException, OSError, ValueError) as error:
        raise RecordingError(_cannot_be_read(path, "Parquet", error)) from error


def read_parquet(path: Path, columns: Sequence[str]) -> pd.DataFrame:
    """Return columns of a Parquet file, of the types that they have there.

    Bytes become text; those that are none become hexadecimal digits, so 16 of them are a UUID.

    Args:
        path: the file.
        columns: some of :func:`parquet_columns`.

    Raises:
        RecordingError: it cannot be read.
    """
    import pyarrow
    from pyarrow import compute, parquet

    try:
        names = parquet.read_schema(path).names
        outer = [name if name in names else name.partition(".")[0] for name in columns]
        # One thread: recordings are read beside trainings, and several at a time.
        table = parquet.read_table(path, columns=list(dict.fromkeys(outer)), use_threads=False)
        found = {
            name: table[name]
            if name == before
            else compute.struct_field(table[before], name.split(".")[1:])
            for name, before in zip(columns, outer, strict=True)
        }
        for name, column in found.items():
            _check_type(path, name, column.type)
        wanted = pyarrow.table(found)
        wanted.validate(full=True)  # texts that are no Unicode fail only where they are used
        frame = wanted.to_pandas(use_threads=False, ignore_metadata=True)
    except (pyarrow.ArrowException, OSError, ValueError, TypeError, OverflowError) as error:
        raise RecordingError(_cannot_be_read(path, "Parquet", error)) from error
    for name, column in found.items():
        if _is_bytes(column.type):
            frame[name] = _texts_of_bytes(frame[name])
    return frame


def _is_bytes(kind: Any) -> bool:
    from pyarrow import types

    kind = kind.value_type if types.is_dictionary(kind) else kind
    tests = (types.is_binary, types.is_large_binary, types.is_fixed_size_binary)
    return any(test(kind) for test in tests) or str(kind) == "binary_view"


def _check_type(path: Path, name: str, kind: Any) -> None:
    """Check that the cells of a column are single values.

    Raises:
        RecordingError: they are lists or the like.
    """
    from pyarrow.types import is_nested

    if is_nested(kind):
        raise RecordingError(
            f"{path}, column {name!r}: {str(kind)[:_LONGEST_TYPE]}, expected one number, date or "
            "text in each row"
        )


def _names(fields: Iterable[Any], before: str = "") -> list[str]:
    """Return the names of fields, each followed by those of the fields within it."""
    from pyarrow.types import is_struct

    names = []
    for field in fields:
        names.append(before + str(field.name))
        if is_struct(field.type):
            names += _names(field.type, names[-1] + ".")
    return names


def _texts_of_bytes(column: pd.Series) -> pd.Series:
    texts = {
        value: value.decode(errors="replace") for value in column.unique() if not pd.isna(value)
    }
    if all("\ufffd" not in text and text.isprintable() for text in texts.values()):
        return column.map(texts, na_action="ignore")
    return column.map(bytes.hex, na_action="ignore")


def read_feather(path: Path) -> pd.DataFrame:
    """Return a Feather file (Arrow's own format).

    Raises:
        RecordingError: it cannot be read.
    """
    import pyarrow
    from pyarrow import feather

    try:
        table = feather.read_table(path, use_threads=False)
        table.validate(full=True)
        return table.to_pandas(use_threads=False, ignore_metadata=True)
    except (pyarrow.ArrowException, OSError, ValueError, TypeError, OverflowError) as error:
        raise RecordingError(_cannot_be_read(path, "Feather", error)) from error


def _cannot_be_read(path: Path, kind: str, error: BaseException) -> str:
    reason = (str(error).strip().splitlines() or [type(error).__name__])[0]
    return f"{path} cannot be read as {kind}: {reason}"
