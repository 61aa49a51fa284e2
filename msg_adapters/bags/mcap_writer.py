# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Writing of bags: rosbag2 layout, MCAP storage, message definitions included.

rosbags writes them rather than the plain mcap library, because it also writes the metadata.yaml
and the type hashes that make the folder a bag for ``ros2 bag``.
"""

from __future__ import annotations

import shutil
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import Any, Self, cast

from rosbags.interfaces import (
    Connection,
    ConnectionExtRosbag2,
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer, WriterError
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from msg_adapters.bags.bag_reader import METADATA, is_bag
from msg_adapters.bags.bag_types import bag_typestore, require_type
from msg_adapters.types import TypestoreTypes
from mtpgo_core.errors import RecordingError, reason_of

INFINITE = QosTime(9223372036, 854775807)
"""A duration without an end: RMW_DURATION_INFINITE of rmw/types.h, the largest int64 in
nanoseconds, which is what rclpy reports of a publisher and ``ros2 bag record`` writes (s, ns)."""

_DEPTH = 10
"""History depth offered by a topic, as of most publishers (messages). ``ros2 bag play`` replaces
it by its own."""


class McapWriter:
    """One bag, written under a temporary name until it is complete; a context manager.

    A path that ends in ``.mcap`` becomes one self-contained file (rosbag2's metadata within), any
    other a directory with ``metadata.yaml`` and the ``.mcap`` file. Leaving the ``with`` block
    without an error completes the bag, an error discards it.

    Args:
        path: where the bag is to be.
        replace: an earlier bag at ``path`` is replaced; by default it is an error.
        compress: compress the chunks with Zstandard.

    Attributes:
        path: where the bag is to be.
        types: maker of messages for :meth:`write`.
        messages: number of messages written.

    Raises:
        RecordingError: ``path`` exists (and is not a bag that may be replaced), or cannot be
            written.
    """

    def __init__(self, path: Path, *, replace: bool = False, compress: bool = False) -> None:
        self.path = path
        self.types = TypestoreTypes(bag_typestore())
        self.messages = 0
        self._replace = replace
        if not replace and path.exists():
            raise RecordingError(f"output {path} exists already and is not overwritten")
        if replace and not _replaceable(path):
            raise RecordingError(
                f"{path} exists and is no bag of the kind asked for: not replaced"
            )
        self._connections: dict[str, Connection] = {}
        self._added: dict[tuple[str, str], Connection] = {}
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._folder = self._temporary_folder()
        except OSError as error:
            raise self._not_written(error) from error
        # The file inside is named after its directory, and rosbag2's metadata repeats the name.
        self._bag = self._folder / (path.stem if is_single_file(path) else path.name)
        try:
            self._writer = Writer(self._bag, version=9, storage_plugin=StoragePlugin.MCAP)
            if compress:
                # The mcap library cannot read bags compressed by file.
                self._writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
            self._writer.open()
            self._opened()
        except (OSError, WriterError) as error:
            shutil.rmtree(self._folder, ignore_errors=True)
            raise self._not_written(error) from error

    def _temporary_folder(self) -> Path:
        # On the disk of the path, to which it is renamed at the end.
        return Path(tempfile.mkdtemp(prefix=f".{self.path.name}.", dir=self.path.parent))

    def _opened(self) -> None:
        """Do what a kind of bag needs when its file is open."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None:
            self.close()
        else:
            self.discard()

    def has_topic(self, topic: str) -> bool:
        """Return whether a topic was added."""
        return topic in self._connections

    def type_of(self, topic: str) -> str | None:
        """Return the type with which a topic was last added, None if it was not."""
        return self._connections[topic].msgtype if topic in self._connections else None

    def add_topic(
        self,
        topic: str,
        message_type: str,
        *,
        latched: bool = False,
        reliable: bool = True,
        depth: int = _DEPTH,
        definition: str = "",
    ) -> None:
        """Add a topic; one that had this type before it got another one goes on as it was.

        Args:
            topic: absolute name.
            message_type: such as ``sensor_msgs/msg/PointCloud2``.
            latched: late subscribers get the last messages (transient local).
            reliable: its publisher repeats lost messages.
            depth: messages that its publisher keeps.
            definition: of the type and all within it (``.msg``), empty for the usual one.

        Raises:
            RecordingError: the definition of the type is not installed, or the disk is full.
        """
        earlier = self._added.get((topic, message_type))
        if earlier is not None and earlier is not self._connections[topic]:
            self._connections[topic] = earlier
            return
        store = bag_typestore()
        if definition:
            store = get_typestore(Stores.EMPTY)
            store.register(get_types_from_msg(definition, message_type))
        else:
            require_type(message_type)
        qos = _qos(latched=latched, reliable=reliable, depth=depth)
        try:
            self._connections[topic] = self._writer.add_connection(
                topic, message_type, typestore=store, offered_qos_profiles=[qos]
            )
            self._added[topic, message_type] = self._connections[topic]
        except (OSError, WriterError) as error:
            raise self._not_written(error) from error

    def add_recorded_topic(self, connection: Connection, type_hash: str) -> None:
        """Add a topic as another bag has it, with the definition that is there.

        Args:
            connection: of the other bag.
            type_hash: hash of its type (RIHS01).

        Raises:
            RecordingError: neither the other bag nor this package has a definition of the type.
        """
        extension, definition = cast(ConnectionExtRosbag2, connection.ext), connection.msgdef.data
        if not definition:
            require_type(connection.msgtype)
            definition, _ = bag_typestore().generate_msgdef(connection.msgtype, ros_version=2)
        try:
            self._connections[connection.topic] = self._writer.add_connection(
                connection.topic,
                connection.msgtype,
                msgdef=definition,
                rihs01=type_hash,
                serialization_format=extension.serialization_format,
                offered_qos_profiles=extension.offered_qos_profiles,
            )
        except (OSError, WriterError) as error:
            raise self._not_written(error) from error

    def write(self, topic: str, time_ns: int, message: Any) -> None:
        """Append a message made by :attr:`types` to a topic that was added.

        Args:
            topic: absolute name.
            time_ns: log time (ns).
            message: the message.

        Raises:
            RecordingError: the disk is full.
        """
        message_type = self._connections[topic].msgtype
        self.write_bytes(topic, time_ns, bag_typestore().serialize_cdr(message, message_type))

    def write_bytes(self, topic: str, time_ns: int, data: bytes | memoryview) -> None:
        """Append a serialised message (CDR); see :meth:`write`."""
        try:
            self._writer.write(self._connections[topic], time_ns, data)
        except (OSError, WriterError) as error:
            raise self._not_written(error) from error
        self.messages += 1

    def close(self) -> None:
        """Complete the bag and move it to its path.

        Raises:
            RecordingError: the disk is full, or another process has taken the path.
        """
        try:
            self._writer.close()
            single = is_single_file(self.path)
            if self._replace and self.path.is_dir() and _replaceable(self.path):
                # Aside first: a process that is killed must not leave half of the earlier bag.
                self.path.rename(self._folder / "replaced")
            (self._bag / f"{self._bag.name}.mcap" if single else self._bag).rename(self.path)
        except (OSError, WriterError) as error:
            raise self._not_written(error) from error
        finally:
            self.discard()

    def discard(self) -> None:
        """Remove the temporary files; nothing is left of a bag that is not complete."""
        with suppress(Exception):
            self._writer.abort()
        shutil.rmtree(self._folder, ignore_errors=True)

    def _not_written(self, error: Exception) -> RecordingError:
        return RecordingError(f"output {self.path} cannot be written: {reason_of(error)}")


def is_single_file(path: Path) -> bool:
    """Return whether an output is one self-contained file and not a rosbag2 directory."""
    return path.suffix.lower() == ".mcap"


def _replaceable(path: Path) -> bool:
    """Return whether nothing but an earlier bag of the same kind would be lost."""
    if not path.is_dir():
        return not path.exists() or is_single_file(path)
    entries = list(path.iterdir())
    if not entries:
        return True
    return (
        not is_single_file(path)
        and is_bag(path)
        and all(entry.name == METADATA or is_single_file(entry) for entry in entries)
    )


def _qos(*, latched: bool, reliable: bool, depth: int) -> Qos:
    """Return the QoS that a player should offer for a topic."""
    return Qos(
        history=QosHistory.KEEP_LAST,
        depth=depth,
        reliability=QosReliability.RELIABLE if reliable else QosReliability.BEST_EFFORT,
        durability=QosDurability.TRANSIENT_LOCAL if latched else QosDurability.VOLATILE,
        deadline=INFINITE,
        lifespan=INFINITE,
        liveliness=QosLiveliness.AUTOMATIC,
        liveliness_lease_duration=INFINITE,
        avoid_ros_namespace_conventions=False,
    )
