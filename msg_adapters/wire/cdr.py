# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Writing of CDR, the bytes of ROS messages, without message objects.

A MarkerArray of sixty agents has tens of thousands of Point objects, which take rclpy a tenth of a
second to make and to serialise. Publishers accept bytes as well, and in bytes a block of points is
one copy. Only messages where it matters are written this way; each is tested against the same
message made of objects.
"""

from __future__ import annotations

import struct
from typing import Any

import numpy as np

_LITTLE_ENDIAN = b"\x00\x01\x00\x00"


class CdrWriter:
    """Plain CDR (XCDR1), little-endian: every value is aligned to its own size."""

    def __init__(self) -> None:
        self._data = bytearray(_LITTLE_ENDIAN)

    def __bytes__(self) -> bytes:
        return bytes(self._data)

    @property
    def content(self) -> bytes:
        """The bytes written, without the four bytes of the encoding header."""
        return bytes(self._data[len(_LITTLE_ENDIAN) :])

    def pack(self, size: int, layout: str, *values: Any) -> None:
        """Append values without gaps after aligning the first to ``size`` bytes.

        Args:
            size: alignment (bytes).
            layout: ``struct`` format without the byte order.
            values: values of the format.
        """
        self._align(size)
        self._data += struct.pack("<" + layout, *values)

    def text(self, value: str) -> None:
        """Append a string: its length with the terminating zero, its UTF-8 bytes, the zero."""
        octets = value.encode() + b"\x00"
        self.pack(4, "I", len(octets))
        self._data += octets

    def doubles(self, values: np.ndarray) -> None:
        """Append float64 values, also points or poses of float64, without a count."""
        if values.size:
            self._align(8)
            self._data += np.ascontiguousarray(values, dtype="<f8").tobytes()

    def block(self, size: int, values: bytes) -> None:
        """Append encoded bytes, aligned to ``size`` bytes, the largest alignment in them."""
        self._align(size)
        self._data += values

    def _align(self, size: int) -> None:
        # Counted from the end of the encoding header.
        excess = (len(self._data) - len(_LITTLE_ENDIAN)) % size
        if excess:
            self._data += bytes(size - excess)


def write_header(writer: CdrWriter, stamp_ns: int, frame_id: str) -> None:
    """Append a ``std_msgs/Header`` of a stamp (ns) and a frame."""
    writer.pack(4, "iI", *divmod(stamp_ns, 1_000_000_000))
    writer.text(frame_id)
