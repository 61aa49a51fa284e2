# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Waymo's TFRecord files, made up: framing, valid states, the recording vehicle, defects."""

import struct

import numpy as np
import pytest

from mtpgo_core.errors import RecordingError
from mtpgo_core.schema import AgentClass
from mtpgo_training.data.data_sources import DataSource, read_sources
from mtpgo_training.data.readers import load_recordings
from mtpgo_training.data.readers.fleets.waymo_recordings import masked_crc32c, scenario_message

pytest.importorskip("google.protobuf")
pytest.importorskip("google_crc32c")


def scenario(identity, tracks=((7, 1), (3, 2)), steps=3):
    message = scenario_message()(scenario_id=identity, sdc_track_index=1)
    message.timestamps_seconds.extend(0.1 * k for k in range(steps))
    for i, (number, kind) in enumerate(tracks):
        track = message.tracks.add(id=number, object_type=kind)
        for k in range(steps):
            track.states.add(
                center_x=10.0 * i + k,
                center_y=5.0,
                length=4.5,
                width=2.0,
                heading=0.5,
                velocity_x=10.0,
                velocity_y=-1.0,
                valid=not (i == 1 and k == 1),
            )
    return message.SerializeToString()


def record(content):
    length = struct.pack("<Q", len(content))
    sums = [struct.pack("<I", masked_crc32c(part)) for part in (length, content)]
    return length + sums[0] + content + sums[1]


def test_the_scenarios_of_a_file(tmp_path):
    path = tmp_path / "training.tfrecord-00000-of-01000"
    path.write_bytes(record(scenario("a")) + record(scenario("b", tracks=((1, 3), (2, 4)))))
    a, b = load_recordings(tmp_path, "waymo")
    assert [r.name for r in (a, b)] == [f"{path.name}-a", f"{path.name}-b"]
    assert (a.frame_rate, a.ego_id, a.track_id.tolist()) == (10.0, 3, [3, 7])
    assert a.agent_class.tolist() == [AgentClass.PEDESTRIAN, AgentClass.CAR]
    assert (a.frame.tolist(), a.track.tolist()) == ([0, 0, 1, 2, 2], [0, 1, 1, 0, 1])
    np.testing.assert_allclose(a.position[:2], [[10, 5], [0, 5]])
    np.testing.assert_allclose(a.velocity, [[10, -1]] * 5)
    np.testing.assert_allclose(a.yaw, 0.5)
    np.testing.assert_allclose(a.size, [[4.5, 2.0]] * 2)
    assert b.agent_class.tolist() == [AgentClass.BICYCLE, AgentClass.UNKNOWN]
    assert a.sha256 != b.sha256


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (record(scenario("a"))[:-9], "ends within record 1, expected a TFRecord file"),
        (record(scenario("a")) + b"abc", "ends within record 2, expected a TFRecord file"),
        (struct.pack("<QI", 1 << 62, 0), "ends within record 1"),
        (
            record(scenario("a")) + b"\x01" + bytes(40),
            "record 2: its length and the check sum of that differ, expected a TFRecord file",
        ),
        (b"", "is empty, expected a TFRecord file"),
        (record(b"\xff\xff\xff"), "record 1 is no scenario of Waymo"),
        (
            record(scenario("abc").replace(b"abc", b"a\xffc")),
            "record 1 is no scenario of Waymo: its scenario_id is not text in UTF-8",
        ),
        (record(b""), "record 1 has no tracks or no times, expected a scenario of Waymo"),
    ],
)
def test_a_defect_is_one_sentence_with_its_place(tmp_path, content, sentence):
    (tmp_path / "a.tfrecord").write_bytes(content)
    with pytest.raises(RecordingError) as caught:
        load_recordings(tmp_path, "waymo")
    assert sentence in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_name_of_a_scenario_is_no_path(tmp_path):
    (tmp_path / "a.tfrecord").write_bytes(record(scenario("b/../../c\n")))
    assert [r.name for r in load_recordings(tmp_path, "waymo")] == ["a.tfrecord-b_.._.._c_"]


def test_no_file_is_named(tmp_path):
    with pytest.raises(RecordingError, match=r"has no recordings, expected Waymo's \.tfrecord"):
        load_recordings(tmp_path, "waymo")


def test_a_scenario_without_a_valid_state_is_left_out(tmp_path, caplog):
    content = scenario_message()(scenario_id="empty", timestamps_seconds=[0.0])
    content.tracks.add(id=7, object_type=1).states.add(valid=False)
    empty = record(content.SerializeToString())
    path = tmp_path / "a.tfrecord"
    path.write_bytes(empty + record(scenario("b")))
    (recording,) = load_recordings(tmp_path, "waymo")
    assert recording.name == "a.tfrecord-b"
    assert "record 1: no state of the scenario empty is valid" in caplog.text
    path.write_bytes(empty)
    with pytest.raises(RecordingError, match=r"a\.tfrecord has no scenario with a valid state"):
        load_recordings(tmp_path, "waymo")


def test_a_scenario_that_is_there_twice_is_refused(tmp_path):
    (tmp_path / "a.tfrecord").write_bytes(record(scenario("a")) * 2)
    with pytest.raises(RecordingError, match="record 2: the scenario a is there a second time"):
        load_recordings(tmp_path, "waymo")


def test_check_sums_are_those_of_the_format():
    # The check value of CRC-32C, that of "123456789", is e3069283; the mask is that of TFRecord.
    assert (
        masked_crc32c(b"123456789")
        == ((0xE3069283 >> 15 | 0xE3069283 << 17) & 0xFFFFFFFF) + (0xA282EAD8) & 0xFFFFFFFF
    )


def test_a_damaged_scenario_is_left_out(tmp_path, caplog):
    path = tmp_path / "a.tfrecord"
    damaged = bytearray(record(scenario("a")))
    damaged[40] ^= 1  # within the times of the scenario
    path.write_bytes(bytes(damaged) + record(scenario("b")))
    (recording,) = load_recordings(tmp_path, "waymo")
    assert recording.name == "a.tfrecord-b"
    assert f"{path}, record 1: its check sum is wrong" in caplog.text


def test_a_scenario_in_two_files_is_one_recording(tmp_path, caplog):
    for folder in ("validation", "validation_interactive"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "1.tfrecord").write_bytes(record(scenario("a")))
    found = list(read_sources([DataSource(tmp_path, "waymo")]))
    assert [item.recording.name for item in found] == ["validation-1.tfrecord-a"]
    assert "validation_interactive-1.tfrecord-a has the same content as" in caplog.text
