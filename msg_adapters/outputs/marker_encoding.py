# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Markers as plain values, and their encoding as MarkerArray messages or bytes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from msg_adapters.conversions import make_duration, make_header, make_vector
from msg_adapters.types import Types
from msg_adapters.wire.cdr import CdrWriter, write_header
from mtpgo_core.schema import Float64Array

CUBE, CYLINDER, LINE_STRIP, LINE_LIST, TEXT = 1, 3, 4, 5, 9
ADD, DELETE, DELETE_ALL = 0, 2, 3
MARKER, MARKER_ARRAY = "visualization_msgs/msg/Marker", "visualization_msgs/msg/MarkerArray"

NO_POINTS: Float64Array = np.empty((0, 3))


class Drawn(NamedTuple):
    """One marker.

    Attributes:
        ns: namespace. number: id within it. kind: marker type. action: add or delete.
        position: x, y, z (m). yaw: orientation (rad).
        scale: x, y, z (m); a line's width is x.
        colour: r, g, b, a in 0..1.
        points: [k, 3] of a line (m). text: of a text marker.
    """

    ns: str
    number: int
    kind: int = CUBE
    action: int = ADD
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    yaw: float = 0.0
    scale: tuple[float, float, float] = (0.0, 0.0, 0.0)
    colour: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    points: Float64Array = NO_POINTS
    text: str = ""


def markers_to_message(
    markers: Sequence[Drawn], types: Types, *, stamp_ns: int, frame_id: str, lifetime_s: float
) -> Any:
    """Return a MarkerArray message.

    Args:
        markers: its markers, in order.
        types: source of message classes.
        stamp_ns: stamp of every header (ns).
        frame_id: frame of every header.
        lifetime_s: time after which displays drop a marker; 0 keeps it (s).
    """
    header = make_header(types, stamp_ns, frame_id)
    lifetime = make_duration(types, lifetime_s)
    point = types.message_class("geometry_msgs/msg/Point")
    made = []
    for marker in markers:
        r, g, b, a = marker.colour
        made.append(
            types.make(
                MARKER,
                header=header,
                ns=marker.ns,
                id=marker.number,
                type=marker.kind,
                action=marker.action,
                pose=_pose(types, marker),
                scale=make_vector(types, *marker.scale),
                color=types.make("std_msgs/msg/ColorRGBA", r=r, g=g, b=b, a=a),
                lifetime=lifetime,
                points=[point(x=x, y=y, z=z) for x, y, z in marker.points.tolist()],
                text=marker.text,
            )
        )
    return types.make(MARKER_ARRAY, markers=made)


def markers_to_cdr(
    markers: Sequence[Drawn], *, stamp_ns: int, frame_id: str, lifetime_s: float
) -> bytes:
    """Return the bytes of the same MarkerArray; arguments as in :func:`markers_to_message`."""
    writer = CdrWriter()
    lifetime = divmod(round(lifetime_s * 1e9), 1_000_000_000)
    head, textless_end = _head(stamp_ns, frame_id), _end("")
    writer.pack(4, "I", len(markers))
    for marker in markers:
        writer.block(4, head)
        writer.text(marker.ns)
        writer.pack(4, "iii", marker.number, marker.kind, marker.action)
        sin, cos = math.sin(marker.yaw / 2.0), math.cos(marker.yaw / 2.0)
        writer.pack(8, "10d", *marker.position, 0.0, 0.0, sin, cos, *marker.scale)
        writer.pack(4, "4fiI4xI", *marker.colour, *lifetime, len(marker.points))
        writer.doubles(marker.points)
        writer.block(4, _end(marker.text) if marker.text else textless_end)
    return bytes(writer)


def _head(stamp_ns: int, frame_id: str) -> bytes:
    """Return a marker's header, the same for all of an array."""
    writer = CdrWriter()
    write_header(writer, stamp_ns, frame_id)
    return writer.content


def _end(text: str) -> bytes:
    """Return the part of a marker after its points, of which only the text may be filled."""
    writer = CdrWriter()
    writer.pack(4, "I", 0)  # colors
    writer.text("")  # texture_resource
    write_header(writer, 0, "")  # texture
    writer.text("")  # texture.format
    writer.pack(4, "II", 0, 0)  # texture.data, uv_coordinates
    writer.text(text)
    writer.text("")  # mesh_resource
    writer.text("")  # mesh_file.filename
    writer.pack(4, "IB", 0, False)  # mesh_file.data, mesh_use_embedded_materials
    return writer.content


def _pose(types: Types, marker: Drawn) -> Any:
    x, y, z = marker.position
    sin, cos = math.sin(marker.yaw / 2.0), math.cos(marker.yaw / 2.0)
    return types.make(
        "geometry_msgs/msg/Pose",
        position=types.make("geometry_msgs/msg/Point", x=x, y=y, z=z),
        orientation=types.make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=sin, w=cos),
    )
