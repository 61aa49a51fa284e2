# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The three files of a recording: the same bytes for the same content, and no unfinished file."""

from __future__ import annotations

import gzip
from pathlib import Path

import pandas as pd
import pytest

from mtpgo_core.errors import RecordingError
from mtpgo_training.data.writers.csv_writer import write_tables

TRACKS = pd.DataFrame({"id": [1, 2], "x": [0.5, -2.25]})


class Unwritable:
    """A value that no file can hold."""

    def __str__(self) -> str:
        raise OSError(28, "No space left on device")


def write(directory: Path, tracks: pd.DataFrame = TRACKS, *, compress: bool = True) -> list[Path]:
    return write_tables(
        directory,
        "03",
        tracks=tracks,
        tracks_meta=pd.DataFrame({"id": [1, 2]}),
        recording_meta=pd.DataFrame({"frameRate": [25]}),
        compress=compress,
    )


def test_only_the_tracks_are_compressed(tmp_path: Path) -> None:
    packed, plain = write(tmp_path / "a" / "b"), write(tmp_path / "c", compress=False)
    rest = ["03_tracksMeta.csv", "03_recordingMeta.csv"]
    assert [path.name for path in packed] == ["03_tracks.csv.gz", *rest]
    assert [path.name for path in plain] == ["03_tracks.csv", *rest]
    assert plain[0].read_text() == "id,x\n1,0.5\n2,-2.25\n"
    assert gzip.decompress(packed[0].read_bytes()) == plain[0].read_bytes()
    assert sorted(path.name for path in (tmp_path / "c").iterdir()) == sorted(
        p.name for p in plain
    )


def test_packed_files_are_the_same_every_time(tmp_path: Path) -> None:
    (first, *_), (second, *_) = write(tmp_path / "a"), write(tmp_path / "b")
    assert first.read_bytes() == second.read_bytes()
    # The name inside is the file's own, not that of a temporary one, which no two runs share.
    named = first.read_bytes()[10:].split(b"\0", 1)[0]
    assert named == b"03_tracks.csv"


def test_a_table_that_cannot_be_written_leaves_no_file(tmp_path: Path) -> None:
    broken = pd.DataFrame({"id": [Unwritable()]})
    sentence = rf"{tmp_path} cannot be written to: No space left on device"
    with pytest.raises(RecordingError, match=sentence):
        write(tmp_path, broken, compress=False)
    assert list(tmp_path.iterdir()) == []


def test_unwritable_directory_is_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(RecordingError, match=r"file/x cannot be written to"):
        write(tmp_path / "file" / "x")
