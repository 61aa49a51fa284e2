# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""CSV files as checked columns; a defect is reported in one sentence with file and place."""

from __future__ import annotations

import re
import unicodedata
import warnings
import zlib
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from mtpgo_core.errors import RecordingError, found_names, reason_of
from mtpgo_training.data.readers.checks.reading_remarks import remark
from mtpgo_training.data.readers.csv_lines import (
    first_longer_row,
    is_packed,
    kind_of_other_file,
    line_in_file,
    line_of_open_quote,
    open_file,
    separator_of,
    wrong_separator,
)

_ROWS_AT_ONCE = 100_000
"""Rows parsed together; chosen, bounds the memory."""

_LONGEST_LINE = 1 << 16
"""Bytes read to find the first or last line of a file; chosen far above the longest line."""

_FORM_ROWS = 1000
"""Rows in which marks of thousands are looked at; chosen: those of several road users."""

_LINE_END = re.compile(rb"[\r\n]")

_UNREADABLE = (OSError, EOFError, zlib.error, UnicodeDecodeError, pd.errors.ParserError)

_MOST_COLUMNS, _LONGEST_NAME, _LONGEST_CELL = 12, 40, 60
"""Names of columns that a sentence lists, the characters of one, and of a cell; chosen."""

_OPEN_QUOTE = "EOF inside string"
"""What pandas says of a quote that is never closed, with the number of a row of its own count."""

_DATE_OR_CLOCK = re.compile(r"\s*(\d{4}-\d\d-\d\d|\d{1,2}:\d\d)")
"""Beginning of a date or a time of day, as ISO 8601 writes them."""

_PADDING = "\x00\x1a"
"""Bytes that file systems and old editors leave behind the last line: zeros and Control-Z."""


@dataclass(frozen=True)
class CsvForm:
    """How a file writes its cells.

    Attributes:
        separator: between two cells, one character; a blank stands for any number of blanks.
        decimal: the decimal mark.
        thousands: the mark between groups of digits, None for none.
        names: the column names of a file without a header line, None where the first line has
            them.
        skipped: lines before the first one.
        blank: how many of these are blank, which are no rows.
    """

    separator: str = ","
    decimal: str = "."
    thousands: str | None = None
    names: Sequence[str] | None = None
    skipped: int = 0
    blank: int = 0

    @property
    def first_line(self) -> int:
        """Number of the first row with data, see :func:`line_in_file`."""
        return self.skipped - self.blank + (2 if self.names is None else 1)

    def pandas_options(self) -> dict[str, Any]:
        """The arguments of ``pandas.read_csv`` for this form."""
        header: dict[str, Any] = {} if self.names is None else {"header": None}
        return {
            **header,
            "sep": r"\s+" if self.separator == " " else self.separator,
            "decimal": self.decimal,
            # Others, as the narrow blank of some languages, are taken out by check_columns.
            "thousands": self.thousands if (self.thousands or "").isascii() else None,
            "names": None if self.names is None else list(self.names),
            "skiprows": self.skipped,
        }


STANDARD_FORM = CsvForm()
"""Commas, decimal points, a header line: what data sets are published in."""


def read_header(path: Path, form: CsvForm = STANDARD_FORM) -> list[str]:
    """Return the column names of a ``.csv`` or ``.csv.gz`` file.

    Raises:
        RecordingError: the file cannot be read or is empty.
    """
    if form.names is not None:
        return list(form.names)
    try:
        _require_text(path)
        plain = _plain_header(path, form)
        if plain is not None:
            return plain
        # As a row, for pandas renames the second of two columns of one name.
        options = {**form.pandas_options(), "header": None, "dtype": str}
        first = pd.read_csv(path, nrows=1, skipinitialspace=True, keep_default_na=False, **options)
    except pd.errors.EmptyDataError:
        raise RecordingError(f"{path} is empty, expected a CSV file with a header line") from None
    except _UNREADABLE as error:
        raise RecordingError(_cannot_be_read(path, error)) from error
    return [column_name(name) for name in first.iloc[0]]


def column_name(name: object) -> str:
    """Return the name of a column without blanks around it, in the usual form of Unicode.

    An umlaut is one character or two, which look the same; macOS writes two.
    """
    return unicodedata.normalize("NFC", str(name).strip())


