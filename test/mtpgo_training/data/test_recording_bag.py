# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A recording on the topics of a bag: their order, latching and stamps."""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from msg_adapters.bags.bag_reader import DecodingBagReader
from msg_adapters.bags.mcap_writer import McapWriter
from msg_adapters.registry import INPUTS
from mtpgo_core.errors import ConfigurationError
from mtpgo_training.data.readers import load_recordings
from mtpgo_training.data.recording import Recording
from mtpgo_training.data.recording_bag import write_recording

sys.path.insert(0, str(Path(__file__).parents[1]))
import drone_files


@pytest.fixture
def recording(tmp_path: Path) -> Recording:
    """The tiny highD recording with an ego: frames 1 and 2, three vehicles, six lines."""
    (read,) = load_recordings(drone_files.write_highd(tmp_path / "highd"), "highd")
    return dataclasses.replace(read, ego_id=2)


def written(path: Path, *recordings: Recording, shift_ns: int = 0) -> list[tuple[str, int, Any]]:
    """Topic, log time (ns) and message of a bag that holds the recordings."""
    with McapWriter(path) as bag:
        for one in recordings:
            assert list(write_recording(bag, one, shift_ns=shift_ns)) == [2, 3]
    with DecodingBagReader(path) as reader:
        return [(c.topic, t, message) for c, t, message in reader.messages(reader.connections)]


def test_lanes_and_ego_have_the_time_of_the_first_frame(
    tmp_path: Path, recording: Recording
) -> None:
    messages = written(tmp_path / "a.mcap", recording)
    first, second = (recording.stamp_ns(frame) for frame in (1, 2))
    assert sorted((topic, time) for topic, time, _ in messages) == [
        ("/ego_id", first),
        ("/lane_markings", first),
        ("/objects", first),
        ("/objects", second),
    ]
    assert {topic: m.data for topic, _, m in messages if topic == "/ego_id"} == {"/ego_id": "2"}
    with DecodingBagReader(tmp_path / "a.mcap") as reader:
        latched = {topic.name: topic.latched for topic in reader.topics()}
    assert latched == {"/ego_id": True, "/lane_markings": True, "/objects": False}


def test_a_shift_moves_every_stamp(tmp_path: Path, recording: Recording) -> None:
    shift_ns = 7_000_000_000
    plain = written(tmp_path / "a.mcap", recording)
    shifted = written(tmp_path / "b.mcap", recording, shift_ns=shift_ns)
    assert [(topic, time + shift_ns) for topic, time, _ in plain] == [
        (topic, time) for topic, time, _ in shifted
    ]
    adapter = INPUTS["pointcloud2"]
    stamps = [adapter.to_states(m).stamp_ns for topic, _, m in shifted if topic == "/objects"]
    assert stamps == [recording.stamp_ns(frame) + shift_ns for frame in (1, 2)]
    (lanes,) = (m for topic, _, m in shifted if topic == "/lane_markings")
    stamp = lanes.markers[0].header.stamp
    assert stamp.sec * 10**9 + stamp.nanosec == stamps[0]


def test_objects_are_on_the_ground(tmp_path: Path, recording: Recording) -> None:
    adapter = INPUTS["pointcloud2"]
    for topic, _, message in written(tmp_path / "a.mcap", recording):
        if topic == "/objects":
            np.testing.assert_array_equal(adapter.to_states(message).z, 0.0)


def test_an_empty_recording_adds_no_topic(tmp_path: Path, recording: Recording) -> None:
    nothing = recording.select_rows(np.zeros(len(recording), dtype=bool))
    with McapWriter(tmp_path / "a.mcap") as bag:
        assert list(write_recording(bag, nothing)) == []
        assert not any(bag.has_topic(t) for t in ("/objects", "/lane_markings", "/ego_id"))
        assert list(write_recording(bag, recording)) == [2, 3]


def test_an_unknown_kind_is_refused(tmp_path: Path, recording: Recording) -> None:
    with (
        pytest.raises(ConfigurationError, match="'lidar'"),
        McapWriter(tmp_path / "a.mcap") as bag,
    ):
        list(write_recording(bag, recording, kind="lidar"))


def test_messages_go_to_the_file_as_they_are_made(tmp_path: Path) -> None:
    frames = 1200
    generator = np.random.default_rng(0)
    vectors = generator.normal(size=(40 * frames, 2))
    recording = Recording(
        name="long",
        layout="ind",
        location="",
        frame_rate=25.0,
        frame=np.repeat(np.arange(frames), 40),
        track=np.tile(np.arange(40), frames),
        position=vectors,
        velocity=vectors,
        acceleration=vectors,
        yaw=vectors[:, 0],
        track_id=np.arange(40),
        agent_class=np.ones(40, dtype=np.uint8),
        size=np.ones((40, 2)),
    )
    written = []
    with McapWriter(tmp_path / "long.mcap") as bag:
        for number, _ in enumerate(write_recording(bag, recording)):
            if number % 100 == 0:
                (growing,) = tmp_path.glob(".long.mcap.*/long/long.mcap")
                written.append(growing.stat().st_size)
    total = (tmp_path / "long.mcap").stat().st_size
    assert total > 1_000_000
    # What is not yet in the file is at most a chunk (one MiB before compression).
    behind = [total * n / 12 - size for n, size in enumerate(written)]
    assert max(behind) < 1_000_000
