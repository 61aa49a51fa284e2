# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Reading of CDR, the bytes of ROS messages, where neither rclpy nor rosbags is installed."""

from __future__ import annotations

import math
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.errors import MessageError

ENCODING_HEADER = 4
"""Bytes before the content: two of the encoding, the second of which says the byte
order, and two of options."""

_BYTE_ORDERS = {0: ">", 1: "<"}
"""Encoding (PLAIN_CDR of XCDR1) -> byte order as ``struct`` names it."""


class CdrReader:
    """Plain CDR (XCDR1) of either byte order; every value is aligned to its own size.

    Args:
        data: the message with its encoding header; it is not copied.
        what: name of the message, for errors.

    Raises:
        MessageError: the bytes are not plain CDR.
    """

    def __init__(self, data: Any, what: str) -> None:
        self._what = what
        try:
            self._data = memoryview(data).cast("B")
        except TypeError:
            raise MessageError(f"{what} is a {type(data).__name__}, expected bytes") from None
        if len(self._data) < ENCODING_HEADER:
            raise MessageError(
                f"{what} has {len(self._data)} bytes, expected at least {ENCODING_HEADER}"
            )
        encoding = int.from_bytes(self._data[:2], "big")
        if encoding not in _BYTE_ORDERS:
            raise MessageError(
                f"{what} has the encoding {encoding:#06x}, expected plain CDR (0x0000 or 0x0001)"
            )
        self._order = _BYTE_ORDERS[encoding]
        self._place = ENCODING_HEADER

    @property
    def rest(self) -> int:
        """Number of bytes that were not read yet."""
        return len(self._data) - self._place

    def unpack(self, size: int, layout: str) -> tuple[Any, ...]:
        """Return values without gaps, after aligning the first to ``size`` bytes.

        Args:
            size: alignment (bytes).
            layout: ``struct`` format without the byte order.

        Raises:
            MessageError: the bytes end before.
        """
        self._place += -(self._place - ENCODING_HEADER) % size
        length = struct.calcsize("<" + layout)
        return struct.unpack(self._order + layout, self._take(length))

    def doubles(self, *shape: int) -> NDArray[np.float64]:
        """Return an array of float64, also the points or poses of float64 of a list.

        Args:
            shape: of the array; nothing is read or aligned for one without values.

        Raises:
            MessageError: the bytes end before.
        """
        count = math.prod(shape)
        if not count:
            return np.zeros(shape)
        self._place += -(self._place - ENCODING_HEADER) % 8
        values = np.frombuffer(self._take(8 * count), dtype=self._order + "f8")
        return values.astype(np.float64).reshape(shape)

    def text(self) -> str:
        """Return a string; bytes that are not UTF-8 are replaced.

        Raises:
            MessageError: the bytes end before.
        """
        (length,) = self.unpack(4, "I")
        return bytes(self._take(length)).rstrip(b"\x00").decode("utf-8", "replace")

    def octets(self) -> memoryview:
        """Return the content of a ``uint8[]``, without a copy.

        Raises:
            MessageError: the bytes end before.
        """
        (length,) = self.unpack(4, "I")
        return self._take(length)

    def _take(self, length: int) -> memoryview:
        if length > len(self._data) - self._place:
            raise MessageError(
                f"{self._what} of {len(self._data)} bytes is cut off: {length} bytes were expected"
                f" from byte {self._place} on"
            )
        start, self._place = self._place, self._place + length
        return self._data[start : self._place]