def _require_text(path: Path) -> None:
    kind = kind_of_other_file(path)
    if kind:
        raise RecordingError(f"{path} is {kind}")


def _plain_header(path: Path, form: CsvForm) -> list[str] | None:
    """Return the column names where they can be had by splitting the first line.

    That takes a tenth of the time of pandas, which counts where there are many small files. None
    where pandas decides: quotes, blank lines, names that are missing or repeated, and whatever
    cannot be read.
    """
    if form.skipped or form.separator == " ":
        return None
    try:
        first, _rest = _LINE_END.split(_begin_of(path), maxsplit=1)
        names = [column_name(name) for name in first.decode("utf-8-sig").split(form.separator)]
    except (*_UNREADABLE, ValueError):
        return None
    odd = b'"' in first or b"\0" in first or "" in names or len(set(names)) < len(names)
    return None if odd else names


def _begin_of(path: Path) -> bytes:
    """Return the first bytes of a file, also with ``.gz``."""
    with open_file(path) as stream:
        return stream.read(_LONGEST_LINE)


def first_lines_of(path: Path, count: int, *, blank: bool = False) -> list[str]:
    """Return the first ``count`` lines of a text file, fewer if there are.

    Args:
        path: the file, also with ``.gz``.
        count: number of lines.
        blank: blank lines count.

    Raises:
        RecordingError: the file cannot be read.
    """
    try:
        _require_text(path)
        start = _begin_of(path)
    except _UNREADABLE as error:
        raise RecordingError(_cannot_be_read(path, error)) from error
    lines = start.decode("utf-8-sig", errors="replace").splitlines()
    return [line for line in lines if blank or line.strip()][:count]


def read_table(
    path: Path,
    *,
    integers: Sequence[str] = (),
    numbers: Sequence[str] = (),
    unknown_allowed: Sequence[str] = (),
    texts: Sequence[str] = (),
    optional: Collection[str] = (),
    unchecked: Sequence[str] = (),
    form: CsvForm = STANDARD_FORM,
) -> pd.DataFrame:
    """Return the named columns of a CSV file, checked.

    Args:
        path: ``.csv`` or ``.csv.gz`` file.
        integers: columns of whole numbers.
        numbers: columns of finite numbers.
        unknown_allowed: columns of numbers in which an empty cell or ``nan`` means unknown.
        texts: columns kept as text.
        optional: those of the above that may be missing from the file.
        unchecked: columns that are returned as they were parsed, for :func:`check_columns`.
        form: how the file writes its cells.

    Returns:
        A frame with int64, float64 and string columns.

    Raises:
        RecordingError: the file cannot be read, lacks a column, or has a cell that is not a
            number; the sentence names the file and the line or column.
    """
    header = read_header(path, form)
    wanted = [*unchecked, *integers, *numbers, *unknown_allowed, *texts]
    needed = [name for name in wanted if name not in optional]
    require_columns(path, header, needed, needed, form)
    present = [name for name in wanted if name in header]
    require_once(path, header, present)
    kinds: dict[str, Any] = {name: str for name in texts if name in present}
    table = _parse(path, present, kinds, form, len(header))
    check_columns(
        table,
        path,
        integers=integers,
        numbers=numbers,
        unknown_allowed=unknown_allowed,
        first_line=form.first_line,
        form=form,
    )
    return table


