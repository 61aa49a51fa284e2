# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Checked columns of CSV files: types by hand, and the place of each defect."""

import gzip

import numpy as np
import pytest

from mtpgo_core.errors import RecordingError
from mtpgo_training.data.readers import csv_table
from mtpgo_training.data.readers.csv_table import CsvForm, read_header, read_table

TEXT = """\
id, x,note,speed,extra
1,0.5,a,2.5,9
2,-3,7,,9
"""


@pytest.fixture
def file(tmp_path):
    def file(text, name="t.csv"):
        path = tmp_path / name
        path.write_bytes(gzip.compress(text.encode()) if name.endswith("gz") else text.encode())
        return path

    return file


@pytest.mark.parametrize("name", ["t.csv", "t.csv.gz"])
def test_columns_have_the_type_that_was_asked_for(file, name):
    table = read_table(
        file(TEXT, name),
        integers=["id"],
        numbers=["x"],
        unknown_allowed=["speed"],
        texts=["note"],
        optional=["colour"],
    )
    assert list(table.columns) == ["id", "x", "speed", "note"]
    assert (table["id"].dtype, table["x"].dtype) == (np.int64, np.float64)
    assert table["x"].tolist() == [0.5, -3.0]
    assert table["note"].tolist() == ["a", "7"]
    np.testing.assert_array_equal(table["speed"], [2.5, np.nan])


def test_whole_numbers_may_be_written_with_a_decimal_point(file):
    table = read_table(file("id,x\n3.0,1\n4,1\n"), integers=["id"])
    assert table["id"].dtype == np.int64
    assert table["id"].tolist() == [3, 4]


def test_only_optional_columns_may_be_missing(file):
    path = file(TEXT)
    assert list(read_table(path, numbers=["x", "y"], optional={"y"}).columns) == ["x"]
    sentence = r"t\.csv has no column 'y', expected the columns id, x, y"
    with pytest.raises(RecordingError, match=sentence):
        read_table(path, integers=["id"], numbers=["x", "y"])


@pytest.mark.parametrize(
    ("cell", "kind", "sentence"),
    [
        ("abc", "integers", "line 3, column 'v': 'abc', expected a number"),
        ("2.5", "integers", "line 3, column 'v': '2.5', expected a whole number"),
        ("1e17", "integers", "line 3, column 'v': '1e+17', expected a whole number"),
        ("", "numbers", "line 3, column 'v': an empty cell, expected a finite number"),
        ("-inf", "numbers", "line 3, column 'v': '-inf', expected a finite number"),
        ("inf", "unknown_allowed", "'inf', expected a finite number or an empty cell"),
        ("x", "unknown_allowed", "line 3, column 'v': 'x', expected a number"),
    ],
)
def test_a_bad_cell_is_named_with_its_line_and_column(file, cell, kind, sentence):
    path = file(f"v,w\n1,0\n{cell},0\n3,0\n")
    with pytest.raises(RecordingError) as caught:
        read_table(path, **{kind: ["v"]})
    assert str(caught.value).startswith(f"{path}, line 3, column 'v': ")
    assert str(caught.value).endswith(sentence)


def test_the_line_of_a_bad_cell_counts_over_all_portions(file, monkeypatch):
    monkeypatch.setattr(csv_table, "_ROWS_AT_ONCE", 3)
    rows = "".join(f"{n},0\n" for n in range(10))
    table = read_table(file("v,w\n" + rows), integers=["v"])
    assert table["v"].tolist() == list(range(10))
    with pytest.raises(RecordingError, match=r"line 12, column 'v': 'bad'"):
        read_table(file("v,w\n" + rows + "bad,0\n"), integers=["v"])


def test_a_file_that_ends_within_a_line_is_truncated(file):
    path = file("u,v,w\n1,5,5\n2,5,6\n3,7")
    sentence = "ends within line 4, expected 3 cells: the file is truncated"
    with pytest.raises(RecordingError, match=sentence):
        read_table(path, integers=["u"])
    with pytest.raises(RecordingError, match=r"line 4: 2 cells, expected 3$"):
        read_table(file("u,v,w\n1,5,5\n2,5,6\n3,7\n"), integers=["u"])


