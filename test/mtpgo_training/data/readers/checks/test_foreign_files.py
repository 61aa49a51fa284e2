# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Tables of another kind beside those of a data set."""

from mtpgo_core.errors import RecordingError
from mtpgo_training.data.readers.checks.foreign_files import without_foreign


def test_files_of_another_kind_are_named_and_left_out(tmp_path, caplog):
    files = {name: tmp_path / name for name in ("a", "b", "notes", "damaged")}

    def is_one(path):
        if path.name == "damaged":
            raise RecordingError("damaged")
        return path.name != "notes"

    assert list(without_foreign(files, is_one)) == ["a", "b", "damaged"]
    (sentence,) = [record.getMessage() for record in caplog.records]
    assert f"{tmp_path / 'notes'} is passed over: it has none of the columns" in sentence


def test_where_none_is_of_the_kind_all_are_read(tmp_path, caplog):
    files = {name: tmp_path / name for name in ("a", "b")}
    assert without_foreign(files, lambda path: False) == files
    assert without_foreign({"a": files["a"]}, lambda path: False) == {"a": files["a"]}
    assert not caplog.records
