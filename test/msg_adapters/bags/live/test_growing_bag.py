# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Messages come out of a bag while it is written, each once."""

import pytest

from msg_adapters.bags.bag_types import bag_typestore
from msg_adapters.bags.live.growing_bag import GrowingBag
from msg_adapters.bags.live.live_bag_writer import LiveBagWriter
from mtpgo_core.errors import RecordingError

STRING = "std_msgs/msg/String"


def put(bag, *texts):
    store = bag_typestore()
    kind = store.types[STRING]
    for number, text in enumerate(texts):
        bag.write_bytes("/x", number, store.serialize_cdr(kind(data=text), STRING))
    bag.flush()


def came(growing):
    return [(one.topic, one.message_type, one.message.data) for one in growing.new_messages()]


def test_each_message_comes_once_when_its_chunk_is_complete(tmp_path):
    path = tmp_path / "live.mcap"
    growing = GrowingBag(path)
    assert came(growing) == []
    with LiveBagWriter(path) as bag:
        bag.add_topic("/x", STRING)
        put(bag, "a", "b")
        assert came(growing) == [("/x", STRING, "a"), ("/x", STRING, "b")]
        assert came(growing) == []
        put(bag, "c")
        assert came(growing) == [("/x", STRING, "c")]
        bag.close()
    assert came(growing) == []


def test_a_chunk_that_is_not_complete_is_waited_for(tmp_path):
    path, part = tmp_path / "live.mcap", tmp_path / "part.mcap"
    with LiveBagWriter(path) as bag:
        bag.add_topic("/x", STRING)
        put(bag, "a")
        data = path.read_bytes()
        bag.close()
    growing = GrowingBag(part)
    seen = []
    for size in range(0, len(data) + 1, 7):
        part.write_bytes(data[:size])
        seen += came(growing)
    part.write_bytes(data)
    assert [text for _, _, text in seen + came(growing)] == ["a"]


def test_a_damaged_file_is_an_error(tmp_path):
    path = tmp_path / "live.mcap"
    path.write_bytes(b"\x89MCAP0\r\n" + b"\x77" + bytes(30))
    with pytest.raises(RecordingError, match="is damaged"):
        list(GrowingBag(path).new_messages())