COMPLETE = {
    "only the last cell empty": "v,w\n1,5\n2,5\n3,\n",
    "only the last cell empty, without a line break": "v,w\n1,5\n2,5\n3,",
    "the last column empty": "v,w\n1,\n2,\n3,",
    "carriage returns": "v,w\r1,5\r2,5\r3,\r",
    "blank lines at the end": "v,w\n1,5\n2,5\n3,\n\n  \n",
    "empty cells at the end": "v,w\n1,5\n2,5\n3,\n,\n,\n",
    "zero bytes at the end": "v,w\n1,5\n2,5\n3,5\n\0\0\0",
    "control z at the end": "v,w\n1,5\n2,5\n3,5\r\n\x1a",
    "lines of several lengths": "v,w,x\n1,5,6\n2,5\n3,5",
    "the header has a comma too many": "v,w,\n1,5\n2,5\n3,5",
    "byte order mark": "\ufeffv,w\n1,5\n2,5\n3,5",
    "quoted": '"v","w"\n"1","5"\n"2","5"\n"3",""\n',
}


@pytest.mark.parametrize("text", COMPLETE.values(), ids=COMPLETE)
@pytest.mark.parametrize("name", ["t.csv", "t.csv.gz"])
def test_a_complete_file_is_never_called_truncated(file, text, name):
    assert read_table(file(text, name), integers=["v"])["v"].tolist() == [1, 2, 3]


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("v;w\n1;2,5\n", "separates its columns by semicolons, expected commas"),
        ("v\tw\n1\t2.5\n", "separates its columns by tabs, expected commas"),
        ("v w\n1 2.5\n", "separates its columns by blanks, expected commas"),
        ("v|w\n1|2.5\n", r"separates its columns by '\|', expected commas"),
        ("sep=;\nv;w\n1;2\n", "begins with the line 'sep=;' of a spreadsheet"),
        ("u\n1\n", "has no column 'v', expected the columns v"),
    ],
)
def test_a_wrong_separator_is_named(file, text, sentence):
    with pytest.raises(RecordingError, match=rf"t\.csv {sentence}"):
        read_table(file(text), numbers=["v"])


def test_another_encoding_is_named(tmp_path):
    (tmp_path / "t.csv").write_bytes("v,w\n1,2\n".encode("utf-16"))
    with pytest.raises(RecordingError, match=r"t\.csv is encoded in UTF-16, expected UTF-8"):
        read_table(tmp_path / "t.csv", numbers=["v"])
    (tmp_path / "t.csv").write_bytes("v,w\n1,\u00fc\n".encode("latin-1"))
    with pytest.raises(RecordingError, match=r"the byte 0xfc is not UTF-8, expected UTF-8"):
        read_table(tmp_path / "t.csv", numbers=["v"])


def test_a_form_says_how_the_cells_are_written(file):
    def w(text, form):
        return read_table(file(text), numbers=["w"], form=form)["w"].tolist()

    assert w("v;w\n1;2,5\n", CsvForm(separator=";", decimal=",")) == [2.5]
    assert w('v,w\n1,"1,234.5"\n', CsvForm(thousands=",")) == [1234.5]
    form = CsvForm(separator=" ", names=("v", "w"))
    assert w("  1   2.5\n 2 3\n", form) == [2.5, 3]
    with pytest.raises(RecordingError, match="line 2, column 'w': 'x', expected a number"):
        read_table(file("1 2.5\n2 x\n"), numbers=["w"], form=form)


def test_a_file_without_a_header_is_refused(file):
    with pytest.raises(RecordingError, match=r"t\.csv is empty, expected a CSV file with a"):
        read_header(file(""))
    with pytest.raises(RecordingError, match=r"t\.csv\.gz cannot be read as CSV: "):
        read_header(file(TEXT, "u.csv").rename(file("", "t.csv.gz")))
    assert read_header(file(TEXT)) == ["id", "x", "note", "speed", "extra"]


