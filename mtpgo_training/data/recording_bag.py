# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""rosbag2 bags of tracked objects, written and opened without ROS.

Every bag carries its message definitions, so tools that lack the message packages read it, too.
"""

from __future__ import annotations

import dataclasses
import functools
import shutil
import tempfile
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.highlevel import AnyReader, AnyReaderError
from rosbags.interfaces import (
    Connection,
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer, WriterError
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from msg_adapters.inputs.lane_markers import lanes_to_markers
from msg_adapters.registry import input_adapter
from msg_adapters.types import TypestoreTypes
from msg_adapters.wire.definitions import DEFINITIONS
from mtpgo_core.errors import RecordingError
from mtpgo_training.data.recording import FRAME_ID, Recording

OBJECTS_TOPIC = "/objects"
LANES_TOPIC = "/lane_markings"
EGO_TOPIC = "/ego_id"

DEFAULT_KIND = "pointcloud2"
"""Short name of the message kind that carries everything, see :mod:`msg_adapters.registry`."""

_FOREVER = QosTime(2147483647, 4294967295)
_METADATA = "metadata.yaml"


@functools.cache
def bag_typestore() -> Typestore:
    """The message types of ROS 2 Jazzy and of the packages that the adapters speak."""
    store = get_typestore(Stores.ROS2_JAZZY)
    types: dict[str, Any] = {}
    for name, text in DEFINITIONS.items():
        types.update(get_types_from_msg(text, name))
    store.register({name: fields for name, fields in types.items() if name not in store.fielddefs})
    return store


class BagWriter:
    """An open bag; made by :func:`create_bag`.

    Attributes:
        types: maker of the messages to be written.
        messages: number of messages written.
    """

    def __init__(self, writer: Writer) -> None:
        self.types = TypestoreTypes(bag_typestore())
        self.messages = 0
        self._writer = writer
        self._connections: dict[str, Connection] = {}

    def add_topic(self, topic: str, message_type: str, *, latched: bool = False) -> None:
        """Announce a topic.

        Args:
            topic: absolute name.
            message_type: such as ``sensor_msgs/msg/PointCloud2``.
            latched: late subscribers get the last message (transient local).
        """
        self._connections[topic] = self._writer.add_connection(
            topic,
            message_type,
            typestore=bag_typestore(),
            offered_qos_profiles=[_qos(latched=latched)],
        )

    def write(self, topic: str, stamp_ns: int, message: Any) -> None:
        """Append a message of an announced topic under a time (ns)."""
        connection = self._connections[topic]
        data = bag_typestore().serialize_cdr(message, connection.msgtype)
        self._writer.write(connection, stamp_ns, data)
        self.messages += 1


@contextmanager
def create_bag(path: Path) -> Iterator[BagWriter]:
    """A new MCAP bag that takes its place at ``path`` when the block ends without an error.

    A path that ends in ``.mcap`` becomes one self-contained file (rosbag2's metadata within),
    any other a directory with ``metadata.yaml`` and the ``.mcap`` file. An earlier bag at the same
    place is replaced, anything else is left alone.

    Raises:
        RecordingError: the place is taken or cannot be written to.
    """
    _check_place(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        beside = Path(tempfile.mkdtemp(prefix=f".{path.name}.", dir=path.parent))
    except OSError as error:
        raise RecordingError(f"{path} cannot be written: {error.strerror}") from error
    # The file inside is named after its directory, and rosbag2's metadata repeats the name.
    folder = beside / (path.stem if path.suffix == ".mcap" else path.name)
    try:
        writer = Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP)
        # The mcap library cannot read bags compressed by file.
        writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
        with writer:
            yield BagWriter(writer)
        _move(folder, path)
    except (OSError, WriterError) as error:
        raise RecordingError(f"{path} cannot be written: {_reason(error)}") from error
    finally:
        shutil.rmtree(beside, ignore_errors=True)


def write_recording(
    bag: BagWriter,
    recording: Recording,
    *,
    kind: str = DEFAULT_KIND,
    shift_ns: int = 0,
) -> Iterator[int]:
    """Append a recording to a bag; gives the number of road users of each frame as it goes.

    Topics that the bag lacks are announced. Lane markings and the ego come first, latched.

    Args:
        bag: an open bag.
        recording: what is written.
        kind: short name of the tracked-object message.
        shift_ns: added to all stamps (ns).

    Raises:
        MessageError: the message cannot carry the recording, such as too large an identity.
        ConfigurationError: an unknown kind.
    """
    adapter = input_adapter(kind)
    announced = bag._connections
    if not len(recording):
        return
    start_ns = recording.stamp_ns(int(recording.frame[0])) + shift_ns
    if OBJECTS_TOPIC not in announced:
        bag.add_topic(OBJECTS_TOPIC, adapter.message_type)
    if recording.lanes:
        if LANES_TOPIC not in announced:
            bag.add_topic(LANES_TOPIC, "visualization_msgs/msg/MarkerArray", latched=True)
        lanes = lanes_to_markers(recording.lanes, bag.types, stamp_ns=start_ns, frame_id=FRAME_ID)
        bag.write(LANES_TOPIC, start_ns, lanes)
    if recording.ego_id is not None:
        if EGO_TOPIC not in announced:
            bag.add_topic(EGO_TOPIC, "std_msgs/msg/String", latched=True)
        text = bag.types.make("std_msgs/msg/String", data=str(recording.ego_id))
        bag.write(EGO_TOPIC, start_ns, text)
    for states in recording.states():
        stamp_ns = states.stamp_ns + shift_ns
        # Seen from above the ground is the plane z = 0, and viewers hide points without a z.
        height = np.where(np.isnan(states.z), 0.0, states.z)
        states = dataclasses.replace(states, stamp_ns=stamp_ns, z=height)
        bag.write(OBJECTS_TOPIC, stamp_ns, adapter.from_states(states, bag.types))
        yield len(states)


@contextmanager
def open_bag(path: Path) -> Iterator[AnyReader]:
    """A bag for reading: a rosbag2 directory (MCAP or SQLite) or a single ``.mcap`` file.

    Raises:
        RecordingError: it is missing, damaged or no bag.
    """
    if not path.exists():
        raise RecordingError(f"{path} does not exist, expected a bag")
    if path.is_dir() and not (path / _METADATA).is_file():
        raise RecordingError(f"{path} has no {_METADATA}, expected a rosbag2 directory")
    try:
        reader = AnyReader([path], default_typestore=bag_typestore())
        reader.open()
    except Exception as error:  # a damaged bag can fail in any way within the library
        raise _unreadable(path, error) from error
    try:
        yield reader
    except (AnyReaderError, OSError, EOFError) as error:
        raise _unreadable(path, error) from error
    finally:
        reader.close()


def read_messages(
    path: Path, reader: AnyReader, connections: Collection[Connection]
) -> Iterator[tuple[Connection, int, Any]]:
    """Connection, log time (ns) and decoded message of everything on some topics, in time.

    Args:
        path: of the bag, for the error.
        reader: from :func:`open_bag`.
        connections: the topics.

    Raises:
        RecordingError: the bag is damaged.
    """
    stored = reader.messages(connections)
    while True:
        try:
            item = next(stored, None)
            if item is None:
                return
            connection, stamp_ns, data = item
            message = reader.deserialize(data, connection.msgtype)
        except Exception as error:  # as above
            raise _unreadable(path, error) from error
        yield connection, stamp_ns, message


def _unreadable(path: Path, error: Exception) -> RecordingError:
    return RecordingError(f"{path} cannot be read as a bag: {_reason(error)}")


def is_bag(path: Path) -> bool:
    """Whether a path looks like a bag, without opening it."""
    if path.is_dir():
        return (path / _METADATA).is_file()
    return path.suffix == ".mcap" and path.is_file()


def _check_place(path: Path) -> None:
    if path.is_dir():
        taken = any(path.iterdir()) and not _is_rosbag2(path)
        if path.suffix == ".mcap" and any(path.iterdir()):
            taken = True
    else:
        taken = path.exists() and path.suffix != ".mcap"
    if taken:
        raise RecordingError(f"{path} exists and is no bag of the kind asked for: not replaced")


def _is_rosbag2(path: Path) -> bool:
    """Whether a directory holds a bag and nothing else."""
    return is_bag(path) and all(
        entry.name == _METADATA or entry.suffix == ".mcap" for entry in path.iterdir()
    )


def _move(folder: Path, path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path)
    if path.suffix == ".mcap":
        (folder / f"{folder.name}.mcap").replace(path)
    else:
        folder.replace(path)


def _reason(error: BaseException) -> str:
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    return (str(error).strip().splitlines() or [type(error).__name__])[0]


def _qos(*, latched: bool) -> Qos:
    return Qos(
        history=QosHistory.KEEP_LAST,
        depth=1 if latched else 10,
        reliability=QosReliability.RELIABLE,
        durability=QosDurability.TRANSIENT_LOCAL if latched else QosDurability.VOLATILE,
        deadline=_FOREVER,
        lifespan=_FOREVER,
        liveliness=QosLiveliness.AUTOMATIC,
        liveliness_lease_duration=_FOREVER,
        avoid_ros_namespace_conventions=False,
    )