def check_thousands(path: Path, form: CsvForm, names: Sequence[str] | None = None) -> None:
    """Check that the mark of thousands of a file stands between groups of three digits.

    A decimal mark that is taken for it would make 12,5 a 125. Only the first rows are looked at.

    Args:
        path: ``.csv`` or ``.csv.gz`` file.
        form: how the file writes its cells; without a mark nothing is checked.
        names: the columns of numbers, None for all cells that look like numbers.

    Raises:
        RecordingError: a number has other groups.
    """
    if form.thousands is None:
        return
    options = {**form.pandas_options(), "thousands": None, "dtype": str, "nrows": _FORM_ROWS}
    try:
        table = pd.read_csv(path, index_col=False, skipinitialspace=True, **options)
    except _UNREADABLE:
        return  # what is wrong is said where the file is read
    table.columns = [column_name(name) for name in table.columns]
    mark, point = re.escape(form.thousands), re.escape(form.decimal)
    number = re.compile(rf"[-+]?[\d{mark}{point}]*\d")
    # India groups by two digits before the last three.
    grouped = re.compile(rf"[-+]?[1-9]\d{{0,2}}({mark}\d{{2,3}})*{mark}\d{{3}}({point}\d*)?")
    for name in table.columns if names is None else [n for n in names if n in table]:
        cells = table[name].dropna().astype("string").str.strip()
        marked = cells.str.contains(form.thousands, regex=False) & cells.str.fullmatch(number)
        bad = marked & ~cells.str.fullmatch(grouped)
        if bad.any():
            row = int(bad.idxmax())
            line = line_in_file(path, row + form.first_line)
            raise RecordingError(
                f"{path}, line {line}, column {name!r}: {_shown(str(cells[row]))}, expected "
                f"{form.thousands!r} between groups of three digits; is it the decimal mark?"
            )


def observed_rows(
    table: pd.DataFrame,
    path: Path,
    position: Sequence[str],
    *,
    first_line: int,
    unit: str = "line",
    form: CsvForm = STANDARD_FORM,
) -> pd.DataFrame:
    """Return the rows that have a position, as float64; the others are counted in a warning.

    Trackers write a row without a position for a road user that they have lost.

    Args:
        table: the columns, of any type, with an index that counts from 0.
        path: the file that it was read from.
        position: the columns of the position.
        first_line: number of the line that row 0 comes from.
        unit: what a row is in the file.
        form: how the file writes its cells.

    Raises:
        RecordingError: no row has a position, or a cell is neither a finite number nor empty.
    """
    check_columns(
        table, path, unknown_allowed=position, first_line=first_line, unit=unit, form=form
    )
    known = table[list(position)].notna().all(axis=1)
    lost = len(table) - int(known.sum())
    if not lost:
        return table
    columns = " or ".join(map(repr, position))
    if lost == len(table):
        raise RecordingError(
            f"{path} has no position: the columns {columns} are empty in all of its {lost} rows"
        )
    number = int(np.argmin(known.to_numpy(bool))) + first_line
    number = line_in_file(path, number) if unit == "line" else number
    remark(
        f"{path}: {lost} row(s) without a position ({columns}) are no observations and left out,"
        f" the first is {unit} {number}"
    )
    return table[known].copy()


def require_once(path: Path, header: Sequence[str], names: Sequence[str]) -> None:
    """Check that no column is there twice, for which of them is meant cannot be told.

    Raises:
        RecordingError: one is.
    """
    for name in names:
        if header.count(name) > 1:
            raise RecordingError(f"{path} has {header.count(name)} columns {name!r}, expected one")


def require_columns(
    path: Path,
    header: Sequence[str],
    needed: Sequence[str],
    wanted: Sequence[str],
    form: CsvForm = STANDARD_FORM,
) -> None:
    """Check that a file has the columns needed.

    Args:
        path: the file.
        header: its column names.
        needed: those that it must have.
        wanted: those that it may have, for the sentence.
        form: how the file was taken to write its cells.

    Raises:
        RecordingError: a column is missing; a wrong separator is named.
    """
    missing = [name for name in needed if name not in header]
    if not missing:
        return
    first = header[0] if header else ""
    if first.lower().startswith("sep="):
        raise RecordingError(
            f"{path} begins with the line {first!r} of a spreadsheet, expected the names of the "
            "columns"
        )
    if len(header) == 1:
        other = separator_of(first)
        cells = [cell.strip(" \"'") for cell in cells_of(first, other)]
        # A sentence has blanks as well.
        separates = len(cells) > 1 and (other != " " or not set(cells).isdisjoint(wanted))
        if other != form.separator and separates:
            raise RecordingError(wrong_separator(path, other, form.separator))
    raise RecordingError(
        f"{path} has no column {missing[0]!r}, expected the columns {', '.join(wanted)}; it has "
        f"{found_names(header, _MOST_COLUMNS, _LONGEST_NAME)}"
    )