def test_a_column_that_is_there_twice_is_refused_only_where_it_is_wanted(file):
    for header in ("v,w,v", "v,w, v", '"v",w,"v"'):
        path = file(header + "\n1,2,3\n")
        assert read_table(path, integers=["w"])["w"].tolist() == [2]
        with pytest.raises(RecordingError, match=r"t\.csv has 2 columns 'v', expected one"):
            read_table(path, integers=["v"])


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("# tracker 3, 2024\nv,w\n1,2\n", "it has # tracker 3, 2024$"),
        ("# made by tracker\nv,w\n1,2\n", "it has # made by tracker$"),
        ("V,W\n1,2\n", "it has V, W$"),
        (",w\n1,2\n", "it has '', w$"),
        (",".join(f"c{n}" for n in range(40)) + "\n1\n", "c10, c11 and 28 more$"),
        ("x" * 500 + ",w\n1,2\n", "it has " + "x" * 40 + r"\.\.\., w$"),
    ],
)
def test_columns_that_are_there_are_listed_where_one_is_missing(file, text, sentence):
    with pytest.raises(
        RecordingError, match=f"has no column 'v', expected the columns v; .*{sentence}"
    ):
        read_table(file(text), numbers=["v"])


def test_the_line_of_a_spreadsheet_is_named_whatever_the_separator(file):
    with pytest.raises(RecordingError, match="begins with the line 'sep=' of a spreadsheet"):
        read_table(file("sep=;\nv;w\n1;2\n"), numbers=["v"], form=CsvForm(separator=";"))


def test_lines_are_those_of_the_file_where_some_are_blank(file):
    with pytest.raises(RecordingError, match="line 6, column 'v': 'x', expected a number"):
        read_table(file("\nv,w\n\n1,2\n\nx,4\n"), numbers=["v"])
    with pytest.raises(RecordingError, match=r"line 5: 3 cells, expected 2$"):
        read_table(file("v,w\n\n1,2\n\n3,4,5\n"), numbers=["v"])
    with pytest.raises(RecordingError, match="ends within line 6, expected 3 cells"):
        read_table(file("u,v,w\n\n1,5,5\n\n2,5,6\n3,7"), integers=["u"])


def test_a_file_of_another_kind_is_named(file):
    (path := file("")).write_bytes(b"PK\x03\x04")
    with pytest.raises(
        RecordingError, match=r"t\.csv is a ZIP archive or a spreadsheet, expected CSV"
    ):
        read_header(path)


HEADERS = [
    b"a,b\n1,2\n",
    b"a, b ,c\r\n1,2,3\r\n",
    b"a,b\r1,2\r",
    b"\xef\xbb\xbfa,b\n1,2\n",
    b"a;b,c\n1;2\n",
    b"a,b",
    b"a,a,b\n1,2,3\n",
    b"a,,b\n1,2,3\n",
    b"a,b,\n1,2,3\n",
    b"\n\na,b\n1,2\n",
    b"  \na,b\n1,2\n",
    b'"a,b",c\n1,2\n',
    b'a,"b\nc"\n1,2\n',
    b"a\x0bb,c\xe2\x80\xa8d\n1,2\n",
    b"a b,c\td\n1,2\n",
    b"a'b,#c\n1,2\n",
    b"a,b\n1,2,3\n4,5,6\n",
    b"a" * 70_000 + b",b\n1,2\n",
]


@pytest.mark.parametrize("separator", [",", ";", "\t"])
@pytest.mark.parametrize("content", HEADERS, ids=lambda content: repr(content[:20]))
def test_a_header_is_what_pandas_says(tmp_path, monkeypatch, content, separator):
    path = tmp_path / "t.csv"
    path.write_bytes(content)
    form = CsvForm(separator=separator)
    found = read_header(path, form)
    monkeypatch.setattr(csv_table, "_plain_header", lambda path, form: None)
    assert found == read_header(path, form)
