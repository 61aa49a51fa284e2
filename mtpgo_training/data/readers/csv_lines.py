# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Kind and line numbers of a text file, for error messages only."""

from __future__ import annotations

import csv
import gzip
import io
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, cast

SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs", "|": "'|'", " ": "blanks"}
"""Separators of cells that are told apart, and how a sentence calls them."""

_KINDS = {
    b"PK\x03\x04": "a ZIP archive or a spreadsheet, expected CSV",
    b"\xd0\xcf\x11\xe0": "a spreadsheet, expected CSV",
    b"\x1f\x8b": "compressed by gzip, expected a name that ends in .gz",
    b"version https://git-lfs": "a pointer of Git LFS, expected the file that 'git lfs pull' gets",
    b"<!doctype": "a web page, expected CSV",
    b"<html": "a web page, expected CSV",
    b"<?xml": "XML, expected CSV",
    b"BZh9": "compressed by bzip2, expected CSV, or CSV compressed by gzip",
    b"\xfd7zXZ": "compressed by xz, expected CSV, or CSV compressed by gzip",
    b"\x28\xb5\x2f\xfd": "compressed by Zstandard, expected CSV, or CSV compressed by gzip",
    b"SQLite format 3": "an SQLite file, expected CSV",
    b'{"': "JSON, expected CSV",
    b'[{"': "JSON, expected CSV",
    b"PAR1": "a Parquet file, expected a name that ends in .parquet",
    b"\xff\xfe\0\0": "encoded in UTF-32, expected UTF-8",
    b"\0\0\xfe\xff": "encoded in UTF-32, expected UTF-8",
    b"\xff\xfe": "encoded in UTF-16, expected UTF-8",
    b"\xfe\xff": "encoded in UTF-16, expected UTF-8",
}
"""First bytes of files that are no plain text -> what they are."""

_BEGIN = 64
"""Bytes of a file that are looked at; chosen, longer than any of the above."""


def is_packed(path: Path) -> bool:
    """Return whether the name of a file ends in ``.gz``, in small letters or capitals."""
    return path.suffix.lower() == ".gz"


def open_file(path: Path) -> BinaryIO:
    """Open a file to read its bytes, those within where its name ends in ``.gz``.

    Raises:
        OSError: it cannot be opened.
    """
    return cast(BinaryIO, gzip.open(path)) if is_packed(path) else path.open("rb")


def kind_of_other_file(path: Path) -> str:
    """Return the kind of a file that is not plain text, "" if it may be plain text.

    Args:
        path: the file; one whose name ends in ``.gz`` is looked at as it is.

    Raises:
        OSError: it cannot be read.
    """
    with path.open("rb") as stream:
        begin = stream.read(_BEGIN)
    if is_packed(path):
        return ""
    for bytes_of, kind in _KINDS.items():
        tag = bytes_of.startswith(b"<")  # may be in any case, the others are codes
        if (begin.lower() if tag else begin).startswith(bytes_of):
            return kind
    if begin and not begin.strip(b"\0"):
        return "no text but zero bytes at its beginning, expected CSV"
    # Every second byte of English text in UTF-16 is zero.
    if b"\0" in begin.rstrip(b"\0"):
        return "no text, expected CSV in UTF-8"
    return ""


def separator_of(line: str) -> str:
    """Return the separator that occurs most often in a line, a blank if there is no other."""
    counts = {mark: line.count(mark) for mark in SEPARATORS if mark != " "}
    best = max(counts, key=lambda mark: counts[mark])
    return best if counts[best] else " "


def wrong_separator(path: Path, found: str, expected: str) -> str:
    """Return the sentence for a file that separates its cells by another mark than expected."""
    expected = SEPARATORS.get(expected, repr(expected))
    return f"{path} separates its columns by {SEPARATORS[found]}, expected {expected}"


def line_in_file(path: Path, number: int) -> int:
    """Return the line at which the row with a number begins.

    Blank lines are no rows, and a cell in quotes may have line breaks.

    Args:
        path: the file.
        number: of the row, from 1; the line of column names counts.
    """
    for row, (line, _) in enumerate(_rows(path), start=1):
        if row == number:
            return line
    return number


def line_of_open_quote(path: Path) -> int:
    """Return the line at which the last row's last quote opens, for a file that ends within it."""
    line, cells = 1, [""]
    for begin, row in _rows(path, whole=True):
        line, cells = begin, row
    return line + sum(cell.count("\n") for cell in cells[:-1])


def first_longer_row(path: Path, width: int) -> tuple[int, int] | None:
    """Return line and number of cells of the first row with more cells than ``width``."""
    for line, cells in _rows(path):
        if len(cells) > width and any(cell.strip() for cell in cells[width:]):
            return line, len(cells)
    return None


def _rows(path: Path, *, whole: bool = False) -> Iterator[tuple[int, list[str]]]:
    """Yield the line at which each row begins, and its cells, as far as the file can be read.

    Args:
        path: the file.
        whole: yield a row of a cell that is too long for the library, too, without its cells.
    """
    before = 0
    try:
        with open_file(path) as file:
            stream = io.TextIOWrapper(file, "utf-8-sig", "replace")
            mark = separator_of(next((line for line in stream if line.strip()), ""))
            stream.seek(0)
            reader = csv.reader(stream, delimiter=mark, skipinitialspace=True)
            for cells in reader:
                begin, before = before + 1, reader.line_num
                if len(cells) > 1 or "".join(cells).strip():
                    yield begin, [cell for cell in cells if cell] if mark == " " else cells
    except csv.Error:
        if whole:
            yield before + 1, [""]
    except (OSError, EOFError, zlib.error):
        return
