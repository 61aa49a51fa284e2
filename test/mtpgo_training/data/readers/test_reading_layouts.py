# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The readers by the names of their layouts."""

import pytest

from mtpgo_core.errors import MtpgoError, RecordingError
from mtpgo_training.data.code_hash import imported_modules
from mtpgo_training.data.readers.datasets.crowd_recordings import FRAME_RATES
from mtpgo_training.data.readers.drone_recordings import DRONE_READERS
from mtpgo_training.data.readers.reading_layouts import LAYOUTS, finder_of
from mtpgo_training.data.readers.reading_options import ReadingOptions


def test_the_layouts_of_several_data_sets_have_names():
    assert set(DRONE_READERS) | set(FRAME_RATES) < set(LAYOUTS)
    assert len(set(LAYOUTS)) == len(LAYOUTS)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_every_layout_has_a_finder_that_looks_into_the_directory(layout, tmp_path):
    with pytest.raises(MtpgoError, match=f"{tmp_path}|needs --columns"):
        finder_of(layout)(tmp_path, None, ReadingOptions())


def test_an_unknown_layout_is_answered_with_those_that_there_are():
    with pytest.raises(RecordingError, match="'other' is unknown, expected one of highd, ind"):
        finder_of("other")


def test_what_is_cached_of_a_drone_recording_does_not_depend_on_the_readers_of_others(tmp_path):
    """A changed reader of bags must not empty the cache of highD, nor is its code hashed then."""
    for kind in ("tracks", "tracksMeta", "recordingMeta"):
        (tmp_path / f"01_{kind}.csv").write_text("id\n")
    (unit,) = finder_of("highd")(tmp_path, None, ReadingOptions())
    modules = imported_modules([unit.read.__module__])
    readers = "mtpgo_training.data.readers"
    assert f"{readers}.drone_recordings" in modules
    assert not {f"{readers}.bags.bag_recordings", f"{readers}.reading_layouts"} & modules