def cells_of(line: str, separator: str) -> list[str]:
    """Return the cells of a line; a blank stands for any number of blanks or tabs."""
    return line.split(None if separator == " " else separator)


def check_columns(
    table: pd.DataFrame,
    path: Path,
    *,
    integers: Sequence[str] = (),
    numbers: Sequence[str] = (),
    unknown_allowed: Sequence[str] = (),
    first_line: int = 2,
    unit: str = "line",
    form: CsvForm = STANDARD_FORM,
    described: bool = False,
) -> None:
    """Turn the columns of a table into int64 and float64 in place, as :func:`read_table` says.

    Args:
        table: the columns, of any type; those that are missing are passed over.
        path: the file that it was read from, for the sentence.
        integers: columns of whole numbers.
        numbers: columns of finite numbers.
        unknown_allowed: columns of numbers that may be unknown.
        first_line: number of the line that the row with index 0 comes from.
        unit: what a row is in the file.
        form: how the file writes its cells, for those that were read as text.
        described: a user's file says what the columns mean, and may say of times that they are
            dates.

    Raises:
        RecordingError: a cell is not as it should be.
    """
    place = _Place(path, unit, first_line, described)
    for name in (*integers, *numbers, *unknown_allowed):
        if name in table:
            unknown = name in unknown_allowed
            _replace(table, name, _numbers(table[name], place, form, unknown=unknown))
    for name in integers:
        if name in table:
            _replace(table, name, _whole(table[name], place))


def _replace(table: pd.DataFrame, name: str, column: pd.Series) -> None:
    """Put a column in the place of one of another type."""
    if column.dtype != table[name].dtype:
        table[name] = column


def _parse(
    path: Path, present: Sequence[str], kinds: dict[str, Any], form: CsvForm, columns: int
) -> pd.DataFrame:
    """Return the columns wanted, read in chunks so that the others never fill the memory.

    All columns are parsed, as pandas overlooks lines that are too long otherwise.
    """
    chunks: list[pd.DataFrame] = []
    rows, width = 0, 0
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
                **form.pandas_options(),
            )
            with stream:
                for chunk in stream:
                    chunk.columns = [column_name(name) for name in chunk.columns]
                    rows += len(chunk)
                    width = chunk.shape[1]
                    ends_short = bool(len(chunk)) and bool(pd.isna(chunk.iloc[-1, -1]))
                    if ends_short:
                        chunk = _without_blank_end(chunk)
                    chunks.append(chunk[list(present)])
    except (pd.errors.ParserError, pd.errors.ParserWarning) as error:
        longer = first_longer_row(path, columns)
        if longer is None:
            raise RecordingError(_cannot_be_read(path, error)) from error
        raise RecordingError(
            f"{path}, line {longer[0]}: {longer[1]} cells, expected {columns}"
        ) from error
    except _UNREADABLE as error:
        raise RecordingError(_cannot_be_read(path, error)) from error
    if rows and ends_short:
        _check_end(path, width, rows + form.first_line - 1, form.separator)
    return pd.concat(chunks, ignore_index=True) if len(chunks) > 1 else chunks[0].copy()


def _without_blank_end(chunk: pd.DataFrame) -> pd.DataFrame:
    """Return a chunk without rows of empty cells or padding at its end."""
    keep = len(chunk)
    while keep:
        row = chunk.iloc[keep - 1]
        first, others = row.iloc[0], row.iloc[1:]
        padding = isinstance(first, str) and not first.strip(_PADDING)
        if not (others.isna().all() and (padding or pd.isna(first))):
            break
        keep -= 1
    return chunk.iloc[:keep] if len(chunk.columns) > 1 else chunk


