# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Lane files of every kind, and files that are none."""

import os

import pytest
from lane_files import feature, geojson, osm

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.maps import lane_file, lane_lines
from mtpgo_core.maps.lane_file import read_lane_file


def test_the_content_says_what_a_file_is(tmp_path):
    assert read_lane_file(osm(tmp_path / "map.json")).kind == "Lanelet2 OSM"
    line = feature("LineString", [[0.0, 0.0], [9.0, 0.0]])
    path = geojson(tmp_path / "lanes.xml", line)
    assert read_lane_file(path).kind == "GeoJSON"
    path.write_bytes(b"\xef\xbb\xbf\n " + path.read_bytes())
    assert len(read_lane_file(str(path)).lines) == 1


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (b"", "is empty, expected a Lanelet2 map"),
        (b"PK\x03\x04", "is neither XML nor JSON"),
        (b"{\xff\xfe}", "cannot be read as JSON in UTF-8"),
    ],
)
def test_other_files_are_refused(tmp_path, content, sentence):
    (tmp_path / "map").write_bytes(content)
    with pytest.raises(ConfigurationError, match=sentence):
        read_lane_file(tmp_path / "map")


def test_missing_and_large_files_are_refused(tmp_path, monkeypatch):
    with pytest.raises(ConfigurationError, match=r"none\.osm cannot be read: No such file"):
        read_lane_file(tmp_path / "none.osm")
    with pytest.raises(ConfigurationError, match="cannot be read: Is a directory"):
        read_lane_file(tmp_path)
    os.mkfifo(tmp_path / "pipe.osm")
    for endless in (tmp_path / "pipe.osm", "/dev/zero"):
        with pytest.raises(ConfigurationError, match="cannot be read: it is a pipe or a device"):
            read_lane_file(endless)
    monkeypatch.setenv("HOME", str(tmp_path))
    with pytest.raises(ConfigurationError, match=rf"{tmp_path}/a\.osm cannot be read"):
        read_lane_file("~/a.osm")
    path = osm(tmp_path / "map.osm")
    monkeypatch.setattr(lane_lines, "MOST_POINTS", 9)
    with pytest.raises(
        ConfigurationError, match="has 11 points of lane lines, expected at most 9"
    ):
        read_lane_file(path)
    monkeypatch.setattr(lane_file, "MOST_BYTES", 100)
    with pytest.raises(ConfigurationError, match="cut the map"):
        read_lane_file(path)
