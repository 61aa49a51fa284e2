# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Reading of bags: the recorded bytes as they are, or decoded messages.

rosbag2 directories, single MCAP or SQLite files, and bags of ROS 1 are read alike. Only the topics
asked for are opened, each by its own encoding and definition.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rosbags.interfaces import Connection, QosDurability

from msg_adapters.bags.bag_definitions import (
    BagDefinitions,
    encoding_of,
    obstacle,
    qos_and_encoding,
)
from msg_adapters.bags.bag_loss import counted
from msg_adapters.bags.stored_bag import (
    METADATA,
    SUFFIXES,
    StoredBag,
    begins_as_bag,
    has_bag_suffix,
    is_unfinished_bag,
)
from mtpgo_core.errors import MessageError, RecordingError, found_names, reason_of

_LATCHED_BY_NAME = frozenset({"tf_static", "robot_description", "map"})
"""Topics latched by convention, in any namespace, for bags whose writer left the QoS out."""


def is_bag(path: Path) -> bool:
    """Return whether a path is named as a bag is, without opening it."""
    if path.is_dir():
        return (path / METADATA).is_file() or is_unfinished_bag(path)
    return has_bag_suffix(path) and path.is_file()


def is_or_begins_as_bag(path: Path) -> bool:
    """Return whether a path that a user chose is a bag, whatever the name of a file ends in.

    In a folder only names tell the bags: a copy may lie beside one, and any other SQLite file.
    """
    return is_bag(path) or (path.is_file() and begins_as_bag(path))


