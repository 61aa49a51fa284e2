# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Plans of the ego: nav_msgs/Path with times, autoware_planning_msgs/Trajectory, odometry."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from msg_adapters.conversions import (
    pose_row,
    reading,
    stamp_to_ns,
    table,
    yaw_from_quaternions,
)
from msg_adapters.inputs.odometry import ODOMETRY, odometry_tilt, pose_of
from msg_adapters.wire.cdr_reader import CdrReader
from msg_adapters.wire.input_limits import check_room
from mtpgo_core.errors import MessageError
from mtpgo_core.risk.ego_plan import EgoPlan, make_plan, plan_of_motion, require_places
from mtpgo_core.schema import Float64Array

_MOST_POSES = 10_000
"""Most poses of a plan; chosen far above any planner, 17 minutes at ten a second. Reading each
takes some 15 us (measured)."""

_STANDS_MPS = 0.05
"""A point of a trajectory with at most this velocity is one at which the vehicle stops (m/s);
chosen: the end of a horizon passes before it has moved by a footprint's rounding."""


_LONGEST_S = 1e6
"""Longest trajectory by its velocities (s); chosen: eleven days."""


@dataclass(frozen=True)
class PlanAdapter:
    """One kind of message that says where the ego will be.

    Attributes:
        name: short name.
        message_type: ROS type.
        topic: name of the topic.
        pose_bytes: smallest size of a pose of its list, which follows the header; 0 without one.
        read: makes a plan of a message; the argument ``stands_after`` says whether the ego stands
            at the end of a plan that has one.
    """

    name: str
    message_type: str
    topic: str
    pose_bytes: int
    read: Callable[[Any, bool], EgoPlan]

    def check_serialized(self, data: bytes) -> None:
        """Check a serialised message (CDR) in constant time, before its poses are decoded.

        Raises:
            MessageError: it has too many poses, or claims more than its bytes can hold.
        """
        if not self.pose_bytes:
            return
        reader = CdrReader(data, self.message_type)
        reader.unpack(4, "iI")
        reader.text()
        (poses,) = reader.unpack(4, "I")
        _check_number(poses)
        check_room(self.message_type, "poses", poses, self.pose_bytes, reader.rest)

    def plan(self, message: Any, *, stands_after: bool = False) -> EgoPlan:
        """Return the plan in a message.

        Raises:
            MessageError: it has no times, not enough poses, numbers that are not finite, or is
                not of that type.
        """
        with reading(message, self.message_type):
            return self.read(message, stands_after)


def plan_from_path(message: Any, stands_after: bool = False) -> EgoPlan:
    """Return the plan in a ``nav_msgs/Path``: each pose's own stamp is its time.

    Raises:
        MessageError: see :meth:`PlanAdapter.plan`; also if poses name different frames.
    """
    _check_number(len(message.poses))
    frame_id = str(message.header.frame_id)
    others = {str(p.header.frame_id) for p in message.poses} - {"", frame_id}
    if others:
        frame_id = frame_id or next(iter(others))
        if others != {frame_id}:
            raise MessageError(
                f"path has poses in the frames {', '.join(map(repr, sorted(others)))} and the "
                f"header {frame_id!r}, expected one frame"
            )
    rows = table([pose_row(pose.pose) for pose in message.poses], 7)
    times = np.array([stamp_to_ns(p.header.stamp) for p in message.poses], dtype=np.int64)
    stamp_ns = stamp_to_ns(message.header.stamp) or (int(times[0]) if len(times) else 0)
    return make_plan(
        stamp_ns,
        frame_id,
        times,
        rows[:, :2],
        yaw_from_quaternions(rows[:, 3:]),
        stands_after=stands_after,
        source="path",
    )


