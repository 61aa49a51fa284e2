# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Reading of one bag of ROS 1, by rosbags."""

from __future__ import annotations

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

from msg_adapters.bags.bag_loss import LibraryFile, reason_of

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


class Ros1File(LibraryFile):
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
        reader = Reader(path)
        try:
            reader.open()
        except (AssertionError, ReaderError, ValueError, KeyError, IndexError) as error:
            raise ReaderError(f"it is no complete bag of ROS 1: {reason_of(error)}") from error
        super().__init__(path, reader, reader.start_time, reader.end_time - 1)
        self.connections = {}
        for own in reader.connections:
            latched = cast(ConnectionExtRosbag1, own.ext).latching
            profiles = [_LATCHED] if latched else []
            self.connections[own.id] = own._replace(
                digest="", ext=ConnectionExtRosbag2(ENCODING_ROS1, profiles), owner=self
            )
