# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Conversion into bags of every kind and back, also read by other libraries."""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability
from rosbags.rosbag2.metadata import dump_qos_v8

from msg_adapters.bags.bag_reader import is_bag
from msg_adapters.bags.mcap_writer import McapWriter, _qos
from msg_adapters.inputs.lane_markers import lanes_to_markers
from msg_adapters.registry import INPUTS
from mtpgo_core.errors import RecordingError
from mtpgo_core.identity import keys_from_texts
from mtpgo_core.schema import AgentClass, tracked_states
from mtpgo_training.data.bag_conversion import convert, copy_bag, selected
from mtpgo_training.data.readers import iter_recordings, load_recordings
from mtpgo_training.data.recording import DEFAULT_START_NS, Recording
from mtpgo_training.data.recording_bag import write_recording

sys.path.insert(0, str(Path(__file__).parents[1]))
import drone_files

WITHOUT_VELOCITY = {"vision", "markers"}


@pytest.fixture
def recording(tmp_path: Path) -> Recording:
    """The tiny highD recording: frames 1 and 2, three vehicles, six lines."""
    (read,) = load_recordings(drone_files.write_highd(tmp_path / "highd"), "highd")
    return read


@pytest.mark.parametrize("kind", INPUTS)
def test_round_trip_of_every_kind(tmp_path: Path, recording: Recording, kind: str) -> None:
    bag = tmp_path / "out.mcap"
    (done,) = convert([dataclasses.replace(recording, ego_id=2)], bag, kind=kind)
    assert (done.frames, done.messages) == (2, 4)
    (back,) = load_recordings(bag, "bag")
    np.testing.assert_array_equal(back.track_id, recording.track_id)
    np.testing.assert_array_equal(back.track, recording.track)
    np.testing.assert_array_equal(back.agent_class, recording.agent_class)
    np.testing.assert_allclose(back.position, recording.position, atol=1e-9)
    np.testing.assert_allclose(np.cos(back.yaw - recording.yaw), 1.0, atol=1e-9)
    np.testing.assert_allclose(back.size, recording.size, atol=1e-6)
    for name in ("velocity", "acceleration"):
        if kind in WITHOUT_VELOCITY:
            assert np.isnan(getattr(back, name)).all()
        else:
            np.testing.assert_allclose(getattr(back, name), getattr(recording, name), atol=1e-5)
    assert back.ego_id == 2
    assert [s.stamp_ns for s in back.states()] == [s.stamp_ns for s in recording.states()]
    for line, expected in zip(back.lanes, recording.lanes, strict=True):
        np.testing.assert_allclose(line, expected)


@pytest.mark.parametrize("kind", INPUTS)
def test_mcap_ros2_support_decodes_every_kind(
    tmp_path: Path, recording: Recording, kind: str
) -> None:
    convert([recording], tmp_path / "out.mcap", kind=kind)
    with (tmp_path / "out.mcap").open("rb") as stream:
        messages = [
            (channel.topic, message.log_time, decoded)
            for _, channel, message, decoded in make_reader(
                stream, decoder_factories=[DecoderFactory()]
            ).iter_decoded_messages()
        ]
    assert [topic for topic, _, _ in messages] == ["/lane_markings", "/objects", "/objects"]
    for (_, time_ns, message), expected in zip(messages[1:], recording.states(), strict=True):
        states = INPUTS[kind].to_states(message)
        assert states.stamp_ns == time_ns == expected.stamp_ns
        np.testing.assert_allclose(states.position, expected.position, atol=1e-9)
        np.testing.assert_array_equal(states.key, expected.key)