def bag_name(path: Path) -> str:
    """Return the name of a bag: that of its directory, or of its file without the ending.

    A link has its own name: in stores of large files what it leads to is named by a hash.
    """
    name = Path(os.path.abspath(path)).name
    suffix = next((s for s in SUFFIXES if name.lower().endswith(s)), "")
    return name[: len(name) - len(suffix)] if path.is_file() else name


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
        path: rosbag2 directory, or one .mcap, .db3 or .bag file.

    Attributes:
        path: the bag.
        connections: its connections (a topic with its type), one for each type,
            encoding and definition: a topic may have several.

    Raises:
        RecordingError: the bag is missing or cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        if not path.exists():
            raise RecordingError(f"{path} does not exist, expected a bag")
        try:
            self._bag = StoredBag(path)
        except RecordingError:
            raise
        except Exception as error:  # A broken file fails the libraries in many ways.
            raise RecordingError(
                f"{path} cannot be read as a bag (a rosbag2 directory, .mcap, .db3 or .bag):"
                f" {reason_of(error)}"
            ) from error
        self.connections: list[Connection] = list(self._bag.connections)

    def __enter__(self) -> BagReader:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the files."""
        with suppress(Exception):
            self._bag.close()

    def tell(self, sentence: str) -> None:
        """Say a sentence about the bag, once a process."""
        self._bag.tell(sentence)

    @property
    def told(self) -> list[str]:
        """What was said of the bag so far, one sentence each, also if it was said before."""
        return self._bag.told

    @property
    def start_ns(self) -> int:
        """Log time of the first message (ns); of no meaning in an empty bag."""
        return int(self._bag.start_time)

    @property
    def end_ns(self) -> int:
        """Log time of the last message (ns); of no meaning in an empty bag."""
        return int(self._bag.end_time) - 1

    def skipped(self) -> dict[str, str]:
        """Return the topics with messages that cannot be played, and why."""
        found: dict[str, str] = {}
        types: dict[str, str] = {}
        played = {c.topic for c in self._filled() if encoding_of(c) == "cdr"}
        for connection in self._filled():
            encoding = encoding_of(connection)
            if encoding != "cdr" or not connection.msgtype:
                reason = f"its messages are encoded as {encoding!r}, expected 'cdr'"
                if encoding == "cdr":
                    reason = obstacle(connection)
                elif connection.topic in played:
                    reason = f"its {connection.msgcount} messages in {encoding!r} are left out"
                found.setdefault(connection.topic, reason)
            elif types.setdefault(connection.topic, connection.msgtype) != connection.msgtype:
                found[connection.topic] = (
                    f"its {connection.msgcount} messages of type {connection.msgtype} are left out"
                )
        return found

    def topics(self, names: Sequence[str] | None = None) -> list[BagTopic]:
        """Return the topics that have a message for ROS 2, or those of them in ``names``.

        Raises:
            RecordingError: the bag is empty, or has no message for ROS 2 on a topic in ``names``.
        """
        held: dict[str, BagTopic] = {}
        for connection in self._filled():
            name, latched = connection.topic, is_latched(connection)
            known = held.get(name)
            if encoding_of(connection) != "cdr" or not connection.msgtype:
                continue
            if known is None:
                held[name] = BagTopic(name, connection.msgtype, connection.msgcount, latched)
            elif known.message_type == connection.msgtype:
                count = known.count + connection.msgcount
                held[name] = BagTopic(name, known.message_type, count, known.latched and latched)
        skipped = self.skipped()
        if not held:
            reason = "".join(f" for ROS 2, topic {k}: {v}" for k, v in [*skipped.items()][:1])
            raise RecordingError(f"bag {self.path} holds no message{reason}")
        absolute = [*held] if names is None else ["/" + name.lstrip("/") for name in names]
        for name in absolute:
            if name not in held and name in skipped:
                raise RecordingError(f"topic {name} of bag {self.path}: {skipped[name]}")
            if name not in held:
                raise RecordingError(
                    f"bag {self.path} has no messages on topic {name}, it holds"
                    f" {found_names(sorted(held))}"
                )
        return [held[name] for name in dict.fromkeys(absolute)]

    def _filled(self) -> list[Connection]:
        return [connection for connection in self.connections if connection.msgcount]

    def connections_of(self, topic: BagTopic) -> list[Connection]:
        """Return the connections of a topic, one for each definition that its type has."""
        return [
            c
            for c in self.connections
            if (c.topic, c.msgtype) == (topic.name, topic.message_type) and encoding_of(c) == "cdr"
        ]

    def raw_messages(
        self, topics: Sequence[BagTopic], start_ns: int, stop_ns: int
    ) -> Iterator[tuple[str, int, bytes]]:
        """Yield topic, log time (ns) and bytes of the messages from ``start_ns`` to ``stop_ns``.

        A message at ``stop_ns`` itself is left out.

        Raises:
            RecordingError: the file is truncated or damaged.
        """
        connections = [c for topic in topics for c in self.connections_of(topic)]
        for connection, time_ns, data in self.stored(connections, start_ns, stop_ns):
            yield connection.topic, time_ns, bytes(data)

    def stored(
        self,
        connections: Collection[Connection],
        start_ns: int | None = None,
        stop_ns: int | None = None,
    ) -> Iterator[tuple[Connection, int, bytes]]:
        """Yield connection, log time (ns) and bytes of messages, ascending in time.

        Args:
            connections: those wanted.
            start_ns: earliest log time (ns).
            stop_ns: first log time that is left out (ns).

        Raises:
            RecordingError: the file is truncated or damaged.
        """
        if not connections:  # which stands for all in the library
            return
        stored = self._bag.messages(connections, start=start_ns, stop=stop_ns)
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
        path: rosbag2 directory, or one .mcap, .db3 or .bag file.

    Raises:
        RecordingError: the bag is missing or cannot be read.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._definitions = BagDefinitions(self.connections)

    def __enter__(self) -> DecodingBagReader:
        return self

    def skipped(self) -> dict[str, str]:
        """Return the topics with messages that cannot be decoded, and why, as far as is known."""
        reasons = [(connection, obstacle(connection)) for connection in self._filled()]
        decoded = {connection.topic for connection, reason in reasons if not reason}
        found: dict[str, str] = {}
        for connection, reason in reasons:
            if not reason:
                continue
            if connection.topic in decoded:
                reason = f"{counted(connection.msgcount)} of it cannot be read, {reason}"
            found.setdefault(connection.topic, reason)
        return found

    def messages(
        self,
        connections: Collection[Connection],
        refused: Callable[[Connection, str], None] | None = None,
    ) -> Iterator[tuple[Connection, int, Any]]:
        """Yield connection, log time (ns) and decoded message of some connections, in time.

        Args:
            connections: those wanted.
            refused: is told of each message that cannot be decoded, and why; without it they are
                left out with a warning for each topic.

        Raises:
            RecordingError: the file is truncated or damaged, or a type cannot be decoded.
        """
        decoders = {}
        for connection in connections:
            try:
                decoders[connection.id] = self._definitions.decoder(connection)
            except MessageError as error:
                raise RecordingError(f"{self.path}, topic {connection.topic}: {error}") from error
        left_out: Counter[str] = Counter()
        reasons: dict[str, str] = {}
        for connection, time_ns, data in self.stored(connections):
            try:
                message = decoders[connection.id](data)
            except Exception as error:  # as in the constructor
                reason = f"it cannot be decoded as {connection.msgtype}: {reason_of(error)}"
                if refused is not None:
                    refused(connection, reason)
                left_out[connection.topic] += 1
                reasons.setdefault(connection.topic, reason)
                continue
            yield connection, time_ns, message
        for topic, number in left_out.items() if refused is None else ():
            self.tell(
                f"{self.path}, topic {topic}: {counted(number)} left out, the first because"
                f" {reasons[topic]}"
            )


def is_latched(connection: Connection) -> bool:
    """Return whether all publishers of a topic kept their last messages for late subscribers."""
    profiles = qos_and_encoding(connection).offered_qos_profiles
    if not profiles:
        return connection.topic.rpartition("/")[2] in _LATCHED_BY_NAME
    return all(profile.durability is QosDurability.TRANSIENT_LOCAL for profile in profiles)
