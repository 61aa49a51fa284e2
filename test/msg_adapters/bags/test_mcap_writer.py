# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Bags are written whole or not at all, with the QoS that rosbag2 writes."""

import pytest
import yaml
from rosbags.interfaces import QosDurability, QosReliability

from msg_adapters.bags.bag_reader import BagReader, DecodingBagReader
from msg_adapters.bags.mcap_writer import INFINITE, McapWriter
from mtpgo_core.errors import RecordingError

FLOAT = b"\x00\x01\x00\x00" + bytes(8)


def write_text(path, text="3", **options):
    with McapWriter(path, **options) as bag:
        bag.add_topic("/ego_id", "std_msgs/msg/String", latched=True, depth=1)
        bag.write("/ego_id", 7, bag.types.make("std_msgs/msg/String", data=text))
    return bag


def texts(path):
    with DecodingBagReader(path) as bag:
        return [message.data for _, _, message in bag.messages(bag.connections)]


def test_infinite_durations_are_those_of_rosbag2(tmp_path):
    write_text(tmp_path / "bag")
    about = yaml.safe_load((tmp_path / "bag" / "metadata.yaml").read_text())
    (topic,) = about["rosbag2_bagfile_information"]["topics_with_message_count"]
    (profile,) = topic["topic_metadata"]["offered_qos_profiles"]
    # RMW_DURATION_INFINITE, as rclpy gives it for a publisher without a deadline.
    infinite = {"sec": 9223372036, "nsec": 854775807}
    assert INFINITE.sec * 10**9 + INFINITE.nsec == 2**63 - 1
    for name in ("deadline", "lifespan", "liveliness_lease_duration"):
        assert profile[name] == infinite, name
    assert (profile["depth"], profile["durability"]) == (1, "transient_local")


def test_the_offered_qos_is_stored(tmp_path):
    with McapWriter(tmp_path / "bag.mcap") as bag:
        bag.add_topic("/x", "std_msgs/msg/Float64", latched=False, reliable=False)
        bag.write_bytes("/x", 1, FLOAT)
        assert bag.has_topic("/x")
        assert not bag.has_topic("/y")
    with BagReader(tmp_path / "bag.mcap") as stored:
        (connection,) = stored.connections
        (profile,) = connection.ext.offered_qos_profiles
    assert profile.reliability is QosReliability.BEST_EFFORT
    assert profile.durability is QosDurability.VOLATILE
    assert (profile.depth, profile.deadline) == (10, INFINITE)


def test_a_topic_that_gets_its_first_type_again_goes_on(tmp_path):
    with McapWriter(tmp_path / "bag.mcap") as bag:
        for time_ns, kind in enumerate(("Float64", "Int64", "Float64")):
            bag.add_topic("/x", f"std_msgs/msg/{kind}")
            assert bag.type_of("/x") == f"std_msgs/msg/{kind}"
            bag.write_bytes("/x", time_ns, FLOAT)
    with BagReader(tmp_path / "bag.mcap") as stored:
        found = {c.msgtype: c.msgcount for c in stored.connections}
    assert found == {"std_msgs/msg/Float64": 2, "std_msgs/msg/Int64": 1}


@pytest.mark.parametrize("name", ["bag", "bag.mcap"])
def test_an_earlier_bag_is_replaced_only_where_asked_for(tmp_path, name):
    path = tmp_path / name
    assert write_text(path, "first").messages == 1
    with pytest.raises(RecordingError, match="exists already"):
        McapWriter(path)
    write_text(path, "second", replace=True, compress=True)
    assert texts(path) == ["second"]
    with pytest.raises(KeyError), McapWriter(path, replace=True) as bag:
        bag.write_bytes("/a topic that was not added", 1, FLOAT)
    assert texts(path) == ["second"]
    assert [entry.name for entry in tmp_path.iterdir()] == [name]


def test_a_path_that_was_taken_meanwhile_is_left_alone(tmp_path):
    path = tmp_path / "bag"
    bag = McapWriter(path)
    path.mkdir()
    (path / "notes.txt").write_text("mine")
    with pytest.raises(RecordingError, match="cannot be written"):
        bag.close()
    assert [entry.name for entry in tmp_path.rglob("*")] == ["bag", "notes.txt"]


def test_an_abandoned_bag_leaves_nothing(tmp_path):
    bag = McapWriter(tmp_path / "bag")
    bag.add_topic("/x", "std_msgs/msg/Float64", latched=False, reliable=True)
    bag.write_bytes("/x", 1, b"\x00\x01\x00\x00" + bytes(8))
    bag.discard()
    assert not list(tmp_path.iterdir())


def test_a_type_without_a_definition_is_named(tmp_path):
    bag = McapWriter(tmp_path / "bag")
    with pytest.raises(RecordingError, match="no_msgs/msg/Nothing"):
        bag.add_topic("/x", "no_msgs/msg/Nothing", latched=False, reliable=True)
    # A message package that is installed is looked up with its definition files, where it has
    # them; every type of the common interfaces is known anyway.
    bag.add_topic("/y", "autoware_perception_msgs/msg/TrackedObjects", latched=True, reliable=True)
    bag.discard()


def test_a_name_in_capitals_is_one_file(tmp_path):
    write_text(tmp_path / "OUT.MCAP")
    assert texts(tmp_path / "OUT.MCAP") == ["3"]
    write_text(tmp_path / "OUT.MCAP", "4", replace=True)
    assert (tmp_path / "OUT.MCAP").is_file()
    assert texts(tmp_path / "OUT.MCAP") == ["4"]
