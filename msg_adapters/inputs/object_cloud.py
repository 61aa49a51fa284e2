# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Tracked objects as a PointCloud2, one point per object: our own input layout.

It needs no third-party message package and holds everything the core can use. Fields are found
by name, so their order and further fields do not matter. Only ``x``, ``y`` and ``id_0`` are
required; what is absent or not finite is unknown. See docs/messages.md.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from msg_adapters.adapter import Decoded, InputAdapter, known_classes
from msg_adapters.conversions import (
    finite,
    positive,
    stamp_to_ns,
    to_header_frame,
    turn_velocity,
)
from msg_adapters.types import Types
from msg_adapters.wire.cloud import cloud_to_records, records_to_cloud
from msg_adapters.wire.input_limits import Content
from mtpgo_core.errors import MessageError, found_names
from mtpgo_core.schema import Float64Array, KeyArray, TrackedStates, tracked_states

KEY_FIELDS = ("id_0", "id_1", "id_2", "id_3")
"""Fields of the identity, least significant word first (:mod:`mtpgo_core.identity`)."""

COVARIANCE_FIELDS = {
    "cov_xx": (0, 0),
    "cov_xy": (0, 1),
    "cov_xvx": (0, 2),
    "cov_xvy": (0, 3),
    "cov_yy": (1, 1),
    "cov_yvx": (1, 2),
    "cov_yvy": (1, 3),
    "cov_vxvx": (2, 2),
    "cov_vxvy": (2, 3),
    "cov_vyvy": (3, 3),
}
"""Fields of the upper triangle of the covariance of (x, y, vx, vy), with their indices."""

_STATE = np.dtype(
    [(name, "<f8") for name in ("x", "y", "z")]
    + [(name, "<f4") for name in ("vx", "vy", "ax", "ay", "yaw", "length", "width")]
    + [(name, "<u4") for name in KEY_FIELDS]
)
_COVARIANCE = [(name, "<f4") for name in COVARIANCE_FIELDS]


def decode_cloud(
    message: Any, *, twist_frame: str = "header", fallback_stamp_ns: int | None = None
) -> Decoded:
    """Return the tracked states of a cloud of objects.

    Args:
        message: ``sensor_msgs/PointCloud2``.
        twist_frame: ``header``, or ``object`` for velocities and accelerations, with their
            covariances, along the box's own axes.
        fallback_stamp_ns: not needed, the cloud carries its time.

    Raises:
        MessageError: a required field is missing, or the layout is invalid.
    """
    records = cloud_to_records(message)
    names = records.dtype.names or ()
    missing = [name for name in ("x", "y", "id_0") if name not in names]
    if missing:
        raise MessageError(
            f"point cloud lacks the field {', '.join(missing)} of tracked objects, its fields "
            f"are {found_names(names)}"
        )
    if "mode" in names and "step" in names:
        raise MessageError(
            "point cloud has the fields mode and step, so it holds predictions; expected "
            "tracked objects"
        )
    yaw = _column(records, "yaw")
    velocity, acceleration = (
        to_header_frame(_columns(records, pair), yaw, twist_frame)
        for pair in (("vx", "vy"), ("ax", "ay"))
    )
    covariance = _covariance(records)
    if covariance is not None and twist_frame == "object":
        covariance = turn_velocity(covariance, yaw)
    states = tracked_states(
        stamp_to_ns(message.header.stamp),
        str(message.header.frame_id),
        _keys(records),
        _columns(records, ("x", "y")),
        agent_class=known_classes(records["class"]) if "class" in names else None,
        z=_column(records, "z"),
        velocity=velocity,
        acceleration=acceleration,
        yaw=yaw,
        size=positive(_columns(records, ("length", "width"))),
        covariance=covariance,
    )
    return Decoded(states)


def states_to_pointcloud2(states: TrackedStates, types: Types) -> Any:
    """Return a cloud that :func:`decode_cloud` reads back to float32 (positions: float64).

    The ten covariance fields are left out when no object has any.
    """
    has_covariance = bool(np.isfinite(states.covariance).any())
    fields = [(name, _STATE[name]) for name in _STATE.names or ()]
    layout = np.dtype(fields + (_COVARIANCE if has_covariance else []) + [("class", "<u1")])
    records = np.zeros(len(states), dtype=layout)
    records["x"], records["y"] = states.position.T
    records["z"] = states.z
    records["vx"], records["vy"] = states.velocity.T
    records["ax"], records["ay"] = states.acceleration.T
    records["yaw"] = states.yaw
    records["length"], records["width"] = states.size.T
    for word, name in enumerate(KEY_FIELDS):
        records[name] = states.key[:, word]
    if has_covariance:
        for name, (row, column) in COVARIANCE_FIELDS.items():
            records[name] = states.covariance[:, row, column]
    records["class"] = states.agent_class
    dense = all(np.isfinite(records[name]).all() for name in layout.names or ())
    return records_to_cloud(
        records, types, stamp_ns=states.stamp_ns, frame_id=states.frame_id, is_dense=dense
    )


def _column(records: NDArray[Any], name: str) -> Float64Array:
    if name not in (records.dtype.names or ()):
        return np.full(len(records), np.nan)
    return finite(records[name])


def _columns(records: NDArray[Any], names: tuple[str, ...]) -> Float64Array:
    return np.stack([_column(records, name) for name in names], axis=-1)


def _keys(records: NDArray[Any]) -> KeyArray:
    key = np.zeros((len(records), 4), dtype=np.uint32)
    for word, name in enumerate(KEY_FIELDS):
        if name not in (records.dtype.names or ()):
            continue
        values = records[name]
        if values.dtype.kind not in "iu":
            raise MessageError(f"point cloud field {name!r} is not an integer, expected UINT32")
        key[:, word] = values.astype(np.uint32)
    return key


def _covariance(records: NDArray[Any]) -> Float64Array | None:
    names = records.dtype.names or ()
    if not any(name in names for name in COVARIANCE_FIELDS):
        return None
    out = np.full((len(records), 4, 4), np.nan)
    for name, (row, column) in COVARIANCE_FIELDS.items():
        out[:, row, column] = out[:, column, row] = _column(records, name)
    return out


POINTCLOUD2 = InputAdapter(
    name="pointcloud2",
    message_type="sensor_msgs/msg/PointCloud2",
    twist_frame="header",
    content=Content("", 1),
    decoder=decode_cloud,
    builder=states_to_pointcloud2,
)
