# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Bags of every storage, and the definitions of messages in them."""

from __future__ import annotations

import contextlib
import functools
import io
import json
import sqlite3
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from fuzz_target import FuzzTarget, place
from mcap.writer import CompressionType, IndexType, Writer
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Ros2Writer
from rosbags.typesys import Stores, get_typestore

from msg_adapters.bags.bag_reader import BagReader
from msg_adapters.bags.bag_types import bag_typestore
from msg_adapters.registry import INPUTS
from msg_adapters.types import TypestoreTypes
from mtpgo_training.data.readers import load_recordings
from mtpgo_training.data.readers.bags.bag_options import BagOptions
from mtpgo_training.data.readers.reading_options import ReadingOptions

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "mtpgo_training"))
from odd_bags import bytes_of, definition_of, states_at

_KIND = "markers"
_LOG = ReadingOptions(bags=BagOptions(stamps="log"))


def read_bag(name: str, data: bytes) -> None:
    """Read bytes as a bag file: its topics, its messages as bytes, and its recordings."""
    path = place("bag") / name
    path.write_bytes(data)
    with BagReader(path) as bag:
        for _ in bag.raw_messages(bag.topics(), bag.start_ns, bag.end_ns + 1):
            pass
    read_recordings(path)


def read_recordings(path: Path) -> None:
    """Read the recordings of a bag and check what every reader promises."""
    for recording in load_recordings(path, "bag", None, _LOG):
        assert len(recording)
        assert (np.diff(recording.frame) >= 0).all()
        assert np.isfinite(recording.position).all()
        rows = recording.frame * (len(recording.track_id) + 1) + recording.track
        assert len(np.unique(rows)) == len(recording)


def read_metadata(data: bytes) -> None:
    """Read a folder with a good bag and these bytes as its metadata."""
    folder = place("bag_metadata")
    if not (folder / "bag_0.mcap").exists():
        (folder / "bag_0.mcap").write_bytes(mcap_bytes(b"", ""))
    (folder / "metadata.yaml").write_bytes(data)
    read_recordings(folder)


def read_ros1(data: bytes) -> None:
    """Read bytes as a bag of ROS 1."""
    path = place("bag") / "bag.bag"
    path.write_bytes(data)
    read_recordings(path)


@functools.cache
def _messages() -> list[tuple[int, bytes]]:
    """Return times (ns) and bytes of messages with two road users."""
    states = [states_at(i / 10, ids=(1, 2)) for i in range(4)]
    return [(one.stamp_ns, bytes_of(one, _KIND)) for one in states]


def mcap_bytes(definition: bytes, language: str, **options: object) -> bytes:
    """Return a small MCAP file of tracked objects with a definition."""
    stream = io.BytesIO()
    writer = Writer(stream, **options)  # type: ignore[arg-type]
    writer.start(profile="ros2", library="fuzz")
    adapter = INPUTS[_KIND]
    schema = writer.register_schema(adapter.message_type, language, definition)
    channel = writer.register_channel("/objects", "cdr", schema, {"offered_qos_profiles": QOS})
    for stamp_ns, data in _messages():
        writer.add_message(channel, stamp_ns, data, stamp_ns)
    writer.finish()
    return stream.getvalue()


QOS = """- history: 1
  depth: 5
  reliability: 1
  durability: 2
  deadline: {sec: 0, nsec: 0}
  lifespan: {sec: 0, nsec: 0}
  liveliness: 1
  liveliness_lease_duration: {sec: 0, nsec: 0}
  avoid_ros_namespace_conventions: false
"""
METADATA = f"""rosbag2_bagfile_information:
  version: 9
  relative_file_paths: [bag_0.mcap]
  compression_mode: FILE
  topics_with_message_count:
  - message_count: 4
    topic_metadata:
      name: /objects
      type: visualization_msgs/msg/MarkerArray
      serialization_format: cdr
      type_description_hash: RIHS01_0
      offered_qos_profiles: {json.dumps(QOS)}
  files:
  - path: bag_0.mcap
    message_count: 4
    starting_time: {{nanoseconds_since_epoch: 0}}
    duration: {{nanoseconds: 300000000}}
""".encode()


