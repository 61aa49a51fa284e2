# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Bounds of what is read from a message, and the check of its bytes before it is decoded.

Decoding makes a Python object of every object, field and point of a message. The check reads the
few numbers at the start of the bytes that say how many there are, so a message that is too large,
or that claims more than its bytes can hold, costs no more than these.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

from msg_adapters.wire.cdr_reader import ENCODING_HEADER
from mtpgo_core.errors import MessageError
from mtpgo_core.options import check_options, option

FIELD_BYTES = 20
"""Smallest size of a sensor_msgs/PointField: an empty name, and three numbers, with padding."""


@dataclass(frozen=True)
class InputLimits:
    """The largest message that is read.

    Attributes:
        max_message_bytes: bytes of a serialised message. Chosen: 20,000 objects in any of the
            layouts without covariances; decoding takes about 0.1 s for each megabyte of nested
            objects (measured), 0.2 ms for one of a cloud.
        max_objects: objects of a message, or points of a cloud; chosen far above any tracker.
        max_fields: fields of a cloud; chosen, our own layout has 25.
    """

    max_message_bytes: int = option(16 * 1024 * 1024, low=1024, high=1 << 30)
    max_objects: int = option(32768, low=1, high=1_000_000)
    max_fields: int = option(256, low=3, high=4096)

    def __post_init__(self) -> None:
        check_options(self)

    def check_objects(self, number: int) -> None:
        """Check the number of objects.

        Raises:
            MessageError: there are too many.
        """
        if number > self.max_objects:
            raise MessageError(
                f"message has {number} objects, expected at most {self.max_objects} "
                "(parameter max_objects)"
            )

    def check_fields(self, number: int) -> None:
        """Check the number of a cloud's fields.

        Raises:
            MessageError: there are too many.
        """
        if number > self.max_fields:
            raise MessageError(
                f"point cloud has {number} fields, expected at most {self.max_fields} "
                "(parameter max_fields)"
            )


LONGEST_FRAME = 255
"""Longest name of a frame that is read (characters); chosen. It goes into the header of every
marker and into every diagnostic message."""

DEFAULT_LIMITS = InputLimits()
"""The limits where none are configured, as for recordings."""


@dataclass(frozen=True)
class Content:
    """Where a message type has its objects.

    Attributes:
        name: its list of objects, empty for a point cloud.
        least_bytes: smallest number of bytes of an object in CDR.
        has_header: a ``std_msgs/Header`` comes before the list.
    """

    name: str
    least_bytes: int
    has_header: bool = True


def check_frame(frame_id: str) -> None:
    """Check the length of a frame's name.

    Raises:
        MessageError: it is too long.
    """
    if len(frame_id) > LONGEST_FRAME:
        raise MessageError(
            f"frame_id has {len(frame_id)} characters, expected at most {LONGEST_FRAME}"
        )


def check_serialized(data: bytes, content: Content, limits: InputLimits) -> None:
    """Check sizes and counts of a serialised message (CDR) in constant time.

    Args:
        data: the message with its encoding header.
        content: where its objects are.
        limits: the largest message.

    Raises:
        MessageError: it is too large, cut off before its counts, or contradicts itself.
    """
    if len(data) > limits.max_message_bytes:
        raise MessageError(
            f"message has {len(data)} bytes, expected at most {limits.max_message_bytes} "
            "(parameter max_message_bytes)"
        )
    try:
        position = ENCODING_HEADER
        order = "<" if data[1] & 1 else ">"
        if content.has_header:
            (length,) = struct.unpack_from(order + "I", data, position + 8)
            position += 12 + length
        position += -position % 4
        if content.name:
            (objects,) = struct.unpack_from(order + "I", data, position)
            limits.check_objects(objects)
            check_room("message", "objects", objects, content.least_bytes, len(data) - position)
            return
        height, width, fields = struct.unpack_from(order + "III", data, position)
    except (struct.error, IndexError):
        raise MessageError(f"message of {len(data)} bytes ends before its content") from None
    limits.check_objects(height * width)
    limits.check_fields(fields)
    check_room("message", "fields", fields, FIELD_BYTES, len(data) - position)


def check_room(message: str, what: str, number: int, least_bytes: int, room: int) -> None:
    """Check that the bytes of a message can hold what it says that it has.

    Args:
        message: name of the message, for the error.
        what: name of the items.
        number: how many the message claims.
        least_bytes: smallest size of one.
        room: bytes that follow.

    Raises:
        MessageError: they cannot.
    """
    if number * least_bytes > room + 8:  # the last one's padding may be absent
        raise MessageError(
            f"{message} claims {number} {what}, expected at most {room // least_bytes} in the "
            f"{room} bytes that follow"
        )
