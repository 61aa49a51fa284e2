# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A serialised PointCloud2 as an object with the message's fields, without a message class."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

from msg_adapters.wire.cdr_reader import CdrReader
from msg_adapters.wire.input_limits import DEFAULT_LIMITS, FIELD_BYTES, check_frame, check_room
from mtpgo_core.errors import MessageError


class _Stamp(NamedTuple):
    sec: int
    nanosec: int


class _Header(NamedTuple):
    stamp: _Stamp
    frame_id: str


@dataclass(frozen=True)
class _PointField:
    name: str
    offset: int
    datatype: int
    count: int


class CloudContent(NamedTuple):
    """The fields of a ``sensor_msgs/PointCloud2``; :func:`cloud_to_records` reads it like one."""

    header: _Header
    height: int
    width: int
    fields: list[_PointField]
    is_bigendian: bool
    point_step: int
    row_step: int
    data: memoryview
    is_dense: bool


def cloud_from_cdr(data: Any) -> CloudContent:
    """Return the content of a serialised ``sensor_msgs/PointCloud2``.

    Args:
        data: its CDR bytes with the encoding header, of either byte order, as a subscription with
            ``raw=True`` or a bag gives them; the points are not copied.

    Raises:
        MessageError: the bytes are not plain CDR, end too early, or have more fields or a longer
            name of the frame than any.
    """
    reader = CdrReader(data, "point cloud")
    stamp = _Stamp(*reader.unpack(4, "iI"))
    header = _Header(stamp, reader.text())
    check_frame(header.frame_id)
    height, width, count = reader.unpack(4, "III")
    if count > DEFAULT_LIMITS.max_fields:
        raise MessageError(
            f"point cloud has {count} fields, expected at most {DEFAULT_LIMITS.max_fields}"
        )
    check_room("point cloud", "fields", count, FIELD_BYTES, reader.rest)
    fields = []
    for _ in range(count):
        name = reader.text()
        (offset,) = reader.unpack(4, "I")
        (datatype,) = reader.unpack(1, "B")
        fields.append(_PointField(name, offset, datatype, *reader.unpack(4, "I")))
    (is_bigendian,) = reader.unpack(1, "B")
    point_step, row_step = reader.unpack(4, "II")
    points = reader.octets()
    (is_dense,) = reader.unpack(1, "B")
    return CloudContent(
        header,
        height,
        width,
        fields,
        bool(is_bigendian),
        point_step,
        row_step,
        points,
        bool(is_dense),
    )