def mcap_seeds() -> Sequence[bytes]:
    """Return MCAP files with and without index and compression."""
    text = definition_of(INPUTS[_KIND].message_type).encode()
    return [
        mcap_bytes(text, "ros2msg", compression=CompressionType.ZSTD),
        mcap_bytes(b"", "", compression=CompressionType.LZ4),
        mcap_bytes(b"", "", compression=CompressionType.NONE, enable_crcs=False),
        mcap_bytes(b"", "", index_types=IndexType.NONE, use_chunking=False, enable_crcs=False),
    ]


def read_definition(language: str, data: bytes) -> None:
    """Read a bag with these bytes as the definition of its messages."""
    path = place("bag") / "definition.mcap"
    path.write_bytes(mcap_bytes(data, language, compression=CompressionType.NONE))
    read_recordings(path)


def definition_seed() -> bytes:
    """Return a definition of markers without the types that every reader knows, and an odd one."""
    parts = definition_of(INPUTS[_KIND].message_type).encode().split(_SEPARATOR)
    short = [part for part in parts if b"Marker" in part.splitlines()[0]]
    return _SEPARATOR.join([*short, ODD_TYPE])


def sqlite_seeds() -> Sequence[bytes]:
    """Return a file of rosbag2's SQLite storage."""
    adapter = INPUTS[_KIND]
    folder = Path(tempfile.mkdtemp(prefix="seed_", dir=place("bag"))) / "bag"
    with Ros2Writer(folder, version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        topic = writer.add_connection("/objects", adapter.message_type, typestore=bag_typestore())
        for stamp_ns, data in _messages():
            writer.write(topic, stamp_ns, data)
    (path,) = folder.glob("*.db3")
    with contextlib.closing(sqlite3.connect(path)) as database:
        # The smallest pages: less of the file is unused, where a change does nothing.
        database.executescript("PRAGMA journal_mode=DELETE; PRAGMA page_size=512; VACUUM")
    return [path.read_bytes()]


def ros1_seeds() -> Sequence[bytes]:
    """Return a bag of ROS 1."""
    adapter, store = INPUTS[_KIND], get_typestore(Stores.ROS1_NOETIC)
    path = Path(tempfile.mkdtemp(prefix="seed_", dir=place("bag"))) / "seed.bag"
    with Ros1Writer(path) as writer:
        topic = writer.add_connection("/objects", adapter.message_type, typestore=store)
        for i in range(4):
            states = states_at(i / 10, ids=(1, 2))
            message = adapter.from_states(states, TypestoreTypes(store))
            writer.write(
                topic, states.stamp_ns, store.serialize_ros1(message, adapter.message_type)
            )
    return [path.read_bytes()]


_SEPARATOR = b"=" * 80 + b"\n"
ODD_TYPE = b"""MSG: odd_msgs/Odd
uint8 ARROW=0
string NAME="a b" # comment
int32 id 1
string<=9 text "a"
wstring wide
float64[<=3] colors
bool[2] flags [true, false]
odd_msgs/Odd[] more
"""
"""A type with what definitions may have besides plain fields."""

IDL = b"""#include "std_msgs/msg/Header.idl"
module visualization_msgs { module msg {
  struct MarkerArray { sequence<visualization_msgs::msg::Marker> markers; };
}; };
"""


def targets() -> list[FuzzTarget]:
    """Return the targets of this file."""
    return [
        FuzzTarget("bag_mcap", functools.partial(read_bag, "bag.mcap"), mcap_seeds),
        FuzzTarget("bag_sqlite", functools.partial(read_bag, "bag.db3"), sqlite_seeds),
        FuzzTarget("bag_ros1", read_ros1, ros1_seeds),
        FuzzTarget("bag_metadata", read_metadata, lambda: [METADATA], text=True),
        FuzzTarget(
            "bag_definition",
            functools.partial(read_definition, "ros2msg"),
            lambda: [definition_seed()],
            text=True,
        ),
        FuzzTarget(
            "bag_idl", functools.partial(read_definition, "ros2idl"), lambda: [IDL], text=True
        ),
    ]