def test_a_directory_is_a_rosbag2_bag_with_latched_lanes(
    tmp_path: Path, recording: Recording
) -> None:
    convert([recording], tmp_path / "bag")
    assert {p.name for p in (tmp_path / "bag").iterdir()} == {"metadata.yaml", "bag.mcap"}
    with AnyReader([tmp_path / "bag"]) as reader:
        by_topic = {c.topic: c for c in reader.connections}
        assert by_topic["/objects"].msgtype == "sensor_msgs/msg/PointCloud2"
        durability = {
            topic: c.ext.offered_qos_profiles[0].durability for topic, c in by_topic.items()
        }
        assert durability == {
            "/lane_markings": QosDurability.TRANSIENT_LOCAL,
            "/objects": QosDurability.VOLATILE,
        }
        assert reader.start_time == DEFAULT_START_NS + 40_000_000
        assert reader.duration == 40_000_001
        (_, _, data), *_ = reader.messages([by_topic["/lane_markings"]])
        markers = reader.deserialize(data, by_topic["/lane_markings"].msgtype).markers
        assert {m.type for m in markers} == {4}  # LINE_STRIP
        assert markers[0].header.frame_id == "map"


def test_single_file_names_itself_in_rosbag2_metadata(
    tmp_path: Path, recording: Recording
) -> None:
    convert([recording], tmp_path / "night drive.mcap")
    with (tmp_path / "night drive.mcap").open("rb") as stream:
        (metadata,) = make_reader(stream).iter_metadata()
    assert metadata.name == "rosbag2"
    assert "night drive.mcap" in metadata.metadata["serialized_metadata"]


def test_several_recordings_one_bag_each_or_joined(tmp_path: Path) -> None:
    for name in ("01", "02"):
        drone_files.write_ind(tmp_path / "ind", name)
    recordings = load_recordings(tmp_path / "ind", "ind")
    convert(recordings, tmp_path / "bags")
    assert all(is_bag(tmp_path / "bags" / name) for name in ("01", "02"))
    assert [r.name for r in load_recordings(tmp_path / "bags", "bag")] == ["01", "02"]
    convert(recordings, tmp_path / "joined.mcap")
    convert(recordings, tmp_path / "joined", join=True)
    for path in (tmp_path / "joined.mcap", tmp_path / "joined"):
        first, second = load_recordings(path, "bag")
        assert (first.name, second.name) == ("joined-1", "joined-2")
        # The first lasts from 0 to 0.3 s, and 10 s later the second begins.
        assert second.start_time_ns - first.start_time_ns == 10_300_000_000
        np.testing.assert_array_equal(first.position, second.position)
        assert first.frame.tolist() == second.frame.tolist() == [0, 1, 1, 3]


def test_recordings_are_taken_one_at_a_time(tmp_path: Path) -> None:
    for name in ("01", "02", "03"):
        drone_files.write_ind(tmp_path / "ind", name)
    alive = 0

    def watched():
        nonlocal alive
        for recording in iter_recordings(tmp_path / "ind", "ind"):
            written = len(list((tmp_path / "out").iterdir())) if (tmp_path / "out").is_dir() else 0
            # One may be read ahead, to find out whether there are several.
            assert alive - written <= 2
            alive += 1
            yield recording

    assert len(convert(watched(), tmp_path / "out")) == 3


def test_ego_time_and_parked(tmp_path: Path) -> None:
    recordings = load_recordings(drone_files.write_ind(tmp_path / "ind"), "ind")
    (part,) = selected(recordings, start_s=0.1, end_s=0.2, ego_id=5)
    assert (part.frame.tolist(), part.ego_id) == ([1, 1], 5)
    (moving,) = selected(recordings, drop_parked=True)
    assert moving.track_id.tolist() == [0]
    with pytest.raises(RecordingError, match=r"the ego 9 is in none of the recordings 07"):
        list(selected(recordings, ego_id=9))


def test_earlier_bag_is_replaced_and_nothing_else(tmp_path: Path, recording: Recording) -> None:
    for name in ("bag", "bag.mcap"):
        convert([recording], tmp_path / name)
        convert([recording.between(0.0, 0.0)], tmp_path / name)
        (back,) = load_recordings(tmp_path / name, "bag")
        assert len(back.frames) == 1
    assert {p.name for p in tmp_path.iterdir()} == {"bag", "bag.mcap", "highd"}
    with pytest.raises(RecordingError, match=r"highd exists and is no bag"):
        convert([recording], tmp_path / "highd")
    (tmp_path / "notes").write_text("mine")
    with pytest.raises(RecordingError, match=r"notes exists and is no bag"):
        convert([recording], tmp_path / "notes")
    assert (tmp_path / "notes").read_text() == "mine"


