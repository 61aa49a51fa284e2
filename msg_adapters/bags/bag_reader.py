# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Reading of bags: the recorded bytes as they are, or decoded messages.

rosbags reads rosbag2 directories and single MCAP or SQLite files alike.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rosbags.highlevel import AnyReader
from rosbags.interfaces import Connection, ConnectionExtRosbag2, QosDurability
from rosbags.typesys import Stores, get_typestore

from msg_adapters.bags.bag_types import bag_typestore
from msg_adapters.bags.stored_bag import METADATA, StoredBag, is_unfinished_bag
from mtpgo_core.errors import RecordingError

_LATCHED_BY_NAME = frozenset({"/tf_static", "/robot_description", "/map"})
"""Topics latched by convention, for bags whose writer left the QoS out."""


def is_bag(path: Path) -> bool:
    """Return whether a path looks like a bag, without opening it."""
    if path.is_dir():
        return (path / METADATA).is_file() or is_unfinished_bag(path)
    return path.suffix == ".mcap" and path.is_file()


@dataclass(frozen=True)
class BagTopic:
    """One topic of a bag.

    Attributes:
        name: the topic.
        message_type: its ROS type, for instance ``sensor_msgs/msg/PointCloud2``.
        count: messages in the bag.
        latched: its publisher kept the last messages for late subscribers (transient local).
    """

    name: str
    message_type: str
    count: int
    latched: bool


class BagReader:
    """The serialised messages of one bag; a context manager.

    Nothing is decoded, so a bag of any message type can be read.

    Args:
        path: rosbag2 directory, or one .mcap or .db3 file.

    Attributes:
        path: the bag.
        connections: its connections (a topic with its type), one for each publisher's QoS.

    Raises:
        RecordingError: the bag is missing or cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        if not path.exists():
            raise RecordingError(f"{path} does not exist, expected a bag")
        try:
            self._reader = self._open()
        except RecordingError:
            raise
        except Exception as error:  # A broken file fails the library in many ways.
            raise RecordingError(
                f"{path} cannot be read as a bag (a rosbag2 directory, .mcap or .db3):"
                f" {reason_of(error)}"
            ) from error
        self.connections: list[Connection] = list(self._reader.connections)

    def _open(self) -> StoredBag | AnyReader:
        return StoredBag(self.path)

    def __enter__(self) -> BagReader:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the files."""
        with suppress(Exception):
            self._reader.close()

    @property
    def start_ns(self) -> int:
        """Log time of the first message (ns); of no meaning in an empty bag."""
        return int(self._reader.start_time)

    @property
    def end_ns(self) -> int:
        """Log time of the last message (ns); of no meaning in an empty bag."""
        return int(self._reader.end_time) - 1

    def topics(self, names: Sequence[str] | None = None) -> list[BagTopic]:
        """Return the topics that have a message, or those of them that ``names`` asks for.

        Raises:
            RecordingError: the bag is empty, or has no message on a topic in ``names``.
        """
        found: dict[str, BagTopic] = {}
        for connection in self.connections:
            if connection.msgcount or connection.topic not in found:
                count = connection.msgcount
                if connection.topic in found:
                    count += found[connection.topic].count
                found[connection.topic] = BagTopic(
                    connection.topic, connection.msgtype, count, _latched(connection)
                )
        held = {name: topic for name, topic in found.items() if topic.count}
        if not held:
            raise RecordingError(f"bag {self.path} holds no message")
        if names is None:
            return list(held.values())
        absolute = ["/" + name.lstrip("/") for name in names]
        for name in absolute:
            if name not in held:
                raise RecordingError(
                    f"bag {self.path} has no messages on topic {name}, it holds"
                    f" {', '.join(sorted(held))}"
                )
        return [held[name] for name in dict.fromkeys(absolute)]

    def raw_messages(
        self, topics: Sequence[BagTopic], start_ns: int, stop_ns: int
    ) -> Iterator[tuple[str, int, bytes]]:
        """Yield topic, log time (ns) and bytes of the messages from ``start_ns`` to ``stop_ns``.

        A message at ``stop_ns`` itself is left out.

        Raises:
            RecordingError: the file is truncated or damaged.
        """
        names = {topic.name for topic in topics}
        connections = [c for c in self.connections if c.topic in names]
        for connection, time_ns, data in self._stored(connections, start_ns, stop_ns):
            yield connection.topic, time_ns, bytes(data)

    def _stored(
        self, connections: Collection[Connection], start_ns: int | None, stop_ns: int | None
    ) -> Iterator[tuple[Connection, int, bytes]]:
        stored = self._reader.messages(connections, start=start_ns, stop=stop_ns)
        while True:
            try:
                item = next(stored, None)
            except Exception as error:  # as in the constructor
                raise self._damaged(error) from error
            if item is None:
                return
            yield item

    def _damaged(self, error: Exception) -> RecordingError:
        return RecordingError(
            f"{self.path} cannot be read as a bag, it is damaged: {reason_of(error)}"
        )


class DecodingBagReader(BagReader):
    """A bag whose messages are decoded by the definitions that it carries; a context manager.

    Args:
        path: rosbag2 directory, or one .mcap or .db3 file.

    Raises:
        RecordingError: the bag is missing or cannot be read, or its definitions cannot.
    """

    _reader: AnyReader

    def _open(self) -> AnyReader:
        reader = _Decoder(StoredBag(self.path))
        reader.open()
        return reader

    def __enter__(self) -> DecodingBagReader:
        return self

    def messages(
        self, connections: Collection[Connection]
    ) -> Iterator[tuple[Connection, int, Any]]:
        """Yield connection, log time (ns) and decoded message of some connections, in time.

        Raises:
            RecordingError: the file is truncated or damaged.
        """
        for connection, time_ns, data in self._stored(connections, None, None):
            try:
                message = self._reader.deserialize(data, connection.msgtype)
            except Exception as error:  # as in the constructor
                raise self._damaged(error) from error
            yield connection, time_ns, message


class _Decoder(AnyReader):
    """Decodes the messages of an open bag."""

    def __init__(self, bag: StoredBag) -> None:
        # The base class opens the files of a path by itself, and whole ones only.
        self.paths, self.is2, self.stack, self.connections = [bag.path], True, None, []
        self.default_typestore = bag_typestore()
        self.typestore = get_typestore(Stores.EMPTY)
        self.readers = [bag]  # type: ignore[assignment]


def _latched(connection: Connection) -> bool:
    extension = connection.ext
    profiles = (
        extension.offered_qos_profiles if isinstance(extension, ConnectionExtRosbag2) else []
    )
    if not profiles:
        return connection.topic in _LATCHED_BY_NAME
    return all(profile.durability is QosDurability.TRANSIENT_LOCAL for profile in profiles)


def reason_of(error: BaseException) -> str:
    """Return what an exception of the system or a library says, or at least its kind."""
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    return " ".join(str(error).split()).rstrip(".") or type(error).__name__
