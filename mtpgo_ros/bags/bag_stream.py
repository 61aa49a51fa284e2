# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A bag as a stream of serialised messages. No ROS in here.

rosbags reads rosbag2 directories and single MCAP or SQLite files alike, and hands out the bytes
as they were recorded, so playing a bag needs no knowledge of its messages.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

from rosbags.interfaces import Connection, ConnectionExtRosbag2, QosDurability
from rosbags.rosbag2 import Reader

from mtpgo_core.errors import RecordingError

_LATCHED_BY_NAME = frozenset({"/tf_static", "/robot_description", "/map"})
"""Topics latched by convention, for bags whose writer left the QoS out."""


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


class BagSource:
    """Reads one bag; use it in a ``with`` block.

    Args:
        path: rosbag2 directory, or one .mcap or .db3 file.

    Attributes:
        start_ns, end_ns: times of the first and the last message (ns).

    Raises:
        RecordingError: the bag is missing, broken or empty.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        if not path.exists():
            raise RecordingError(f"bag {path} does not exist")
        try:
            self._reader = Reader(path)
            self._reader.open()
        except Exception as error:  # A broken file fails the reader in many ways.
            raise RecordingError(
                f"{path} cannot be read as a bag (a rosbag2 directory, .mcap or .db3):"
                f" {_reason(error)}"
            ) from error
        if self._reader.message_count == 0:
            self.close()
            raise RecordingError(f"bag {path} holds no message")
        self.start_ns = int(self._reader.start_time)
        self.end_ns = int(self._reader.end_time) - 1

    def __enter__(self) -> BagSource:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the files."""
        with suppress(Exception):
            self._reader.close()

    def topics(self, names: Sequence[str] | None = None) -> list[BagTopic]:
        """The topics that hold a message, or those of them that ``names`` asks for.

        Raises:
            RecordingError: a name that the bag does not hold.
        """
        found: dict[str, BagTopic] = {}
        for connection in self._reader.connections:
            if connection.msgcount or connection.topic not in found:
                count = connection.msgcount
                if connection.topic in found:
                    count += found[connection.topic].count
                found[connection.topic] = BagTopic(
                    connection.topic, connection.msgtype, count, _latched(connection)
                )
        held = {name: topic for name, topic in found.items() if topic.count}
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

    def messages(
        self, topics: Sequence[BagTopic], start_ns: int, stop_ns: int
    ) -> Iterator[tuple[str, int, bytes]]:
        """Topic, log time (ns) and bytes of each message from ``start_ns`` to before ``stop_ns``.

        Raises:
            RecordingError: the file breaks off or is damaged.
        """
        names = {topic.name for topic in topics}
        connections = [c for c in self._reader.connections if c.topic in names]
        try:
            for connection, time_ns, data in self._reader.messages(
                connections, start=start_ns, stop=stop_ns
            ):
                yield connection.topic, int(time_ns), bytes(data)
        except GeneratorExit:
            raise
        except Exception as error:
            raise RecordingError(f"bag {self.path} is damaged: {_reason(error)}") from error


def _latched(connection: Connection) -> bool:
    extension = connection.ext
    profiles = (
        extension.offered_qos_profiles if isinstance(extension, ConnectionExtRosbag2) else []
    )
    if not profiles:
        return connection.topic in _LATCHED_BY_NAME
    return all(profile.durability is QosDurability.TRANSIENT_LOCAL for profile in profiles)


def _reason(error: Exception) -> str:
    """What a foreign exception says, or at least its kind."""
    return " ".join(str(error).split()).rstrip(".") or type(error).__name__
