# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Reading of one bag of ROS 1, by rosbags."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path
from typing import cast

from rosbags.interfaces import (
    ConnectionExtRosbag1,
    ConnectionExtRosbag2,
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag1 import Reader, ReaderError

from msg_adapters.bags.bag_loss import BagLoss

MAGIC_ROS1 = b"#ROSBAG V"
"""First bytes of a bag of ROS 1."""

ENCODING_ROS1 = "ros1"
"""How the messages of ROS 1 are serialised, as MCAP files call it."""

_NO_TIME = QosTime(0, 0)
_LATCHED = Qos(
    QosHistory.KEEP_LAST,
    1,
    QosReliability.RELIABLE,
    QosDurability.TRANSIENT_LOCAL,
    _NO_TIME,
    _NO_TIME,
    QosLiveliness.AUTOMATIC,
    _NO_TIME,
    False,
)
"""The QoS that a latched topic of ROS 1 comes nearest to."""


class Ros1File:
    """The messages of a bag of ROS 1, version 2.0.

    Args:
        path: the file.

    Attributes:
        connections: its topics by number, described as those of ROS 2.
        start_ns, end_ns: log times of the first and last message (ns).

    Raises:
        rosbags.rosbag1.ReaderError: it cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._reader = Reader(path)
        try:
            self._reader.open()
        except (AssertionError, ReaderError, ValueError, KeyError, IndexError) as error:
            reason = " ".join(str(error).split()).rstrip(".")
            raise ReaderError(f"it is no complete bag of ROS 1: {reason}") from error
        self.start_ns, self.end_ns = self._reader.start_time, self._reader.end_time - 1
        self.connections = {}
        for own in self._reader.connections:
            latched = cast(ConnectionExtRosbag1, own.ext).latching
            profiles = [_LATCHED] if latched else []
            self.connections[own.id] = own._replace(
                digest="", ext=ConnectionExtRosbag2(ENCODING_ROS1, profiles), owner=self
            )
        self._loss: BagLoss | None = None

    def messages(
        self, numbers: Collection[int], start_ns: int | None, stop_ns: int | None
    ) -> Iterator[tuple[int, int, bytes]]:
        """Yield log time (ns), topic and bytes of messages, ascending in time."""
        wanted = [c for c in self._reader.connections if c.id in numbers]
        read, last_ns = 0, self.start_ns
        try:
            for connection, time_ns, data in self._reader.messages(wanted, start_ns, stop_ns):
                yield time_ns, connection.id, data
                read, last_ns = read + 1, time_ns
        except Exception as error:  # a damaged file fails the library in many ways
            count = sum(c.msgcount for c in wanted)
            reason = " ".join(str(error).split()).rstrip(".") or type(error).__name__
            self._loss = BagLoss(
                self._path,
                f"is damaged ({reason})",
                read,
                (last_ns - self.start_ns) * 1e-9,
                max(0, count - read),
                (self.end_ns - last_ns) * 1e-9,
                exact=start_ns is None and stop_ns is None,
            )

    def loss(self) -> BagLoss | None:
        """Return what is lost as far as it is known by now, None if nothing is."""
        return self._loss

    def close(self) -> None:
        """Close the file."""
        self._reader.close()
