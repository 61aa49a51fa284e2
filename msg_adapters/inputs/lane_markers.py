# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Lane markings as LINE_STRIP markers of a latched topic, encoding and decoding."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from msg_adapters.conversions import make_header, make_vector, pose_row, yaw_from_quaternions
from msg_adapters.types import Types
from msg_adapters.wire.cdr_reader import CdrReader
from msg_adapters.wire.input_limits import check_room
from mtpgo_core.errors import MessageError
from mtpgo_core.maps.lane_lines import LONGEST_M
from mtpgo_core.schema import FARTHEST_M, Float64Array

NAMESPACE = "lane_markings"
_LINE_STRIP, _LINE_LIST = 4, 5
_ADD = 0
MOST_POINTS = 200_000
"""Most points of a site's lane markings; chosen: 200 km of lines with a point each metre."""

MOST_BYTES = 8 << 20
"""Largest serialised message that is decoded (bytes); chosen: so many points, with room for the
rest of some thousands of markers."""

MOST_MARKERS = 10_000
"""Most markers of a message; chosen: the lines of a town. Each takes 0.1 ms (measured)."""

_MARKER_BYTES = 100
"""Smallest size of a marker; chosen below its pose, scale and colour, 96 bytes, and the rest."""


@dataclass(frozen=True)
class LaneMarkings:
    """Lane markings of a site.

    Attributes:
        frame_id: frame of the points, empty if there is no line.
        polylines: [k, 2] points of each line (m), k >= 2.
    """

    frame_id: str
    polylines: tuple[Float64Array, ...]


def lanes_to_markers(
    polylines: Sequence[Float64Array], types: Types, *, stamp_ns: int, frame_id: str
) -> Any:
    """Return a MarkerArray with one white LINE_STRIP per polyline, to be published latched.

    Args:
        polylines: [k, 2] points each (m).
        types: source of message classes.
        stamp_ns: header stamp (ns).
        frame_id: frame of the points.
    """
    header = make_header(types, stamp_ns, frame_id)
    point = types.message_class("geometry_msgs/msg/Point")
    markers = []
    for number, line in enumerate(polylines):
        points = [point(x=x, y=y, z=0.0) for x, y in np.asarray(line, np.float64)[:, :2].tolist()]
        markers.append(
            types.make(
                "visualization_msgs/msg/Marker",
                header=header,
                ns=NAMESPACE,
                id=number,
                type=_LINE_STRIP,
                action=_ADD,
                scale=make_vector(types, 0.15, 0.0),
                color=types.make("std_msgs/msg/ColorRGBA", r=0.9, g=0.9, b=0.9, a=0.8),
                points=points,
            )
        )
    return types.make("visualization_msgs/msg/MarkerArray", markers=markers)


def check_serialized(data: bytes) -> None:
    """Check a serialised MarkerArray (CDR) in constant time, before its markers are decoded.

    Raises:
        MessageError: it is too large, or claims more markers than its bytes can hold.
    """
    if len(data) > MOST_BYTES:
        raise MessageError(f"lane markings have {len(data)} bytes, expected at most {MOST_BYTES}")
    reader = CdrReader(data, "lane markings")
    (markers,) = reader.unpack(4, "I")
    if markers > MOST_MARKERS:
        raise MessageError(
            f"lane markings have {markers} markers, expected at most {MOST_MARKERS}"
        )
    check_room("lane markings", "markers", markers, _MARKER_BYTES, reader.rest)


def lanes_from_markers(message: Any) -> LaneMarkings:
    """Return the lines of LINE_STRIP markers, and each segment of LINE_LIST markers.

    Markers of other types, deletions and lines with fewer than two finite points are left out;
    coordinates beyond :data:`~mtpgo_core.schema.FARTHEST_M` count as not finite.

    Args:
        message: ``visualization_msgs/MarkerArray``.

    Raises:
        MessageError: the lines are in different frames, two consecutive points are too far apart
            for a lane, or the message is malformed or too large.
    """
    lines: list[Float64Array] = []
    frames: dict[str, None] = {}
    try:
        number = sum(len(marker.points) for marker in message.markers)
        if number > MOST_POINTS:
            raise MessageError(
                f"lane markings have {number} points, expected at most {MOST_POINTS}"
            )
        for marker in message.markers:
            if int(marker.action) != _ADD or int(marker.type) not in (_LINE_STRIP, _LINE_LIST):
                continue
            frames[str(marker.header.frame_id)] = None
            points = _placed(marker)
            if int(marker.type) == _LINE_STRIP:
                lines.append(points)
            else:
                lines.extend(points[: len(points) // 2 * 2].reshape(-1, 2, 2))
    except (AttributeError, TypeError, ValueError) as error:
        raise MessageError(f"message cannot be read as lane markings: {error}") from error
    if len(frames) > 1:
        raise MessageError(
            f"lane markings are in the frames {', '.join(map(repr, frames))}, expected one"
        )
    known = [line[(np.abs(line) <= FARTHEST_M).all(axis=1)] for line in lines]
    usable = tuple(line for line in known if len(line) > 1)
    longest_m = max((np.hypot(*np.diff(line, axis=0).T).max() for line in usable), default=0.0)
    if longest_m > LONGEST_M:
        raise MessageError(
            f"lane markings have two consecutive points that are {longest_m * 1e-3:.4g} km apart,"
            f" expected at most {LONGEST_M * 1e-3:g} km"
        )
    return LaneMarkings(next(iter(frames), ""), usable)


def _placed(marker: Any) -> Float64Array:
    """Return [k, 2] the points of a marker (m), its pose applied."""
    points = np.array([(p.x, p.y) for p in marker.points], dtype=np.float64).reshape(-1, 2)
    x, y, _, *quaternion = pose_row(marker.pose)
    yaw = float(np.nan_to_num(yaw_from_quaternions(np.array([quaternion], dtype=np.float64))[0]))
    turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    with np.errstate(invalid="ignore"):  # an infinite coordinate
        return np.asarray(points @ turn.T + (x, y))