def plan_from_trajectory(message: Any, stands_after: bool = False) -> EgoPlan:
    """Return the plan in an ``autoware_planning_msgs/Trajectory``.

    The times are ``time_from_start``. A planner that leaves those zero gives the velocities: the
    time between two points is then their distance over the mean of both velocities, and where the
    vehicle stops, it stands.

    Raises:
        MessageError: see :meth:`PlanAdapter.plan`.
    """
    points = message.points
    _check_number(len(points))
    stamp_ns = stamp_to_ns(message.header.stamp)
    rows = table([pose_row(point.pose) for point in points], 7)
    offset = np.array([stamp_to_ns(p.time_from_start) for p in points], dtype=np.int64)
    position, yaw = rows[:, :2], yaw_from_quaternions(rows[:, 3:])
    if len(points) > 1 and not offset.any():
        require_places(position, "trajectory")
        speed = np.array([p.longitudinal_velocity_mps for p in points], dtype=np.float64)
        offset, reached = _times_by_speed(position, speed)
        position, yaw = position[: len(offset)], yaw[: len(offset)]
        stands_after = stands_after or reached
    return make_plan(
        stamp_ns,
        str(message.header.frame_id),
        stamp_ns + offset,
        position,
        yaw,
        stands_after=stands_after,
        source="trajectory",
    )


def plan_from_odometry(message: Any, stands_after: bool = False) -> EgoPlan:
    """Return the plan of a ``nav_msgs/Odometry``: its velocity and heading are kept.

    Raises:
        MessageError: see :meth:`PlanAdapter.plan`; also if its frame does not stand upright.
    """
    del stands_after  # this plan has no end
    tilt = odometry_tilt(message)
    if tilt:
        raise MessageError(f"odometry: {tilt}")
    return plan_of_motion(
        stamp_to_ns(message.header.stamp), str(message.header.frame_id), pose_of(message)
    )


def _times_by_speed(position: Float64Array, speed: Float64Array) -> tuple[NDArray[np.int64], bool]:
    """Return when points are passed (ns after the first), and whether the vehicle then stands.

    Points beyond the one at which it stops are left out, and points that are on top of the one
    before.

    Raises:
        MessageError: velocities are not finite, or it would take longer than any drive.
    """
    if not np.isfinite(speed).all():
        raise MessageError("trajectory has neither times nor finite velocities")
    mean = 0.5 * np.abs(speed[:-1] + speed[1:])
    way = np.hypot(*np.diff(position, axis=0).T)
    if not (mean > _STANDS_MPS).any():
        return np.zeros(1, dtype=np.int64), True
    stops = np.flatnonzero((mean <= _STANDS_MPS) & (way > 0.0))
    end = int(stops[0]) if len(stops) else len(mean)
    took = way[:end] / np.maximum(mean[:end], _STANDS_MPS)
    offset = np.concatenate([[0.0], np.cumsum(took)])
    if offset[-1] > _LONGEST_S:
        raise MessageError(
            f"trajectory takes {offset[-1]:.4g} s at its velocities, expected at most"
            f" {_LONGEST_S:g} s"
        )
    # Times must ascend: a point on top of the one before is a nanosecond later.
    steps = np.maximum(np.diff(np.round(offset * 1e9).astype(np.int64)), 1)
    times = np.concatenate([np.zeros(1, dtype=np.int64), np.cumsum(steps)])
    return times, bool(len(stops)) or bool(np.abs(speed[-1]) <= _STANDS_MPS)


def _check_number(poses: int) -> None:
    if poses > _MOST_POSES:
        raise MessageError(f"plan has {poses} poses, expected at most {_MOST_POSES}")


PLANS: dict[str, PlanAdapter] = {
    adapter.name: adapter
    for adapter in (
        PlanAdapter("path", "nav_msgs/msg/Path", "plan", 68, plan_from_path),
        PlanAdapter(
            "autoware", "autoware_planning_msgs/msg/Trajectory", "plan", 88, plan_from_trajectory
        ),
        PlanAdapter("odometry", ODOMETRY, "odometry", 0, plan_from_odometry),
    )
}
"""The messages that say where the ego will be, by short name."""
