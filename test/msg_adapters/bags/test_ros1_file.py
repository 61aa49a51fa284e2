# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Bags of ROS 1 that were not closed or are cut off, of every compression."""

import pytest
from rosbags.rosbag1 import ReaderError, Writer
from rosbags.typesys import Stores, get_typestore

from msg_adapters.bags import stored_bag
from msg_adapters.bags.bag_reader import DecodingBagReader, is_bag, is_latched
from msg_adapters.bags.ros1_file import Ros1File, UnindexedRos1File, open_ros1
from mtpgo_core.errors import RecordingError

STORE = get_typestore(Stores.ROS1_NOETIC)
TEXT = "std_msgs/msg/String"
S_NS = 10**9
COMPRESSIONS = [None, Writer.CompressionFormat.BZ2, Writer.CompressionFormat.LZ4]


@pytest.fixture(autouse=True)
def _say_everything_again(monkeypatch):
    monkeypatch.setattr(stored_bag, "_told", set())


def text(words):
    return bytes(STORE.serialize_ros1(STORE.types[TEXT](data=words), TEXT))


@pytest.fixture(params=COMPRESSIONS, ids=["plain", "bz2", "lz4"])
def content(request, tmp_path):
    """A bag of 300 messages in chunks of some 20, and a latched one, as bytes."""
    writer = Writer(tmp_path / "whole.bag")
    if request.param is not None:
        writer.set_compression(request.param)
    writer.chunk_threshold = 20_000
    with writer:
        latched = writer.add_connection("/kind", TEXT, typestore=STORE, latching=1)
        spoken = writer.add_connection("said", TEXT, typestore=STORE)
        writer.write(latched, 0, text("kind"))
        for number in range(300):
            words = f"{number} " + "".join(chr(97 + (k * number) % 26) for k in range(900))
            writer.write(spoken, number * S_NS // 10, text(words))
    return (tmp_path / "whole.bag").read_bytes()


def numbers(path):
    with DecodingBagReader(path) as bag:
        latched = {connection.topic for connection in bag.connections if is_latched(connection)}
        assert latched == {"/kind"}
        said = [connection for connection in bag.connections if connection.topic == "/said"]
        return [int(message.data.split()[0]) for _, _, message in bag.messages(said)]


def test_a_bag_that_is_cut_off_is_read_up_to_there(content, tmp_path, caplog):
    path = tmp_path / "cut.bag"
    counts = []
    for part in (0.3, 0.6, 0.9):
        zeros = bytes(100_000 if part == 0.6 else 0)
        path.write_bytes(content[: round(len(content) * part)] + zeros)
        found = numbers(path)
        assert found == list(range(len(found)))
        counts.append(len(found))
    assert 0 < counts[0] < counts[1] < counts[2] < 300
    assert f"{path} is cut off, as when power is lost: {counts[0] + 1} messages (" in caplog.text


def test_a_bag_whose_recorder_was_killed_has_no_index(content, tmp_path, caplog):
    path = tmp_path / "drive.bag.active"
    _, _, after = content.partition(b"index_pos=")
    path.write_bytes(content[: int.from_bytes(after[:8], "little")])
    assert is_bag(path)
    assert numbers(path) == list(range(300))
    assert f"{path} has no index, as when its recorder is killed: 301 messages" in caplog.text
    assert "no message of what was written is lost" in caplog.text
    (path := tmp_path / "whole.bag").write_bytes(content)
    with_index = open_ros1(path)
    assert isinstance(with_index, Ros1File)
    with_index.close()


def test_a_damaged_chunk_of_a_bag_without_an_index_is_told(content, tmp_path, caplog):
    path = tmp_path / "drive.bag.active"
    _, _, after = content.partition(b"index_pos=")
    whole = bytearray(content[: int.from_bytes(after[:8], "little")])
    place = whole.index(b"compression=", len(whole) // 2) + 100
    length = 1100 if b"compression=none" in content else 200  # more than a text, less than a chunk
    whole[place : place + length] = bytes(length)
    path.write_bytes(whole)
    found = numbers(path)
    assert 200 < len(found) < 300
    assert "has no index, as when its recorder is killed, and is damaged in its chunks" in (
        caplog.text
    )
    assert "no message of what was written is lost" not in caplog.text


def test_messages_without_a_topic_in_a_bag_without_an_index_are_counted(tmp_path, caplog):
    writer = Writer(tmp_path / "whole.bag")
    with writer:
        spoken = writer.add_connection("said", TEXT, typestore=STORE)
        for number in range(4):
            writer.write(spoken, number * S_NS, text(f"{number}"))
    content = (tmp_path / "whole.bag").read_bytes()
    _, _, after = content.partition(b"index_pos=")
    whole = bytearray(content[: int.from_bytes(after[:8], "little")])
    place = whole.rindex(b"conn=", 0, whole.rindex(b"3", 0, -40)) + 5
    whole[place] = 9
    (path := tmp_path / "drive.bag.active").write_bytes(whole)
    with DecodingBagReader(path) as bag:
        (said,) = bag.connections
        assert said.msgcount == 3
    assert "has messages of topics that it does not describe: 3 messages" in caplog.text
    assert "1 message lost" in caplog.text


def test_part_of_the_time_and_of_the_topics(content, tmp_path):
    (path := tmp_path / "cut.bag").write_bytes(content[: len(content) // 2])
    file = UnindexedRos1File(path)
    (said,) = [number for number, one in file.connections.items() if one.topic == "said"]
    found = [time_ns for time_ns, _, _ in file.messages([said], 3 * S_NS, 4 * S_NS)]
    file.close()
    assert found == [3 * S_NS + k * S_NS // 10 for k in range(10)]
    assert (file.start_ns, file.loss().messages) == (0, None)


@pytest.mark.parametrize("data", [b"", b"\xff" * 400, b"\x04\0\0\0op=\x05\xff\xff\xff\x7f"])
def test_without_a_message_there_is_an_error(tmp_path, data):
    (path := tmp_path / "a.bag").write_bytes(b"#ROSBAG V2.0\n" + data)
    with pytest.raises(ReaderError):
        open_ros1(path)
    with pytest.raises(RecordingError, match=r"a\.bag cannot be read as a bag .*ROS 1"):
        numbers(path)


def test_bytes_behind_the_index_are_said_to_be_left_out(content, tmp_path, caplog):
    path = tmp_path / "joined.bag"
    path.write_bytes(content + content)
    assert numbers(path) == list(range(300))
    assert " bytes behind its end that are not part of it: 301 messages" in caplog.text
    assert "how much is lost is not known" in caplog.text
    caplog.clear()
    path.write_bytes(content + bytes(4096))  # of a file system
    assert numbers(path) == list(range(300))
    assert not caplog.text