def test_an_unfinished_bag_leaves_no_file(tmp_path: Path, recording: Recording) -> None:
    def broken():
        yield recording
        raise RecordingError("the second recording is broken")

    with pytest.raises(RecordingError, match="second recording"):
        convert(broken(), tmp_path / "out.mcap")
    with pytest.raises(RecordingError, match=r"nothing was written to .*out\.mcap"):
        convert([], tmp_path / "out.mcap")
    assert {p.name for p in tmp_path.iterdir()} == {"highd"}
    (tmp_path / "file").write_text("")
    with pytest.raises(RecordingError, match=r"file/out\.mcap cannot be written: "):
        convert([recording], tmp_path / "file" / "out.mcap")


@pytest.mark.parametrize("join", [False, True])
def test_recordings_that_are_too_short_for_what_is_wanted_are_left_out(
    tmp_path: Path, recording: Recording, join: bool, caplog: pytest.LogCaptureFixture
) -> None:
    half_s = 0.5 * recording.duration_s
    short = dataclasses.replace(recording.between(0.0, 0.5 * half_s), name="short")
    other = dataclasses.replace(recording, name="other")

    def converted(*given: Recording) -> list[tuple[str, ...]]:
        wanted = selected(given, start_s=half_s)
        return [bag.recordings for bag in convert(wanted, tmp_path / "out", join=join)]

    names = (recording.name, "other")
    bags = [names] if join else [(name,) for name in names]
    assert converted(recording, short, other) == bags
    assert [record.getMessage() for record in caplog.records] == [
        "mtpgo: the recording short has no road user in what is wanted of it: it is left out"
    ]
    caplog.clear()
    with pytest.raises(RecordingError, match=r"nothing was written to .*: no recording"):
        converted(short, dataclasses.replace(short, name="shorter"))
    assert caplog.records == []


def test_foreign_identities_keep_their_keys(tmp_path: Path, recording: Recording) -> None:
    words = np.arange(12, dtype=np.uint32).reshape(3, 4) + 7
    foreign = dataclasses.replace(recording, track_key=words)
    convert([foreign], tmp_path / "out.mcap", kind="autoware")
    (back,) = load_recordings(tmp_path / "out.mcap", "bag")
    assert back.track_id.tolist() == [0, 1, 2]
    np.testing.assert_array_equal(back.key[back.track], words[foreign.track])


def test_irregular_stamps_are_read_on_a_millisecond_grid(
    tmp_path: Path, recording: Recording
) -> None:
    uneven = dataclasses.replace(
        recording, frame_rate=1000.0, frame=np.array([0, 0, 100, 100, 317])[: len(recording)]
    )
    convert([uneven], tmp_path / "out.mcap")
    (back,) = load_recordings(tmp_path / "out.mcap", "bag")
    assert back.frame_rate == 1000.0
    assert back.frame.tolist() == [0, 0, 100, 100, 317]


