# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Folders of bags: whole, without metadata, split, with a bad split."""

import contextlib
import logging
import sqlite3
from contextlib import contextmanager

import pytest
import yaml
from backports import zstd
from mcap.writer import Writer as McapLibraryWriter
from rosbags.rosbag2 import StoragePlugin, Writer

from msg_adapters.bags import stored_bag
from msg_adapters.bags.bag_reader import bag_name, is_bag
from msg_adapters.bags.bag_types import bag_typestore
from msg_adapters.bags.stored_bag import StoredBag, bag_files, is_unfinished_bag
from mtpgo_core.errors import RecordingError

STEP_NS = 100_000_000


@pytest.fixture(autouse=True)
def _say_everything_again(monkeypatch):
    monkeypatch.setattr(stored_bag, "_told", set())


def number(message):
    return int(message[4:].rstrip(b"\0"))


def data_of(count):
    return b"\0\1\0\0" + str(count).encode()


@contextmanager
def library_writer(path):
    """Yield a writer of the library for an MCAP file, and its schema of texts."""
    with path.open("wb") as stream:
        writer = McapLibraryWriter(stream)
        writer.start(profile="ros2", library="test")
        yield writer, writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        writer.finish()


def write_split(path, files=3, each=20, storage=StoragePlugin.MCAP):
    """A bag of several files with 2 s of 10 Hz each, as rosbag2 writes it."""
    path.mkdir()
    suffix = "db3" if storage is StoragePlugin.SQLITE3 else "mcap"
    about = None
    for split in range(files):
        part = path / "part"
        with Writer(part, version=9, storage_plugin=storage) as writer:
            topic = writer.add_connection(
                "/x", "std_msgs/msg/String", typestore=bag_typestore(), offered_qos_profiles=[]
            )
            for count in range(split * each, (split + 1) * each):
                writer.write(topic, count * STEP_NS, data_of(count))
        name = f"{path.name}_{split}.{suffix}"
        next(p for p in part.iterdir() if p.suffix == f".{suffix}").rename(path / name)
        one = yaml.safe_load((part / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
        one["relative_file_paths"], one["files"][0]["path"] = [name], name
        if about is None:
            about = one
        else:
            for key in ("relative_file_paths", "files"):
                about[key] += one[key]
            about["message_count"] += one["message_count"]
        (part / "metadata.yaml").unlink()
        part.rmdir()
    write_metadata(path, about)
    return about


def write_metadata(path, about):
    text = yaml.safe_dump({"rosbag2_bagfile_information": about})
    (path / "metadata.yaml").write_text(text)


def read(path):
    with StoredBag(path) as bag:
        numbers = [number(data) for _, _, data in bag.messages()]
        return numbers, [loss.sentence() for loss in bag.losses()]


@pytest.mark.parametrize("storage", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_a_split_bag_is_read_with_and_without_metadata(tmp_path, storage, caplog):
    path = tmp_path / "bag"
    write_split(path, files=11, each=3, storage=storage)
    assert read(path) == (list(range(33)), [])
    assert not caplog.records
    (path / "metadata.yaml").unlink()
    assert is_unfinished_bag(path)
    assert [file.stem for file in bag_files(path)][-2:] == ["bag_9", "bag_10"]
    assert read(path) == (list(range(33)), [])
    (record,) = caplog.records
    assert record.levelno == logging.WARNING
    assert f"{path} has no metadata.yaml" in record.getMessage()
    with StoredBag(path) as bag:
        (connection,) = bag.connections
        assert (connection.msgcount, connection.topic) == (33, "/x")
        assert (bag.start_time, bag.end_time) == (0, 32 * STEP_NS + 1)
        part = [number(data) for _, _, data in bag.messages([connection], 300_000_000, 10**9)]
    assert part == list(range(3, 10))


@pytest.mark.parametrize("metadata", [True, False])
@pytest.mark.parametrize("content", [b"", bytes(5000), b"\x89MCAP0\r\n\1", b"text"])
def test_a_bad_split_is_left_out_and_its_loss_stated(tmp_path, content, metadata, caplog):
    path = tmp_path / "bag"
    write_split(path)
    if not metadata:
        (path / "metadata.yaml").unlink()
    (path / "bag_1.mcap").write_bytes(content)
    numbers, (sentence,) = read(path)
    assert numbers == [*range(20), *range(40, 60)]
    assert sentence.startswith(f"{path}/bag_1.mcap cannot be read (")
    if metadata:
        assert sentence.endswith("nothing of it is read, 20 messages (1.9 s) lost")
    else:
        assert "up to 2.1 s lost, of how many messages is not known" in sentence
    assert [r.getMessage() for r in caplog.records].count(sentence) == 1


def test_a_missing_split_is_a_loss(tmp_path):
    path = tmp_path / "bag"
    write_split(path)
    (path / "bag_2.mcap").unlink()
    numbers, (sentence,) = read(path)
    assert numbers == list(range(40))
    assert "bag_2.mcap cannot be read (No such file or directory)" in sentence
    assert "20 messages (1.9 s) lost" in sentence


@pytest.mark.parametrize(("kept", "missing"), [((0, 1, 3, 4), (2,)), ((2, 3, 4), ())])
def test_numbers_tell_which_split_is_missing_where_there_are_no_metadata(tmp_path, kept, missing):
    path = tmp_path / "bag"
    write_split(path, files=5)
    (path / "metadata.yaml").unlink()
    for place in set(range(5)) - set(kept):
        (path / f"bag_{place}.mcap").unlink()
    numbers, losses = read(path)
    assert numbers == [20 * place + n for place in kept for n in range(20)]
    assert len(losses) == len(missing)
    for place, sentence in zip(missing, losses, strict=True):
        assert f"bag_{place}.mcap cannot be read (No such file or directory)" in sentence
        assert "up to 2.1 s lost, of how many messages is not known" in sentence


def test_times_in_the_names_of_files_number_none_of_them(tmp_path):
    path = tmp_path / "bag"
    write_split(path, files=2)
    (path / "metadata.yaml").unlink()
    (path / "bag_1.mcap").rename(path / "bag_20240501120000.mcap")
    assert read(path) == (list(range(40)), [])


def test_files_that_the_metadata_do_not_name_yet_are_read_as_well(tmp_path, caplog):
    path = tmp_path / "bag"
    about = write_split(path)
    named = {key: about[key][:1] for key in ("relative_file_paths", "files")}
    write_metadata(path, {**about, **named, "message_count": 20})
    (path / "other.mcap").write_bytes(b"")
    assert read(path) == (list(range(60)), [])
    assert "metadata.yaml does not name bag_1.mcap, bag_2.mcap: read as well" in caplog.text


def test_a_cut_split_is_read_in_part_and_the_metadata_tell_the_loss(tmp_path):
    path = tmp_path / "bag"
    write_split(path, each=200)
    file = path / "bag_1.mcap"
    file.write_bytes(file.read_bytes()[:5000])
    numbers, (sentence,) = read(path)
    inside = [n for n in numbers if 200 <= n < 400]
    assert numbers == [*range(200), *inside, *range(400, 600)]
    assert 50 < len(inside) < 150
    lost = 200 - len(inside)
    assert f"{len(inside)} messages ({0.1 * (len(inside) - 1):.1f} s) read" in sentence
    assert f"{lost} messages ({0.1 * lost:.1f} s) lost" in sentence
    assert "about" not in sentence


@pytest.mark.parametrize(
    "change",
    [
        {"storage_identifier": ""},
        {"storage_identifier": "sqlite3"},
        {"ros_distro": ""},
        {"version": 5},
        {"version": 12},
        {"topics_with_message_count": None},
        {"files": None},
        {"files": 5, "topics_with_message_count": "none"},
        {"message_count": 10**400, "duration": {"nanoseconds": -1}},
        {"message_count": None, "duration": None, "starting_time": None},
        {"compression_mode": "none", "compression_format": ""},
        {"relative_file_paths": ["bag/bag_0.mcap"]},
    ],
    ids=str,
)
def test_only_the_files_themselves_tell_what_they_are(tmp_path, change, caplog):
    path = tmp_path / "bag"
    about = write_split(path, files=1)
    write_metadata(path, {**about, **change})
    assert read(path) == (list(range(20)), [])
    assert not caplog.records


_BUT_A_TEXT = "rosbag2_bagfile_information: {relative_file_paths: bag_0.mcap}"


@pytest.mark.parametrize("text", ["", "rosbag2_bagfile_information: [", "a: 1", "\0", _BUT_A_TEXT])
def test_metadata_that_cannot_be_read_are_done_without(tmp_path, text, caplog):
    path = tmp_path / "bag"
    write_split(path)
    (path / "metadata.yaml").write_text(text)
    assert read(path) == (list(range(60)), [])
    assert "metadata.yaml that cannot be read" in caplog.text


@pytest.mark.parametrize("listed", [True, False])
def test_compressed_files_are_read_also_where_they_are_cut(tmp_path, listed):
    path = tmp_path / "bag"
    about = write_split(path, files=2, each=200)
    for name in about["relative_file_paths"]:
        file = path / name
        packed = zstd.compress(file.read_bytes())
        file.with_name(name + ".zstd").write_bytes(packed)
        file.unlink()
    assert read(path) == (list(range(400)), [])
    if not listed:
        (path / "metadata.yaml").unlink()
        assert read(path) == (list(range(400)), [])
    file = path / "bag_1.mcap.zstd"
    packed = file.read_bytes()
    for damaged in (packed[:-50], packed[:-200] + bytes(200)):
        file.write_bytes(damaged)
        numbers, losses = read(path)
        assert numbers[:200] == list(range(200))
        assert numbers == list(range(len(numbers)))
        assert len(losses) == 1


def test_the_program_zstd_may_have_compressed_a_file(tmp_path):
    path = tmp_path / "bag"
    write_split(path, files=2)
    for file in bag_files(path):
        file.with_name(f"{file.name}.zst").write_bytes(zstd.compress(file.read_bytes()))
        file.unlink()
    assert read(path) == (list(range(40)), [])
    (path / "metadata.yaml").unlink()
    assert is_unfinished_bag(path)
    assert read(path) == (list(range(40)), [])
    assert bag_name(path / "bag_1.mcap.zst") == "bag_1"


def test_a_file_that_lies_beside_its_compressed_copy_is_read_once(tmp_path):
    path = tmp_path / "bag"
    write_split(path, files=2)
    (path / "metadata.yaml").unlink()
    (path / "bag_0.mcap.zst").write_bytes(zstd.compress((path / "bag_0.mcap").read_bytes()))
    (path / "bag_1.mcap.zstd").write_bytes(b"\x28\xb5\x2f\xfd")  # its compression was stopped
    assert read(path) == (list(range(40)), [])


def test_a_compressed_file_that_is_cut_at_its_beginning_is_not_called_empty(tmp_path):
    path = tmp_path / "bag.mcap.zstd"
    path.write_bytes(zstd.compress(b"\x89MCAP0\r\n" + bytes(range(256)))[:40])
    with pytest.raises(
        RecordingError,
        match=r"bag\.mcap\.zstd cannot be read .*: it is compressed by Zstandard, and cut off or "
        r"damaged before anything of it can be decompressed$",
    ):
        StoredBag(path)


def test_compressed_messages_are_read_without_metadata(tmp_path):
    path = tmp_path / "bag.mcap"
    with library_writer(path) as (writer, schema):
        channel = writer.register_channel("/x", "cdr", schema)
        for count in range(5):
            writer.add_message(channel, count, zstd.compress(data_of(count)), count)
    assert read(path) == (list(range(5)), [])


@pytest.mark.parametrize(
    "broken", [zstd.compress(data_of(2))[:-3], b"\x28\xb5\x2f\xfdnothing", "bomb"]
)
def test_a_compressed_message_that_is_damaged_is_a_loss_of_one(tmp_path, monkeypatch, broken):
    if broken == "bomb":
        monkeypatch.setattr(stored_bag, "LARGEST_MESSAGE", 1000)
        broken = zstd.compress(bytes(1001))
    path = tmp_path / "bag.mcap"
    with library_writer(path) as (writer, schema):
        channel = writer.register_channel("/x", "cdr", schema)
        for count in range(5):
            data = broken if count == 2 else zstd.compress(data_of(count))
            writer.add_message(channel, count * STEP_NS, data, 0)
    with StoredBag(path) as bag:
        for _ in range(2):  # read again, it is the same loss
            assert [number(data) for _, _, data in bag.messages()] == [0, 1, 3, 4]
        (loss,) = bag.losses()
    assert (loss.read, loss.messages) == (4, 1)
    assert "has messages that cannot be decompressed" in loss.sentence()


def test_a_file_that_the_metadata_name_twice_is_read_once(tmp_path):
    path = tmp_path / "bag"
    write_split(path, files=1, each=5)
    about = yaml.safe_load((path / "metadata.yaml").read_text())
    about["rosbag2_bagfile_information"]["relative_file_paths"] *= 2
    (path / "metadata.yaml").write_text(yaml.safe_dump(about))
    assert read(path)[0] == list(range(5))


def test_a_file_of_which_nothing_is_read_is_refused_in_a_sentence(tmp_path):
    path = tmp_path / "bag.mcap"
    with library_writer(path) as (writer, schema):
        writer.add_message(writer.register_channel("/x", "cdr", schema), 0, data_of(1), 0)
    content = path.read_bytes()
    path.write_bytes(content[: content.index(b"zstd") + 20])
    with pytest.raises(RecordingError, match=r"\.bag\): it is cut off, as when power is lost$"):
        StoredBag(path)


def test_splits_that_overlap_are_read_in_time(tmp_path):
    path = tmp_path / "bag"
    write_split(path, files=2, each=5)
    (path / "metadata.yaml").unlink()
    first, second = bag_files(path)
    first.rename(path / "other")
    second.rename(first)
    (path / "other").rename(second)
    assert read(path)[0] == list(range(10))


def test_topics_with_several_channels_have_one_connection(tmp_path):
    path = tmp_path / "bag.mcap"
    with library_writer(path) as (writer, schema):
        odd = writer.register_schema("pkg.Odd", "jsonschema", b"{}")
        channels = [
            writer.register_channel("/x", "cdr", schema, {"offered_qos_profiles": profile})
            for profile in ("", "- depth: not a profile")
        ]
        writer.register_channel("/json", "json", odd)
        for count in range(6):
            writer.add_message(channels[count % 2], count, data_of(count), count)
    with StoredBag(path) as bag:
        about = [(c.topic, c.msgtype, c.ext.serialization_format) for c in bag.connections]
        assert about == [("/x", "std_msgs/msg/String", "cdr"), ("/json", "pkg.Odd", "json")]
        assert bag.connections[0].msgcount == 6
        found = [number(data) for _, _, data in bag.messages(bag.connections[:1])]
    assert found == list(range(6))


def test_folders_that_are_no_bag_are_refused_with_a_sentence(tmp_path):
    with pytest.raises(RecordingError, match="no file of a bag"):
        StoredBag(tmp_path)
    for name in ("one.mcap", "two.mcap"):
        (tmp_path / name).write_bytes(b"")
    assert not is_unfinished_bag(tmp_path)
    with pytest.raises(RecordingError, match="holds the bags one, two, expected one of them"):
        StoredBag(tmp_path)
    folder = tmp_path / "bag"
    write_split(folder)
    for file in bag_files(folder):
        file.write_bytes(b"version https://git-lfs.github.com/spec/v1\noid sha256:0\n")
    with pytest.raises(RecordingError, match=r"bag_0\.mcap .*: it is a pointer of Git LFS"):
        StoredBag(folder)
    for file in bag_files(folder):
        file.write_bytes(b"")
    with pytest.raises(
        RecordingError, match=r"bag_0.mcap cannot be read as a bag .*: it is empty"
    ):
        StoredBag(folder)


def test_a_killed_recorders_default_name_makes_a_bag(tmp_path):
    write_split(tmp_path / "rosbag2_2026_01_01-10_00_00", files=1)
    moved = (tmp_path / "rosbag2_2026_01_01-10_00_00").rename(tmp_path / "morning")
    (moved / "metadata.yaml").unlink()
    assert is_unfinished_bag(moved)
    assert read(moved)[0] == list(range(20))


@pytest.mark.parametrize("storage", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_files_that_were_renamed_are_read_in_place_of_those_that_the_metadata_name(
    tmp_path, storage, caplog
):
    path = tmp_path / "bag"
    write_split(path, files=2, each=5, storage=storage)
    for number, file in enumerate(bag_files(path)):
        file.rename(path / f"monday_{number}{file.suffix}")
    assert read(path) == (list(range(10)), [])
    assert "of which there is none: monday_0" in caplog.text


def test_hidden_files_are_no_part_of_a_bag(tmp_path):
    path = tmp_path / "bag"
    write_split(path, files=2, each=5)
    (path / "metadata.yaml").unlink()
    for file in bag_files(path):
        (path / f"._{file.name}").write_bytes(b"\0\5\x16\7Mac OS X")
    assert read(path) == (list(range(10)), [])


def test_a_topic_has_its_slash_if_recorded_without(tmp_path):
    path = tmp_path / "bag.mcap"
    with library_writer(path) as (writer, schema):
        for topic in ("x", "/x"):
            channel = writer.register_channel(topic, "cdr", schema)
            writer.add_message(channel, len(topic), data_of(len(topic)), 0)
    with StoredBag(path) as bag:
        assert [(c.topic, c.msgcount) for c in bag.connections] == [("/x", 2)]
    assert read(path)[0] == [1, 2]


def test_names_in_capitals_are_those_of_bags(tmp_path, caplog):
    write_split(tmp_path / "drive")
    for path in (tmp_path / "drive").glob("*.mcap"):
        path.rename(path.with_name(path.name.upper()))
    with StoredBag(tmp_path / "drive") as bag:
        assert len(list(bag.messages())) == 60
    assert not caplog.records
    (tmp_path / "drive" / "metadata.yaml").unlink()
    (tmp_path / "drive").rename(tmp_path / "DRIVE")
    assert is_unfinished_bag(tmp_path / "DRIVE")
    first = bag_files(tmp_path / "DRIVE")[0]
    packed = tmp_path / "X.MCAP.ZSTD"
    packed.write_bytes(zstd.compress(first.read_bytes()))
    assert is_bag(packed)
    assert bag_name(packed) == "X"
    with StoredBag(packed) as bag:
        assert len(list(bag.messages())) == 20


def topic_entry(name, count, kind="std_msgs/msg/String"):
    about = {"name": name, "type": kind, "serialization_format": "cdr", "offered_qos_profiles": ""}
    return {"topic_metadata": about, "message_count": count}


def write_short(path, stated, **options):
    """A split bag of 60 messages on /x whose metadata count other numbers by topic."""
    about = write_split(path, **options)
    about["topics_with_message_count"] = [topic_entry(*item) for item in stated.items()]
    write_metadata(path, about)
    return about


@pytest.mark.parametrize("storage", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_messages_that_the_metadata_count_besides_are_told_once(tmp_path, storage, caplog):
    path = tmp_path / "bag"
    write_short(path, {"/x": 75}, storage=storage)
    for _ in range(2):
        assert read(path) == (list(range(60)), [])
    (record,) = caplog.records
    assert record.getMessage() == (
        f"{path}, topic /x: 15 messages of the 75 that metadata.yaml counts are missing, as when"
        " a recorder is killed or a copy ends early"
    )


@pytest.mark.parametrize("stated", [{"/x": 60}, {"/x": 0}, {"/x": 12}, {}, {"/x": None}], ids=str)
def test_metadata_that_count_no_more_than_there_are_say_nothing(tmp_path, stated, caplog):
    path = tmp_path / "bag"
    write_short(path, stated)
    assert read(path) == (list(range(60)), [])
    assert not caplog.records


def test_what_a_topic_lacks_is_told_when_it_is_read(tmp_path, caplog):
    """Another topic that was recorded in part does not matter to who does not read it."""
    path = tmp_path / "bag"
    path.mkdir()
    with library_writer(path / "bag_0.mcap") as (writer, schema):
        for topic in ("/x", "/y"):
            channel = writer.register_channel(topic, "cdr", schema)
            for count in range(10):
                writer.add_message(channel, count * STEP_NS, data_of(count), 0)
    stated = [topic_entry("/x", 10), topic_entry("/y", 14)]
    names = {"relative_file_paths": ["bag_0.mcap"], "topics_with_message_count": stated}
    write_metadata(path, names)
    with StoredBag(path) as bag:
        x, y = bag.connections
        assert len(list(bag.messages([x]))) == 10
        assert not caplog.records
        assert len(list(bag.messages([y]))) == 10
    assert f"{path}, topic /y: 4 messages of the 14" in caplog.text


def test_a_topic_of_which_nothing_is_there_is_told_at_once(tmp_path, caplog):
    path = tmp_path / "bag"
    write_short(path, {"/x": 60, "/lost": 8})
    StoredBag(path).close()
    assert f"{path}, topic /lost: 8 messages of the 8" in caplog.text


def test_files_whose_loss_is_told_explain_what_a_topic_lacks(tmp_path, caplog):
    path = tmp_path / "bag"
    write_short(path, {"/x": 60})
    (path / "bag_1.mcap").unlink()
    numbers, (sentence,) = read(path)
    assert numbers == [*range(20), *range(40, 60)]
    assert "20 messages" in sentence
    assert [record.getMessage() for record in caplog.records] == [sentence]


def test_more_than_the_files_whose_loss_is_told_is_told_as_well(tmp_path, caplog):
    path = tmp_path / "bag"
    write_short(path, {"/x": 90})
    (path / "bag_1.mcap").unlink()
    read(path)
    assert f"{path}, topic /x: 50 messages of the 90" in caplog.text


def test_metadata_that_count_the_messages_of_no_topic_are_compared_by_file(tmp_path, caplog):
    path = tmp_path / "bag"
    about = write_short(path, {})
    about["files"][1]["message_count"] = 25
    write_metadata(path, about)
    assert read(path)[0] == list(range(60))
    assert (
        f"{path / 'bag_1.mcap'} has fewer messages than metadata.yaml counts: 20 messages (1.9 s)"
        " read, 5 messages"
    ) in caplog.text


def test_a_file_that_was_copied_as_text_is_called_so(tmp_path):
    path = tmp_path / "a.mcap"
    with library_writer(path):
        pass
    path.write_bytes(path.read_bytes().replace(b"\r\n", b"\n"))
    with pytest.raises(RecordingError, match="an MCAP file whose line ends were changed"):
        StoredBag(path)


def test_the_time_of_a_loss_is_that_of_what_is_missing(tmp_path, caplog):
    """A whole file takes all of its time, single messages between others none."""
    path = tmp_path / "bag"
    write_metadata(path, write_split(path, storage=StoragePlugin.SQLITE3))
    for name, change in (
        ("bag_0.db3", "UPDATE messages SET data='text' WHERE id=7"),
        ("bag_1.db3", "DELETE FROM topics"),
    ):
        with contextlib.closing(sqlite3.connect(path / name)) as database:
            database.execute(change)
            database.commit()
    assert len(read(path)[0]) == 39
    said = [record.getMessage() for record in caplog.records]
    assert any(text.endswith("19 messages (1.9 s) read, 1 message lost") for text in said)
    assert any(text.endswith("nothing of it is read, 20 messages (1.9 s) lost") for text in said)
