# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Messages are decoded by the definition of their own type, in every form that bags have it."""

import sqlite3

import pytest
from mcap.writer import Writer
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Ros2Writer
from rosbags.typesys import Stores, get_typestore

from msg_adapters.bags import bag_definitions
from msg_adapters.bags.bag_definitions import BagDefinitions
from msg_adapters.bags.bag_reader import BagReader, DecodingBagReader
from msg_adapters.bags.bag_types import bag_typestore, earlier_typestore
from msg_adapters.types import TypestoreTypes
from mtpgo_core.errors import RecordingError

STATUS = "vendor_msgs/msg/Status"
TEXT = "std_msgs/msg/String"
HELLO = bytes(
    bag_typestore().serialize_cdr(TypestoreTypes(bag_typestore()).make(TEXT, data="hello"), TEXT)
)
LEVEL = b"\x00\x01\x00\x00\x07"
SEPARATOR = "=" * 80 + "\n"


def write(path, *channels, profile="ros2"):
    """Write an MCAP file of (topic, type, language, definition, encoding, data)."""
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile=profile, library="test")
        for topic, kind, language, text, encoding, data in channels:
            schema = 0
            if kind:
                text = text.encode() if isinstance(text, str) else text
                schema = writer.register_schema(kind, language, text)
            channel = writer.register_channel(topic, encoding, schema)
            writer.add_message(channel, 5, data, 5)
        writer.finish()
    return path


TALK = ("/talk", TEXT, "ros2msg", "string data", "cdr", HELLO)


def test_messages_of_another_encoding_on_a_topic_are_left_out_and_counted(tmp_path):
    other = ("/talk", TEXT, "jsonschema", "{}", "json", b"{}")
    with BagReader(write(tmp_path / "bag.mcap", other, TALK)) as bag:
        assert [(topic.name, topic.count) for topic in bag.topics()] == [("/talk", 1)]
        assert bag.skipped() == {"/talk": "its 1 messages in 'json' are left out"}


@pytest.mark.parametrize("json_first", [True, False])
def test_what_is_not_decoded_of_a_topic_is_told_whichever_comes_first(tmp_path, json_first):
    other = ("/talk", TEXT, "jsonschema", "{}", "json", b"{}")
    channels = [other, TALK] if json_first else [TALK, other]
    with DecodingBagReader(write(tmp_path / "bag.mcap", *channels)) as bag:
        assert bag.skipped() == {
            "/talk": "1 message of it cannot be read, its messages are encoded as 'json', "
            "expected 'cdr'"
        }


def heard(path, topic="/talk"):
    with DecodingBagReader(path) as bag:
        found = [m for _, _, m in bag.messages([c for c in bag.connections if c.topic == topic])]
        return found, bag.skipped()


@pytest.mark.parametrize(
    ("other", "reason"),
    [
        (("/x", "a.B", "jsonschema", "{", "json", b"{}"), "encoded as 'json', expected 'cdr'"),
        (("/x", "a.B", "protobuf", b"\xff\xfe\x0a", "protobuf", b"\0"), "encoded as 'protobuf'"),
        (("/x", "a.B", "flatbuffer", b"\x80", "flatbuffer", b"\0"), "encoded as 'flatbuffer'"),
        (("/x", "", "", "", "json", b"{}"), "encoded as 'json'"),
        (("/x", "", "", "", "cdr", LEVEL), "its messages have no type"),
        (("/x", STATUS, "", "", "cdr", LEVEL), f"the bag has no definition of {STATUS}"),
        (("/x", STATUS, "unknown", "?", "cdr", LEVEL), f"the bag has no definition of {STATUS}"),
        (("/x", STATUS, "ros2msg", "&%$ not a definition", "cdr", LEVEL), None),
        (("/x", STATUS, "ros2msg", "vendor_msgs/Missing field", "cdr", LEVEL), None),
        (("/x", STATUS, "ros2idl", "module {", "cdr", LEVEL), None),
        (("/x", "std_msgs/String", "ros1msg", "string data", "ros1", b"\1\0\0\0a"), None),
    ],
)
@pytest.mark.parametrize("profile", ["ros2", ""])
def test_a_topic_that_nobody_asked_for_does_no_harm(tmp_path, other, reason, profile):
    path = write(tmp_path / "bag.mcap", other, TALK, profile=profile)
    found, skipped = heard(path)
    assert [message.data for message in found] == ["hello"]
    assert set(skipped) == ({"/x"} if reason else set())
    assert (reason or "") in skipped.get("/x", "")
    with BagReader(path) as bag:
        assert "/talk" in {topic.name for topic in bag.topics()}
        without_a_type = not other[1] and other[4] == "cdr"
        assert (bag.skipped().get("/x") == "its messages have no type") == without_a_type
        assert ("/x" in {topic.name for topic in bag.topics()}) == (
            other[4] == "cdr" and not without_a_type
        )


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("&%$ not a definition", "the definition of vendor_msgs/msg/Status in the bag cannot be"),
        ("vendor_msgs/Missing field", "it does not define vendor_msgs/msg/Missing"),
        ("", "the bag has no definition of vendor_msgs/msg/Status"),
    ],
)
def test_a_topic_that_is_asked_for_and_cannot_be_decoded_is_named(tmp_path, text, reason):
    path = write(tmp_path / "bag.mcap", ("/x", STATUS, "ros2msg", text, "cdr", LEVEL))
    with pytest.raises(RecordingError, match=r"bag\.mcap, topic /x: ") as caught:
        heard(path, "/x")
    assert reason in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_definition_that_one_channel_lacks_is_taken_from_another(tmp_path):
    path = write(
        tmp_path / "bag.mcap",
        ("/x", STATUS, "", "", "cdr", LEVEL),
        ("/y", STATUS, "ros2msg", "uint8 level", "cdr", LEVEL),
    )
    found, _ = heard(path, "/x")
    assert [message.level for message in found] == [7]


