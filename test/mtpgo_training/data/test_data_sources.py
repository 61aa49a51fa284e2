# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Recordings of several directories and their names."""

import dataclasses
import shutil

import pytest
from traffic import braking_cars

from mtpgo_core.errors import ConfigurationError, RecordingError
from mtpgo_training.data import data_sources
from mtpgo_training.data.data_sources import (
    DataSource,
    KnownContents,
    named_recordings,
    read_all,
    read_sources,
    site_of,
)
from mtpgo_training.data.writers.ind_writer import write_ind


@pytest.fixture
def folders(tmp_path):
    for folder in ("one/ind", "other/ind", "b"):
        name = "02" if folder == "other/ind" else "01"
        tracks = 3 if folder == "b" else 2
        write_ind(braking_cars(name, tracks=tracks, seconds=1.0), tmp_path / folder)
    return tmp_path


def test_names_have_their_directory_where_there_are_several(folders):
    one, b = DataSource(folders / "one" / "ind", "ind"), DataSource(folders / "b", "ind")
    assert [name for name, _ in named_recordings([one])] == ["01"]
    assert [name for name, _ in named_recordings([one, b])] == ["ind/01", "b/01"]
    assert [item.name for item in read_sources([one])] == ["ind/01"]


def test_directories_of_the_same_name_may_hold_different_recordings(folders):
    sources = [DataSource(folders / place / "ind", "ind") for place in ("one", "other")]
    assert [item.name for item in read_sources(sources)] == ["ind/01", "ind/02"]


def test_a_recording_that_is_given_twice_is_refused_before_anything_is_read(folders):
    b = DataSource(folders / "b", "ind")
    (folders / "b" / "01_tracks.csv.gz").write_bytes(b"not to be read")
    sentence = "the recording b/01 is given twice, expected directories whose last parts differ"
    for sources in ([b, b], [b, b._replace(names=("1",))]):
        with pytest.raises(ConfigurationError, match=sentence):
            next(read_sources(sources))
    parts = [b._replace(names=(f"01@{part}s",)) for part in ("0-0.4", "0.4-0.8")]
    with pytest.raises(RecordingError, match="cannot be read as CSV"):
        next(read_sources(parts))  # two parts of one recording are no mistake
    write_ind(braking_cars("01", tracks=2, seconds=1.0), folders / "b")
    assert [item.name for item in read_sources(parts)] == ["b/01@0-0.4s", "b/01@0.4-0.8s"]


def test_a_copy_is_left_out_with_a_remark(folders, caplog):
    shutil.copytree(folders / "one" / "ind", folders / "copy")
    sources = [DataSource(folders / place, "ind") for place in ("one/ind", "copy")]
    assert [item.name for item in read_sources(sources)] == ["ind/01"]
    assert "copy/01 has the same content as ind/01, so it is left out" in caplog.text
    halves = [source._replace(names=("01@0-0.4s", "01@0.4-0.8s")) for source in sources]
    names = [item.name for item in read_sources(halves)]
    assert names == ["ind/01@0-0.4s", "ind/01@0.4-0.8s"]


def test_parts_of_parts_are_copies_where_they_are_of_the_same_time():
    contents = KnownContents()
    for name in ("a/01@60-116s@0-10s", "a/01@0-10s", "a/01"):
        assert contents.original_of(name, "ab") is None
    assert contents.original_of("b/01@60-70s", "ab") == "a/01@60-116s@0-10s"


def test_recordings_without_a_road_user_are_refused_where_all_are_needed(folders, monkeypatch):
    b = DataSource(folders / "b", "ind")
    assert [item.name for item in read_all([b])] == ["b/01"]
    empty = [
        dataclasses.replace(item, recording=item.recording.between(1e6, None))
        for item in read_all([b])
    ]
    assert not len(empty[0].recording)
    monkeypatch.setattr(data_sources, "read_sources", lambda *_: iter(empty))
    with pytest.raises(RecordingError, match=r"no recording of .*b has a road user"):
        read_all([b])


@pytest.mark.parametrize(
    ("name", "location", "site"),
    [
        ("01", "2", "2"),
        ("01", "", ""),
        ("a/01", "2", "a/2"),
        ("a/01", "", "a"),
        ("another", "2", "2"),
    ],
)
def test_the_site_is_the_location_after_the_folder_if_there_is_one(name, location, site):
    recording = dataclasses.replace(braking_cars("01", tracks=2, seconds=2.0), location=location)
    assert site_of(recording, name) == site
