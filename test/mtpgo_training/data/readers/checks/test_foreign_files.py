# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Tables of another kind beside those of a data set."""

import drone_files

from mtpgo_core.errors import RecordingError
from mtpgo_training.data.readers import load_recordings
from mtpgo_training.data.readers.checks.foreign_files import without_foreign
from mtpgo_training.data.readers.reading_job import ReadingJob
from mtpgo_training.data.readers.reading_options import ReadingOptions
from mtpgo_training.data.readers.reading_unit import Unit


def units_of(folder, *names):
    return [Unit(name, "table", (folder / name,), lambda: iter(())) for name in names]


def test_files_of_another_kind_are_left_out_and_named_whenever_the_others_are_read(
    tmp_path, caplog
):
    def is_one(path):
        if path.name == "damaged":
            raise RecordingError("damaged")
        return path.name != "notes"

    found = without_foreign(units_of(tmp_path, "a", "b", "notes", "damaged"), is_one)
    assert [unit.name for unit in found] == ["a", "b", "damaged"]
    for _ in range(2):
        assert not caplog.records
        assert list(ReadingJob(tuple(found), ReadingOptions(), tmp_path).read()) == []
        (sentence,) = [record.getMessage() for record in caplog.records]
        assert f"{tmp_path / 'notes'} is passed over: it has none of the columns" in sentence
        caplog.clear()


def test_where_none_is_of_the_kind_all_are_read(tmp_path):
    for units in (units_of(tmp_path, "a", "b"), units_of(tmp_path, "a")):
        assert without_foreign(units, lambda path: False) == units


def test_packed_recordings_are_named(tmp_path, caplog):
    drone_files.write_ind(tmp_path, "07")
    load_recordings(tmp_path, "ind")
    for name in ("07_tracks.csv.zip", "rest.7z", ".hidden.zip"):
        (tmp_path / name).write_bytes(b"PK")
    assert not caplog.records
    load_recordings(tmp_path, "ind")
    (record,) = caplog.records
    assert record.getMessage() == (
        f"mtpgo: {tmp_path}: what is packed is passed over, expected it unpacked: rest.7z"
    )
    caplog.clear()
    load_recordings(tmp_path, "ind", ["07"])
    (tmp_path / "rest").mkdir()
    load_recordings(tmp_path, "ind")
    assert not caplog.records


def test_packed_files_that_are_read_are_not_named(tmp_path, caplog):
    drone_files.write_ind(tmp_path, "07")
    for path in list(tmp_path.iterdir()):
        drone_files.pack(path)
    (recording,) = load_recordings(tmp_path, "ind")
    assert len(recording) == 4
    assert not caplog.records
