# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""CSV files as checked columns; a defect is reported in one sentence with file and place."""

from __future__ import annotations

import hashlib
import warnings
import zlib
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from mtpgo_core.errors import RecordingError

_ROWS_AT_ONCE = 100_000
"""Rows parsed together; chosen, bounds the memory."""

_LONGEST_LINE = 1 << 16
"""Bytes read to find the last line of a file; chosen far above the longest line."""

_UNREADABLE = (OSError, EOFError, zlib.error, UnicodeDecodeError, pd.errors.ParserError)


def read_header(path: Path) -> list[str]:
    """Return the column names of a ``.csv`` or ``.csv.gz`` file.

    Raises:
        RecordingError: the file cannot be read or is empty.
    """
    try:
        return [str(name).strip() for name in pd.read_csv(path, nrows=0).columns]
    except pd.errors.EmptyDataError:
        raise RecordingError(f"{path} is empty, expected a CSV file with a header line") from None
    except _UNREADABLE as error:
        raise RecordingError(f"{path} cannot be read as CSV: {_reason(error)}") from error


def read_table(
    path: Path,
    *,
    integers: Sequence[str] = (),
    numbers: Sequence[str] = (),
    unknown_allowed: Sequence[str] = (),
    texts: Sequence[str] = (),
    optional: Collection[str] = (),
) -> pd.DataFrame:
    """Return the named columns of a CSV file, checked.

    Args:
        path: ``.csv`` or ``.csv.gz`` file with a header line.
        integers: columns of whole numbers.
        numbers: columns of finite numbers.
        unknown_allowed: columns of numbers in which an empty cell or ``nan`` means unknown.
        texts: columns kept as text.
        optional: those of the above that may be missing from the file.

    Returns:
        A frame with int64, float64 and string columns.

    Raises:
        RecordingError: the file cannot be read, lacks a column, or has a cell that is not a
            number; the sentence names the file and the line or column.
    """
    header = read_header(path)
    wanted = [*integers, *numbers, *unknown_allowed, *texts]
    missing = [name for name in wanted if name not in header and name not in optional]
    if missing:
        raise RecordingError(
            f"{path} has no column {missing[0]!r}, expected the columns {', '.join(wanted)}"
        )
    present = [name for name in wanted if name in header]
    kinds: dict[str, Any] = {name: str for name in texts if name in present}
    table = _parse(path, present, kinds)
    for name in present:
        if name not in kinds:
            table[name] = _numbers(path, table[name], unknown=name in unknown_allowed)
    for name in integers:
        if name in present:
            table[name] = _whole(path, table[name])
    return table


def sha256_of(paths: Sequence[Path]) -> str:
    """Return the SHA-256 over the contents of the files, one after the other."""
    digest = hashlib.sha256()
    for path in paths:
        with path.open("rb") as stream:
            while block := stream.read(1 << 20):
                digest.update(block)
    return digest.hexdigest()


def _parse(path: Path, present: Sequence[str], kinds: dict[str, Any]) -> pd.DataFrame:
    """Return the columns wanted, read in chunks so that the others never fill the memory.

    All columns are parsed, as pandas overlooks lines that are too long otherwise.
    """
    chunks: list[pd.DataFrame] = []
    rows, ends_open, open_cells = 0, False, 0
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", pd.errors.ParserWarning)
            stream = pd.read_csv(
                path,
                dtype=kinds,
                index_col=False,
                low_memory=False,
                skipinitialspace=True,
                chunksize=_ROWS_AT_ONCE,
            )
            with stream:
                for chunk in stream:
                    chunk.columns = [str(name).strip() for name in chunk.columns]
                    last = chunk.iloc[:, -1].isna().to_numpy(bool)
                    rows += len(chunk)
                    open_cells += int(last.sum())
                    ends_open = bool(last[-1]) if len(last) else ends_open
                    width = chunk.shape[1]
                    chunks.append(chunk[list(present)])
    except (*_UNREADABLE, pd.errors.ParserWarning) as error:
        raise RecordingError(f"{path} cannot be read as CSV: {_reason(error)}") from error
    if rows > 1 and ((ends_open and open_cells == 1) or _cells_missing_at_the_end(path, width)):
        raise RecordingError(
            f"{path} ends within line {rows + 1}, expected {width} cells: the file is truncated"
        )
    return pd.concat(chunks, ignore_index=True) if len(chunks) > 1 else chunks[0].copy()


def _cells_missing_at_the_end(path: Path, width: int) -> bool:
    """Return whether the last line of an uncompressed file has fewer cells than the header.

    A truncated compressed file cannot be decompressed, so it needs no such check.
    """
    if path.suffix == ".gz":
        return False
    with path.open("rb") as stream:
        stream.seek(max(0, path.stat().st_size - _LONGEST_LINE))
        lines = stream.read().rstrip().splitlines()
    return bool(lines) and lines[-1].count(b",") < width - 1


def _reason(error: BaseException) -> str:
    """Return the first line of an exception's text."""
    return (str(error).strip().splitlines() or [type(error).__name__])[0]


def _numbers(path: Path, column: pd.Series, *, unknown: bool) -> pd.Series:
    values = column
    if not pd.api.types.is_numeric_dtype(column) or pd.api.types.is_bool_dtype(column):
        values = pd.to_numeric(column.astype("string"), errors="coerce")
        _refuse(path, column, (values.isna() & column.notna()).to_numpy(bool), "a number")
    if unknown:
        values = values.astype(np.float64)
        bad = np.isinf(values.to_numpy())
        _refuse(path, column, bad, "a finite number or an empty cell")
    else:
        if values.dtype.kind != "i":
            values = values.astype(np.float64)
            _refuse(path, column, ~np.isfinite(values.to_numpy()), "a finite number")
    return values


def _whole(path: Path, column: pd.Series) -> pd.Series:
    if column.dtype.kind == "i":
        return column.astype(np.int64)
    values = column.to_numpy(np.float64)
    _refuse(
        path, column, (values != np.round(values)) | (np.abs(values) > 2**53), "a whole number"
    )
    return column.astype(np.int64)


def _refuse(path: Path, column: pd.Series, bad: np.ndarray, expected: str) -> None:
    if not bad.any():
        return
    row = int(np.argmax(bad))
    cell = column.iloc[row]
    given = "an empty cell" if pd.isna(cell) else repr(str(cell))
    # Line 1 is the header; pandas counts data rows from 0.
    raise RecordingError(
        f"{path}, line {row + 2}, column {column.name!r}: {given}, expected {expected}"
    )
