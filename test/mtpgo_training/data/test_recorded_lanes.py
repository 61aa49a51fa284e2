# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Lanes of a file take the place of a recording's own, and a file of another place is noticed."""

import pytest
from demo_traffic import make_recording

from mtpgo_core.maps.lane_file import read_lane_file
from mtpgo_training.data.readers import iter_recordings
from mtpgo_training.data.readers.reading_options import ReadingOptions
from mtpgo_training.data.recorded_lanes import with_lanes
from mtpgo_training.data.recording_cache import RecordingCache
from mtpgo_training.data.writers.ind_writer import write_ind


def lane_file(path, y, x=0.0):
    lines = [[[x - 1000.0, y + side], [x + 1000.0, y + side]] for side in (2.0, -2.0)]
    text = str(lines).replace("'", '"')
    path.write_text(f'{{"type": "MultiLineString", "coordinates": {text}}}')
    return path


def test_reading_with_a_lane_file_does_not_change_the_cache(tmp_path):
    write_ind(make_recording("01"), tmp_path)
    cache = RecordingCache(tmp_path / "cache")
    plain = ReadingOptions()
    options = ReadingOptions(lane_file=lane_file(tmp_path / "lanes", 0.0))
    for given, number in ((plain, 0), (options, 2), (plain, 0)):
        (recording,) = iter_recordings(tmp_path, "ind", None, given, cache=cache)
        assert len(recording.lanes) == number


@pytest.mark.parametrize(("x", "warnings"), [(0.0, 0), (50_000.0, 1)])
def test_lanes_of_another_place_are_a_warning(tmp_path, caplog, x, warnings):
    lanes = read_lane_file(lane_file(tmp_path / "lanes", -10.0, x))
    assert len(with_lanes(make_recording(), lanes).lanes) == 2 - 2 * warnings
    found = [record.message for record in caplog.records]
    assert len(found) == warnings
    assert all("no lane line within 1 km" in text for text in found)
