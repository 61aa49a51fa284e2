# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Names of parts of recordings, and the parts that they denote."""

from pathlib import Path

import pytest
from traffic import braking_cars

from mtpgo_core.errors import RecordingError
from mtpgo_training.data.readers.recording_parts import (
    RecordingPart,
    cut_parts,
    part_name,
    parts_in,
)

WHERE = Path("somewhere")


def recordings(*names):
    return [braking_cars(name, tracks=2, seconds=3.0, rate=10.0) for name in names]


@pytest.mark.parametrize(
    ("start_s", "end_s", "name"),
    [
        (60.0, 116.0, "01@60-116s"),
        (0.0, 5.5, "01@0-5.5s"),
        (4.9, 1234567.25, "01@4.9-1234567.25s"),
    ],
)
def test_a_part_is_found_again_by_its_name(start_s, end_s, name):
    assert part_name("01", start_s, end_s) == name
    assert RecordingPart.from_name(name) == RecordingPart(name, "01", start_s, end_s)


@pytest.mark.parametrize("name", ["01", "01@60s", "01@60-116", "01@-5-9s", "@1-2s", "01@1-2s.csv"])
def test_other_names_denote_whole_recordings(name):
    assert RecordingPart.from_name(name) is None
    assert parts_in([name]) == []


def test_a_recording_may_have_an_at_sign_in_its_name():
    assert RecordingPart.from_name("a@1-2s@3-4s").whole == "a@1-2s"


def test_a_part_may_be_in_the_files_of_its_recording_or_of_several():
    part = RecordingPart.from_name("drive-2@0-9s")
    assert part.may_be_in("drive-2")
    assert part.may_be_in("drive")
    assert not part.may_be_in("driv")
    assert not part.may_be_in("drive-2-1")


def test_parts_are_cut_from_their_recordings_under_their_own_names():
    parts = parts_in(["02@1-2s", "01@0.5-0.7s", "02@0-0.1s"])
    found = list(cut_parts(recordings("01", "02", "03"), parts, WHERE))
    assert [part.name for part in found] == ["01@0.5-0.7s", "02@1-2s", "02@0-0.1s"]
    assert [part.frames.tolist() for part in found] == [[5, 6, 7], [*range(10, 21)], [0, 1]]


def test_a_missing_recording_is_reported_with_those_there_are():
    parts = parts_in(["01@0-1s", "04@0-1s"])
    with pytest.raises(RecordingError, match="somewhere has no recording '04', it has 01, 02"):
        list(cut_parts(recordings("01", "02"), parts, WHERE))
    with pytest.raises(RecordingError, match="no recording '01', it has none of that name"):
        list(cut_parts([], parts, WHERE))


def test_a_part_that_ends_long_after_its_recording_is_told(caplog):
    found = list(cut_parts(recordings("01"), parts_in(["01@1-3s", "01@1-100s"]), WHERE))
    assert [len(part) for part in found] == [len(found[0])] * 2
    (told,) = caplog.messages
    said = "somewhere, recording 01: the part up to 100 s ends with the recording, at 2.9 s"
    assert told == f"mtpgo: {said}"


def test_a_part_without_a_road_user_is_reported():
    parts = parts_in(["01@7-9s"])
    sentence = r"recording 01: no road user from 7 to 9 s, it lasts 2\.9 s"
    with pytest.raises(RecordingError, match=sentence):
        list(cut_parts(recordings("01"), parts, WHERE))
