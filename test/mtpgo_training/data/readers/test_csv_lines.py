# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What a text file is, and the lines at which its rows are."""

import bz2
import gzip
import lzma

import pytest

from mtpgo_training.data.readers.csv_lines import (
    first_longer_row,
    kind_of_other_file,
    line_in_file,
)

LINES = {
    "no blank lines": ("v,w\n1,2\n3,4\n", [1, 2, 3]),
    "blank lines": ("\n\nv,w\n1,2\n\n  \n3,4\n", [3, 4, 7]),
    "line breaks in quotes": ('v,w\n1,"a\nb"\n3,4\n', [1, 2, 4]),
    "empty cells are a row": ("v,w\n,\n3,4\n", [1, 2, 3]),
    "carriage returns": ("v,w\r\r1,2\r3,4\r", [1, 3, 4]),
    "blanks between the cells": (" v  w\n\n 1  2\n", [1, 3]),
    "a quote within a cell": ('v,w\n1,5"\n\n3,4\n', [1, 2, 4]),
}


@pytest.mark.parametrize("name", LINES)
@pytest.mark.parametrize("packed", [False, True])
def test_the_line_of_a_row(tmp_path, name, packed):
    text, lines = LINES[name]
    path = tmp_path / ("t.csv.gz" if packed else "t.csv")
    path.write_bytes(gzip.compress(text.encode()) if packed else text.encode())
    assert [line_in_file(path, number + 1) for number in range(len(lines))] == lines


def test_a_row_that_is_not_there_keeps_its_number(tmp_path):
    (tmp_path / "t.csv").write_text("v\n\n1\n")
    assert line_in_file(tmp_path / "t.csv", 9) == 9
    assert line_in_file(tmp_path / "none.csv", 3) == 3


def test_the_first_row_with_too_many_cells(tmp_path):
    path = tmp_path / "t.csv"
    path.write_text("v,w\n1,2,\n\n3,4,5\n6,7,8,9\n")
    assert first_longer_row(path, 2) == (4, 3)
    assert first_longer_row(path, 4) is None


@pytest.mark.parametrize(
    ("content", "kind"),
    [
        (b"PK\x03\x04\x14\x00", "a ZIP archive or a spreadsheet"),
        (gzip.compress(b"v,w\n", mtime=0), "compressed by gzip, expected a name that ends in .gz"),
        (b"PAR1\x15\x04", "a Parquet file, expected a name that ends in .parquet"),
        ("v,w\n1,2\n".encode("utf-16"), "encoded in UTF-16, expected UTF-8"),
        ("v,w\n1,2\n".encode("utf-32"), "encoded in UTF-32, expected UTF-8"),
        ("v,w\n1,2\n".encode("utf-16-le"), "no text, expected CSV in UTF-8"),
        (bytes(500), "no text but zero bytes at its beginning, expected CSV"),
        (b"version https://git-lfs.github.com/spec/v1\n", "a pointer of Git LFS, expected the"),
        (b"<!DOCTYPE html>\n<html>", "a web page, expected CSV"),
        (b"<!doctype html><html>", "a web page, expected CSV"),
        (b"<?xml version='1.0'?>", "XML, expected CSV"),
        (bz2.compress(b"v,w\n"), "compressed by bzip2, expected CSV, or CSV compressed by gzip"),
        (lzma.compress(b"v,w\n"), "compressed by xz, expected CSV, or CSV compressed by gzip"),
        (b"\x28\xb5\x2f\xfd\x04", "compressed by Zstandard, expected CSV, or CSV compressed by"),
        (b"SQLite format 3\0", "an SQLite file, expected CSV"),
        (b'{"v": 1}\n{"v": 2}\n', "JSON, expected CSV"),
        (b'[{"v": 1}]', "JSON, expected CSV"),
        (b"v,w\n1,2\n\0\0\0", ""),
        ("\ufeffStra\u00dfe\n".encode(), ""),
        (b"", ""),
        (b"par1,par2\n", ""),
    ],
)
def test_other_files_are_told_by_their_first_bytes(tmp_path, content, kind):
    path = tmp_path / "t.csv"
    path.write_bytes(content)
    found = kind_of_other_file(path)
    assert found.startswith(kind)
    assert bool(found) == bool(kind)
