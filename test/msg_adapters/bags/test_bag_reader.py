# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Bags of both storages, whole and damaged, as bytes and as messages."""

import numpy as np
import pytest
from mcap.writer import Writer as McapLibraryWriter
from rosbags.rosbag2 import StoragePlugin, Writer

from msg_adapters.bags.bag_reader import (
    BagReader,
    DecodingBagReader,
    bag_name,
    is_bag,
    is_or_begins_as_bag,
)
from msg_adapters.bags.bag_types import bag_typestore
from msg_adapters.bags.mcap_writer import McapWriter, _qos
from msg_adapters.registry import INPUTS
from msg_adapters.types import TypestoreTypes
from mtpgo_core.errors import RecordingError
from mtpgo_core.identity import keys_from_integers
from mtpgo_core.schema import tracked_states

START_NS = 1_700_000_000_000_000_000


def states_at(time_s):
    position = np.stack([12.0 * np.arange(4) + 10.0 * time_s, np.zeros(4)], axis=1)
    stamp_ns = START_NS + round(time_s * 1e9)
    return tracked_states(stamp_ns, "map", keys_from_integers(range(1, 5)), position)


def write_bag(path, *, seconds=1.0, storage=StoragePlugin.MCAP):
    """25 Hz of four cars on /objects, and a latched ego."""
    store = bag_typestore()
    types = TypestoreTypes(store)
    adapter = INPUTS["pointcloud2"]
    with Writer(path, version=9, storage_plugin=storage) as writer:

        def topic(name, message_type, latched):
            profiles = [_qos(latched=latched, reliable=True, depth=10)]
            return writer.add_connection(
                name, message_type, typestore=store, offered_qos_profiles=profiles
            )

        ego = topic("/ego_id", "std_msgs/msg/String", True)
        objects = topic("/objects", adapter.message_type, False)
        string = types.make("std_msgs/msg/String", data="3")
        writer.write(ego, START_NS, store.serialize_cdr(string, ego.msgtype))
        for step in range(round(25 * seconds) + 1):
            states = states_at(step / 25)
            data = store.serialize_cdr(adapter.from_states(states, types), objects.msgtype)
            writer.write(objects, states.stamp_ns, data)
    return path