def _check_end(path: Path, width: int, line: int, separator: str) -> None:
    """Check that the last line of an uncompressed file was written to its end.

    It was not if it has fewer cells than the header, fewer than the line before it, and no line
    break. A truncated compressed file cannot be decompressed, so it needs no such check.

    Raises:
        RecordingError: it was not, or it is short although a line break follows.
    """
    if is_packed(path) or separator == " ":
        return
    with path.open("rb") as stream:
        stream.seek(max(0, path.stat().st_size - 2 * _LONGEST_LINE))
        tail = stream.read().rstrip(_PADDING.encode() + b" ")
    closed = tail.endswith((b"\n", b"\r"))
    lines = [text for text in tail.splitlines() if text.strip()]
    cells = [text.count(separator.encode()) + 1 for text in lines[-2:]]
    if not cells or cells[-1] >= width or (len(cells) > 1 and cells[-1] >= cells[-2]):
        return
    line = line_in_file(path, line)
    if closed:
        raise RecordingError(f"{path}, line {line}: {cells[-1]} cells, expected {width}")
    raise RecordingError(
        f"{path} ends within line {line}, expected {width} cells: the file is truncated"
    )


def _cannot_be_read(path: Path, error: BaseException) -> str:
    """Return the sentence for an exception while a file is read."""
    if isinstance(error, UnicodeDecodeError):
        byte = error.object[error.start]
        return f"{path} cannot be read as CSV: the byte 0x{byte:02x} is not UTF-8, expected UTF-8"
    if _OPEN_QUOTE in str(error):
        return (
            f"{path}, line {line_of_open_quote(path)}: a quote opens here that is not closed"
            " before the end of the file"
        )
    reason = (str(error).strip().splitlines() or [type(error).__name__])[0]
    if isinstance(error, OSError):  # whose text would name the file again
        reason = reason_of(error)
    return f"{path} cannot be read as CSV: {reason}"


@dataclass(frozen=True)
class _Place:
    """Where the rows of a table come from."""

    path: Path
    unit: str
    first: int
    described: bool = False

    def refuse(self, column: pd.Series, bad: np.ndarray, expected: str) -> None:
        """Raise the error of the first bad cell, if there is any."""
        if not bad.any():
            return
        row = int(np.argmax(bad))
        cell = column.iloc[row]
        given = "an empty cell" if pd.isna(cell) else _shown(str(cell))
        if self.described and not pd.isna(cell) and _DATE_OR_CLOCK.match(str(cell)):
            expected += " (dates and times of day need time_unit: date)"
        number = int(column.index[row]) + self.first
        number = line_in_file(self.path, number) if self.unit == "line" else number
        if not pd.isna(cell) and "\n" in str(cell):
            expected += ", in one line: is a quote missing?"
        raise RecordingError(
            f"{self.path}, {self.unit} {number}, column {column.name!r}: {given}, "
            f"expected {expected}"
        )


def _shown(cell: str) -> str:
    """Return a cell in quotes, or its beginning: a stray quote makes one of half a file."""
    return repr(cell if len(cell) <= _LONGEST_CELL else f"{cell[:_LONGEST_CELL]}...")


def _numbers(column: pd.Series, place: _Place, form: CsvForm, *, unknown: bool) -> pd.Series:
    values = column
    if not pd.api.types.is_numeric_dtype(column) or pd.api.types.is_bool_dtype(column):
        texts = column.astype("string")
        # Of a column with a cell that is no number, pandas leaves all as they are written.
        if form.thousands is not None:
            texts = texts.str.replace(form.thousands, "", regex=False)
        if form.decimal != ".":
            texts = texts.str.replace(form.decimal, ".", regex=False)
        values = pd.to_numeric(texts, errors="coerce")
        place.refuse(column, (values.isna() & column.notna()).to_numpy(bool), "a number")
    if unknown:
        values = values.astype(np.float64)
        place.refuse(column, np.isinf(values.to_numpy()), "a finite number or an empty cell")
    elif values.dtype.kind == "u":
        place.refuse(column, (values > np.iinfo(np.int64).max).to_numpy(bool), "less than 2^63")
        values = values.astype(np.int64)
    elif values.dtype.kind != "i":
        values = values.astype(np.float64)
        place.refuse(column, ~np.isfinite(values.to_numpy()), "a finite number")
    return values


def _whole(column: pd.Series, place: _Place) -> pd.Series:
    if column.dtype.kind == "i":
        return column.astype(np.int64)
    values = column.to_numpy(np.float64)
    place.refuse(column, (values != np.round(values)) | (np.abs(values) > 2**53), "a whole number")
    return column.astype(np.int64)
