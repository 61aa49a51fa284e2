# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""PointCloud2 messages as numpy structured arrays, and back."""

from __future__ import annotations

import functools
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from msg_adapters.conversions import make_header
from msg_adapters.types import Types
from mtpgo_core.errors import MessageError

# sensor_msgs/PointField datatype numbers.
_DATATYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
_NUMBERS = {np.dtype(code): number for number, code in _DATATYPES.items()}


_LARGEST_STEP = (1 << 31) - 1
"""Largest point_step that numpy takes (bytes)."""


def cloud_to_records(message: Any) -> NDArray[Any]:
    """Return a [points] structured view of a cloud's data, with one name per field.

    Fields with a count other than one, or without a name, are left out. Organised clouds (height
    above one) are flattened row by row. The sizes are compared before anything is read, and the
    time grows with the number of bytes and fields only.

    Raises:
        MessageError: the layout is inconsistent or does not fit the data.
    """
    rows, columns = int(message.height), int(message.width)
    layout = _record_type(message)
    row_step = int(message.row_step)
    needed = columns * layout.itemsize
    data = _octets(message.data)
    if rows * columns == 0:
        return np.empty(0, dtype=layout)
    if layout.itemsize == 0:
        raise MessageError(f"point cloud has point_step 0, expected the bytes of {columns} points")
    if rows > 1 and row_step < needed:
        raise MessageError(
            f"point cloud has row_step {row_step}, expected at least width x point_step = {needed}"
        )
    # Many publishers leave the row_step of a cloud of one row unset; it is not used then.
    total = (rows - 1) * row_step + needed
    if len(data) < total:
        raise MessageError(
            f"point cloud has {len(data)} bytes of data, expected {total} for "
            f"{rows} x {columns} points of {layout.itemsize} bytes"
        )
    if rows == 1 or row_step == needed:
        return np.frombuffer(data, dtype=layout, count=rows * columns)
    steps = (row_step, layout.itemsize)
    return np.ndarray((rows, columns), layout, data, strides=steps).reshape(-1)


def require_fields(records: NDArray[Any], names: Iterable[str], content: str) -> None:
    """Check that the points of a cloud have fields.

    Args:
        records: [points] of :func:`cloud_to_records`.
        names: the fields.
        content: what the cloud should hold, for the error.

    Raises:
        MessageError: a field is missing.
    """
    missing = [name for name in names if name not in (records.dtype.names or ())]
    if missing:
        raise MessageError(
            f"point cloud lacks the field {', '.join(missing)}, so it holds no {content}"
        )


def records_to_cloud(
    records: NDArray[Any], types: Types, *, stamp_ns: int, frame_id: str, is_dense: bool
) -> Any:
    """Return an unorganised little-endian PointCloud2 of [points] records.

    Args:
        records: [points] structured array; the fields of the message are those of its dtype.
        types: source of message classes.
        stamp_ns: header stamp (ns).
        frame_id: header frame.
        is_dense: no field is NaN.
    """
    layout = records.dtype
    fields = []
    for name in layout.names or ():
        kind, offset = layout.fields[name][:2]  # type: ignore[index]
        fields.append(
            types.make(
                "sensor_msgs/msg/PointField",
                name=name,
                offset=int(offset),
                datatype=_NUMBERS[kind],
                count=1,
            )
        )
    flat = np.ascontiguousarray(records).reshape(-1)
    return types.make(
        "sensor_msgs/msg/PointCloud2",
        header=make_header(types, stamp_ns, frame_id),
        height=1,
        width=len(flat),
        fields=fields,
        is_bigendian=False,
        point_step=layout.itemsize,
        row_step=layout.itemsize * len(flat),
        data=types.octets(flat.view(np.uint8)),
        is_dense=bool(is_dense),
    )


def _octets(data: Any) -> memoryview:
    try:
        return memoryview(data).cast("B")
    except TypeError:
        return memoryview(bytes(data))


def _record_type(message: Any) -> np.dtype[Any]:
    fields = tuple(
        (field.name, int(field.offset), int(field.datatype), int(field.count))
        for field in message.fields
    )
    return _layout(fields, int(message.point_step), ">" if message.is_bigendian else "<")


@functools.lru_cache(maxsize=8)  # all clouds of a publisher have the same layout
def _layout(fields: tuple[tuple[str, int, int, int], ...], step: int, order: str) -> np.dtype[Any]:
    if step > _LARGEST_STEP:
        raise MessageError(f"point cloud has point_step {step}, expected at most {_LARGEST_STEP}")
    names: dict[str, None] = {}
    formats, offsets = [], []
    for name, offset, datatype, count in fields:
        if count not in (0, 1) or not name:
            continue
        code = _DATATYPES.get(datatype)
        if code is None:
            raise MessageError(
                f"point cloud field {name!r} has datatype {datatype}, expected 1 to 8"
            )
        kind = np.dtype(order + code)
        if offset + kind.itemsize > step:
            raise MessageError(
                f"point cloud field {name!r} ends at byte "
                f"{offset + kind.itemsize}, expected at most point_step = {step}"
            )
        if name in names:
            raise MessageError(f"point cloud has two fields of the name {name!r}")
        names[name] = None
        formats.append(kind)
        offsets.append(offset)
    return np.dtype(
        {"names": list(names), "formats": formats, "offsets": offsets, "itemsize": step}
    )