@pytest.mark.parametrize("text", ["", "&%$", "std_msgs/Header header\nstring data"])
def test_a_known_type_needs_no_definition_but_a_good_one_has_priority(tmp_path, text):
    data = HELLO
    if "header" in text:  # another version of the type than ours
        data = b"\x00\x01\x00\x00" + bytes(8) + b"\1\0\0\0\0\0\0\0" + HELLO[4:]
    path = write(tmp_path / "bag.mcap", ("/talk", TEXT, "ros2msg", text, "cdr", data))
    (message,) = heard(path)[0]
    assert message.data == "hello"
    assert hasattr(message, "header") == ("header" in text)


def test_a_definition_without_its_parts_is_completed(tmp_path):
    text = "std_msgs/Header header\nuint8 level"
    data = b"\x00\x01\x00\x00" + bytes(8) + b"\1\0\0\0\0" + b"\x07"
    path = write(tmp_path / "bag.mcap", ("/x", STATUS, "ros2msg", text, "cdr", data))
    (message,) = heard(path, "/x")[0]
    assert message.level == 7


IDL = {
    "include": '#include "a/b.idl"\n{}',
    "copyright": "// Copyright, see #include\n{}",
    "block": "/* a\n * comment */\n{}",
    "annotation": '{}'.replace("struct", '@verbatim (language="comment", text="// no /* c"))'),
}  # fmt: skip


@pytest.mark.parametrize("form", [*IDL, "separated"])
def test_idl_definitions_are_read_in_the_forms_that_recorders_write(tmp_path, form):
    plain = """module vendor_msgs { module msg {
  module Status_Constants { const uint8 OK = 0; };
  @verbatim (language="comment", text=" see http://a.b // c")
  struct Status { @unit (value="m/s") uint8 level; };
}; };
"""
    text = IDL.get(form, "{}").replace("{}", plain)
    if form == "separated":
        text = f'{SEPARATOR}IDL: {STATUS}\n#include "a/b.idl"\n// a\n{plain}'
    path = write(tmp_path / "bag.mcap", ("/x", STATUS, "ros2idl", text, "cdr", LEVEL))
    (message,) = heard(path, "/x")[0]
    assert message.level == 7


def test_sqlite_files_with_odd_topics_are_read(tmp_path):
    store = bag_typestore()
    with Ros2Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        talk = writer.add_connection("/talk", TEXT, typestore=store)
        other = writer.add_connection("/x", "std_msgs/msg/Bool", typestore=store)
        writer.write(talk, 5, HELLO)
        writer.write(other, 6, b"\0\1\0\0\1")
    (file,) = (tmp_path / "bag").glob("*.db3")
    with sqlite3.connect(file) as database:
        database.execute(
            "UPDATE message_definitions SET encoding = 'unknown', encoded_message_definition = ''"
        )
        database.execute(
            "UPDATE topics SET offered_qos_profiles = '- a: [', type = 'vendor_msgs/msg/Status'"
            " WHERE name = '/x'"
        )
    for path in (file, tmp_path / "bag"):
        found, skipped = heard(path)
        assert [message.data for message in found] == ["hello"]
        assert skipped == {"/x": f"the bag has no definition of {STATUS}"}