def test_a_bag_that_cannot_be_read_is_reported_with_the_reason(
    tmp_path: Path, recording: Recording
) -> None:
    with McapWriter(tmp_path / "talk.mcap") as bag:
        bag.add_topic("/chatter", "std_msgs/msg/String")
        bag.write("/chatter", 1, bag.types.make("std_msgs/msg/String", data="hello"))
    with pytest.raises(
        RecordingError,
        match=r"talk\.mcap has no topic with tracked objects, it has /chatter \(std_msgs/msg/Str",
    ):
        load_recordings(tmp_path / "talk.mcap", "bag")
    convert([recording], tmp_path / "cut.mcap")
    data = (tmp_path / "cut.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(data[:20])
    with pytest.raises(RecordingError, match=r"cut\.mcap cannot be read as a bag"):
        load_recordings(tmp_path / "cut.mcap", "bag")
    (tmp_path / "text.mcap").write_text("no bag at all")
    with pytest.raises(RecordingError, match=r"text\.mcap cannot be read as a bag"):
        load_recordings(tmp_path / "text.mcap", "bag")
    with pytest.raises(RecordingError, match=r"has no bags, expected \.mcap files"):
        load_recordings(tmp_path / "highd", "bag")
    with pytest.raises(RecordingError, match=r"is not a bag, expected an \.mcap file"):
        load_recordings(tmp_path / "highd" / "01_tracks.csv", "bag")


def test_empty_messages_and_late_lanes_add_no_recording(
    tmp_path: Path, recording: Recording
) -> None:
    adapter = INPUTS["pointcloud2"]
    first = next(recording.states())
    nothing = tracked_states(first.stamp_ns + 10**8, "", first.key[:0], first.position[:0])
    with McapWriter(tmp_path / "odd.mcap") as bag:
        list(write_recording(bag, recording))
        bag.write("/objects", nothing.stamp_ns, adapter.from_states(nothing, bag.types))
        lanes = lanes_to_markers(recording.lanes, bag.types, stamp_ns=0, frame_id="map")
        bag.write("/lane_markings", nothing.stamp_ns + 10**11, lanes)
    (back,) = load_recordings(tmp_path / "odd.mcap", "bag")
    np.testing.assert_array_equal(back.position, recording.position)


def test_damaged_bytes_give_a_one_line_error(tmp_path: Path, recording: Recording) -> None:
    path = tmp_path / "out.mcap"
    convert([recording], path)
    data = path.read_bytes()
    generator = np.random.default_rng(0)
    sentences = []
    for _ in range(60):
        damaged = bytearray(data)
        for position in generator.integers(0, len(data), 3):
            damaged[position] = int(generator.integers(256))
        path.write_bytes(bytes(damaged))
        try:
            load_recordings(path, "bag")
        except RecordingError as error:
            sentences.append(str(error))
    assert len(sentences) > 10
    assert not [sentence for sentence in sentences if "\n" in sentence]


def test_classes_survive(tmp_path: Path, recording: Recording) -> None:
    convert([recording], tmp_path / "out.mcap")
    (back,) = load_recordings(tmp_path / "out.mcap", "bag")
    assert back.agent_class.tolist() == [AgentClass.CAR, AgentClass.TRUCK, AgentClass.CAR]


def write_damaged_bag(path: Path, count: int = 2000) -> None:
    """A cut file of a latched text, numbers, and a topic that is not for ROS 2."""
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=20_000)
        writer.start(profile="ros2", library="test")
        text = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        own = writer.register_schema("own_msgs/msg/Pair", "ros2msg", b"float64 a\nfloat64 b")
        json = writer.register_schema("Odd", "jsonschema", b"{}")
        latched = dump_qos_v8([_qos(latched=True, reliable=True, depth=1)])
        texts = writer.register_channel("/text", "cdr", text, {"offered_qos_profiles": latched})
        pairs = writer.register_channel("/pair", "cdr", own)
        odd = writer.register_channel("/odd", "json", json)
        writer.add_message(texts, 0, b"\0\1\0\0\2\0\0\x003\0", 0)
        for number in range(count):
            pair = np.array([number, -number], dtype=np.float64)
            writer.add_message(pairs, number * 10_000_000, b"\0\1\0\0" + pair.tobytes(), 0)
            writer.add_message(odd, number * 10_000_000, b"{}", 0)
    path.write_bytes(path.read_bytes()[:-3000])