@pytest.mark.parametrize("storage", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
@pytest.mark.parametrize("single", [False, True], ids=["folder", "file"])
def test_bags_of_both_storages_are_read_as_folder_and_as_file(tmp_path, storage, single):
    path = write_bag(tmp_path / "bag", seconds=0.2, storage=storage)
    if single:
        path = next(file for file in path.iterdir() if file.suffix in (".mcap", ".db3"))
    with BagReader(path) as source:
        assert {(t.name, t.count, t.latched) for t in source.topics()} == {
            ("/ego_id", 1, True),
            ("/objects", 6, False),
        }
        assert (source.start_ns, source.end_ns) == (START_NS, START_NS + 200_000_000)
        topics = source.topics(["objects"])
        found = list(source.raw_messages(topics, START_NS + 80_000_000, source.end_ns + 1))
    assert [time_ns - START_NS for _, time_ns, _ in found] == [
        80_000_000,
        120_000_000,
        160_000_000,
        200_000_000,
    ]


@pytest.mark.parametrize("storage", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_messages_are_decoded_in_order_of_time(tmp_path, storage):
    path = write_bag(tmp_path / "bag", seconds=0.2, storage=storage)
    assert is_bag(path)
    with DecodingBagReader(path) as bag:
        found = list(bag.messages(bag.connections))
        (objects,) = [c for c in bag.connections if c.topic == "/objects"]
        assert len(list(bag.messages([objects]))) == 6
    assert [c.topic for c, _, _ in found] == ["/ego_id"] + 6 * ["/objects"]
    assert [time_ns - START_NS for _, time_ns, _ in found] == [
        0,
        *range(0, 200_000_001, 40_000_000),
    ]
    assert found[0][-1].data == "3"
    states = INPUTS["pointcloud2"].to_states(found[-1][-1])
    np.testing.assert_array_equal(states.position, states_at(0.2).position)


@pytest.mark.parametrize("storage", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
@pytest.mark.parametrize("name", ["drive", "drive.mcap.bak", "drive.sqlite", "drive.db3.part"])
def test_a_file_that_is_chosen_is_a_bag_by_what_it_holds(tmp_path, storage, name):
    folder = write_bag(tmp_path / "bag", seconds=0.2, storage=storage)
    path = next(f for f in folder.iterdir() if f.suffix != ".yaml").rename(tmp_path / name)
    assert is_or_begins_as_bag(path)
    assert not is_bag(path)  # in a folder a name tells
    assert bag_name(path) == name
    (tmp_path / "text").write_text("no bag")
    assert not is_or_begins_as_bag(tmp_path / "text")


def test_a_link_to_a_bag_has_its_own_name(tmp_path):
    folder = write_bag(tmp_path / "bag", seconds=0.2)
    stored = (folder / "bag.mcap").rename(tmp_path / "SHA256E-s9--5f70")
    (tmp_path / "drive.mcap").symlink_to(stored)
    assert bag_name(tmp_path / "drive.mcap") == "drive"
    assert bag_name(tmp_path / "bag" / "..") == tmp_path.name


def _nothing(tmp_path):
    return tmp_path / "nothing"


def _broken(tmp_path):
    path = write_bag(tmp_path / "bag", seconds=0.2)
    file = path / "bag.mcap"
    file.write_bytes(file.read_bytes()[:12])
    return path


def _damaged(tmp_path):
    path = write_bag(tmp_path / "bag", seconds=2.0)
    file = path / "bag.mcap"
    data = bytearray(file.read_bytes())
    middle = len(data) // 2
    data[middle - 2000 : middle] = b"\xff" * 2000
    file.write_bytes(data)
    return path


def _empty(tmp_path):
    Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP).open()
    with Writer(tmp_path / "empty", version=9, storage_plugin=StoragePlugin.MCAP):
        pass
    return tmp_path / "empty"


def _text(tmp_path):
    path = tmp_path / "tracks.csv"
    path.write_text("frame,id\n")
    return path


@pytest.mark.parametrize("make", [_nothing, _broken, _empty, _text])
def test_a_bag_that_cannot_be_read_is_named(tmp_path, make):
    path = make(tmp_path)
    with pytest.raises(RecordingError) as caught, BagReader(path) as source:
        source.topics()
    assert str(path) in str(caught.value)


def test_the_messages_before_a_damage_are_read(tmp_path):
    with BagReader(_damaged(tmp_path)) as source:
        read = list(source.raw_messages(source.topics(), 0, 2**62))
    assert [time_ns for _, time_ns, _ in read] == [
        START_NS,
        *(START_NS + 40_000_000 * k for k in range(25)),
    ]


@pytest.mark.parametrize("make", [_nothing, _broken, _text])
def test_a_bag_that_cannot_be_decoded_is_named(tmp_path, make):
    path = make(tmp_path)
    with pytest.raises(RecordingError) as caught, DecodingBagReader(path):
        pass
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_messages_before_a_damage_are_decoded(tmp_path):
    with DecodingBagReader(_damaged(tmp_path)) as bag:
        assert len(list(bag.messages(bag.connections))) == 26


def test_messages_that_cannot_be_decoded_are_left_out_and_named(tmp_path, caplog):
    path, good = tmp_path / "bag.mcap", b"\0\1\0\0\2\0\0\x003\0"
    with McapWriter(path) as bag:
        bag.add_topic("/talk", "std_msgs/msg/String")
        for number, data in enumerate([good, good[:9], b"", good]):
            bag.write_bytes("/talk", number, data)
    with DecodingBagReader(path) as bag:
        found = [(time_ns, message.data) for _, time_ns, message in bag.messages(bag.connections)]
        assert found == [(0, "3"), (3, "3")]
        assert f"{path}, topic /talk: 2 messages left out, the first because it" in caplog.text
        told = []
        noted = bag.messages(
            bag.connections, lambda connection, why: told.append((connection, why))
        )
        assert [time_ns for _, time_ns, _ in noted] == [0, 3]
    assert [connection.topic for connection, _ in told] == ["/talk", "/talk"]
    assert all(why.startswith("it cannot be decoded as std_msgs/msg/String: ") for _, why in told)
    assert len(caplog.records) == 1


def test_transforms_of_any_namespace_are_latched_without_a_qos(tmp_path):
    with (tmp_path / "a.mcap").open("wb") as stream:
        writer = McapLibraryWriter(stream)
        writer.start(profile="ros2", library="test")
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        for name in ("/tf_static", "/r1/tf_static", "/r1/tf"):
            writer.add_message(writer.register_channel(name, "cdr", schema), 1, b"\0\1\0\0", 1)
        writer.finish()
    with BagReader(tmp_path / "a.mcap") as bag:
        latched = {topic.name: topic.latched for topic in bag.topics()}
    assert latched == {"/tf_static": True, "/r1/tf_static": True, "/r1/tf": False}