def test_a_bag_of_ros_1_is_decoded(tmp_path):
    store = get_typestore(Stores.ROS1_NOETIC)
    types = TypestoreTypes(store)
    path = tmp_path / "old.bag"
    with Ros1Writer(path) as writer:
        talk = writer.add_connection("/talk", TEXT, typestore=store, latching=1)
        for number in range(3):
            data = store.serialize_ros1(types.make(TEXT, data=str(number)), TEXT)
            writer.write(talk, 10 + number, data)
    found, skipped = heard(path)
    assert [message.data for message in found] == ["0", "1", "2"]
    assert skipped == {}
    with BagReader(path) as bag:
        assert (bag.start_ns, bag.end_ns) == (10, 12)
        with pytest.raises(RecordingError, match="encoded as 'ros1'"):
            bag.topics()
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    with pytest.raises(RecordingError, match=r"old\.bag cannot be read as a bag") as caught:
        BagReader(path)
    assert "no complete bag of ROS 1" in str(caught.value)


MARKERS = "visualization_msgs/msg/MarkerArray"
DETECTIONS = "vision_msgs/msg/Detection3DArray"


@pytest.mark.parametrize("kind", [MARKERS, DETECTIONS])
def test_messages_of_an_earlier_release_are_read_without_a_definition(tmp_path, kind):
    earlier, now = earlier_typestore(), bag_typestore()

    def stored(store, name):
        types = TypestoreTypes(store)
        if kind == MARKERS:
            items = [types.make("visualization_msgs/msg/Marker", ns=name, id=7) for _ in range(3)]
            message = types.make(kind, markers=items)
        else:
            tracked = {"tracking_id": name} if store is earlier else {"id": name}
            message = types.make(kind, detections=[types.make(kind[:-5], **tracked)])
        return bytes(store.serialize_cdr(message, kind))

    def named(message):
        if kind == MARKERS:
            return message.markers[0].ns
        (found,) = message.detections
        return found.id if hasattr(found, "id") else found.tracking_id

    # Publishers of both releases, and bytes of neither.
    data = [stored(now, "a"), stored(earlier, "b"), stored(earlier, "c"), stored(now, "d")]
    rows = [("/x", kind, "", "", "cdr", one) for one in [*data, data[1][:-30]]]
    found, _ = heard(write(tmp_path / "bag.mcap", *rows), "/x")
    assert [named(message) for message in found] == ["a", "b", "c", "d"]


def test_a_definition_is_read_once_unless_it_is_long(tmp_path, monkeypatch):
    read = []
    parse = bag_definitions.get_types_from_msg
    monkeypatch.setattr(
        bag_definitions, "get_types_from_msg", lambda *given: read.append(1) or parse(*given)
    )
    kind = "vendor_msgs/msg/Again"
    for text, times in (("uint8 level", 1), ("uint8 level\n#" + "x" * 70_000, 3)):
        for number in range(2):
            path = tmp_path / f"{number}.mcap"
            write(path, ("/x", kind, "ros2msg", text, "cdr", LEVEL))
            (message,) = heard(path, "/x")[0]
            assert message.level == 7
        assert len(read) == times


def test_the_layout_of_a_type_lists_all_fields(tmp_path):
    text = "uint8 level\na/B[2] pair\nstring<=5[] words\n" + SEPARATOR + "MSG: a/B\nfloat64 x\n"
    path = write(
        tmp_path / "a.mcap",
        ("/x", STATUS, "ros2msg", text, "cdr", LEVEL),
        ("/y", TEXT, "", "", "cdr", HELLO),
        ("/z", "a/msg/C", "ros2msg", "other/Unknown x\n", "cdr", LEVEL),
    )
    with BagReader(path) as bag:
        definitions = BagDefinitions(bag.connections)
        layouts = {c.topic: definitions.layout(c) for c in bag.connections}
    assert layouts == {
        "/x": [("level", "uint8"), ("pair", "message[2]"), ("pair.x", "float64"),
               ("words", "string[]")],
        "/y": [],
        "/z": [],
    }  # fmt: skip