@pytest.mark.parametrize("name", ["whole", "whole.mcap"])
def test_what_is_left_of_a_damaged_bag_is_copied_into_a_whole_one(
    tmp_path: Path, name: str
) -> None:
    damaged, whole = tmp_path / "damaged.mcap", tmp_path / name
    write_damaged_bag(damaged)
    copied = copy_bag(damaged, whole)
    assert (copied.topics, list(copied.skipped)) == ({"/pair", "/text"}, ["/odd"])
    assert copied.duration_s == pytest.approx(0.01 * (copied.messages - 2))
    with AnyReader([whole]) as reader:  # which also compares the hashes of the types
        (latched,) = [c for c in reader.connections if c.topic == "/text"]
        assert latched.ext.offered_qos_profiles[0].durability is QosDurability.TRANSIENT_LOCAL
        found = [
            (c.topic, reader.deserialize(data, c.msgtype)) for c, _, data in reader.messages()
        ]
    assert found[0][1].data == "3"
    pairs = [message for topic, message in found if topic == "/pair"]
    assert len(pairs) > 1000
    assert [(p.a, p.b) for p in pairs] == [(k, -k) for k in range(len(pairs))]
    assert copied.messages == len(pairs) + 1
    if whole.is_dir():
        assert sorted(p.name for p in whole.iterdir()) == ["metadata.yaml", "whole.mcap"]
    with pytest.raises(RecordingError, match="is the bag itself"):
        copy_bag(damaged, damaged)
    if whole.is_dir():
        with pytest.raises(RecordingError, match="which is read, expected another output"):
            copy_bag(whole, whole / "whole.mcap")


def test_a_bag_never_takes_the_place_of_what_it_is_made_of(
    tmp_path: Path, recording: Recording
) -> None:
    fleet = tmp_path / "fleet"
    convert([recording], fleet / "a")
    convert([recording], fleet / "b.mcap")
    other = dataclasses.replace(recording, name="a")
    sources = [fleet / "a" / "a.mcap", fleet / "b.mcap"]
    before = {path: path.read_bytes() for path in fleet.rglob("*") if path.is_file()}
    for recordings, output in (
        ([recording], fleet / "a"),
        ([recording], fleet / "b.mcap"),
        ([recording], fleet / "a" / "a.mcap"),
        ([other, recording], fleet),
    ):
        with pytest.raises(RecordingError, match="which is read, expected another output"):
            convert(recordings, output, sources=sources)
    assert before == {path: path.read_bytes() for path in fleet.rglob("*") if path.is_file()}
    written = convert([recording, dataclasses.replace(other, name="b")], fleet, sources=sources)
    assert [one.path.name for one in written] == ["01", "b"]


@pytest.mark.parametrize("kind", sorted(INPUTS.keys() - {"derived", "ika"}))
def test_an_ego_without_a_number_is_kept(tmp_path: Path, recording: Recording, kind: str) -> None:
    keys = keys_from_texts(["ego", "b2d4c6e8-0000-4000-8000-000000000001", "car 7"])
    named = dataclasses.replace(
        recording, track_id=np.arange(3), track_key=keys, ego_id=0, lanes=()
    )
    convert([named], tmp_path / "out.mcap", kind=kind)
    (back,) = load_recordings(tmp_path / "out.mcap", "bag")
    np.testing.assert_array_equal(back.key[back.track_id == back.ego_id], keys[:1])


def test_a_copy_has_one_definition_of_a_type_and_says_so(tmp_path: Path) -> None:
    kind = "a_msgs/msg/Level"
    path = tmp_path / "a.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros2", library="test")
        for number, (topic, text) in enumerate(
            [("/a", "uint8 level"), ("/b", "uint8 old\nuint8 level"), ("/a", "uint8 level # new")]
        ):
            schema = writer.register_schema(kind, "ros2msg", text.encode())
            channel = writer.register_channel(topic, "cdr", schema)
            writer.add_message(channel, number, b"\0\1\0\0" + bytes([7, 8]), number)
        writer.finish()
    copied = copy_bag(path, tmp_path / "b.mcap")
    assert (copied.topics, copied.messages) == ({"/a"}, 2)
    assert copied.skipped == {
        "/b": "1 message with another definition of a_msgs/msg/Level than those of /a"
    }
