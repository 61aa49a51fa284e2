# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Planar frames: poses, rotations of vectors and covariances, transform into a fixed frame.

A pose is the position and yaw of a frame in another one. To express a vector of the frame in the
other one, it is rotated by the pose's yaw; a point is also shifted by the pose's position.
"""

from __future__ import annotations

import dataclasses
import math
from bisect import bisect_left, bisect_right
from dataclasses import dataclass

import numpy as np

from mtpgo_core.errors import FrameError
from mtpgo_core.schema import FARTHEST_M, Float64Array, TrackedStates

VEHICLE_FRAMES = ("base_link", "base_footprint", "ego_vehicle", "vehicle", "hero")
"""Usual names of frames that move with a vehicle, for a warning."""


def moves_with_vehicle(frame_id: str) -> bool:
    """Return whether a frame usually moves with a vehicle, by its name without a prefix."""
    return frame_id.rpartition("/")[2] in VEHICLE_FRAMES


def wrap(angle: Float64Array) -> Float64Array:
    """Return angles (rad) wrapped to (-pi, pi]."""
    return -((np.pi - angle) % (2.0 * np.pi) - np.pi)


def rotate(vector: Float64Array, angle: Float64Array | float) -> Float64Array:
    """Return vectors [..., 2] rotated by ``angle`` (rad, broadcast against the leading axes)."""
    cos, sin = np.cos(angle), np.sin(angle)
    x, y = vector[..., 0], vector[..., 1]
    return np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)


def own_heading(velocity: Float64Array, yaw: Float64Array) -> Float64Array:
    """Return [...] heading of an agent's own frame (rad): of its motion, or its yaw if it is slow.

    The same blend as the network's :func:`models.own_frame.agent_frames.heading`: the velocity
    alone from 1 m/s on, the yaw alone up to 0.5 m/s. NaN where neither gives a heading.

    Args:
        velocity: [..., 2] (m/s), NaN where unknown.
        yaw: [...] (rad), NaN where unknown.
    """
    velocity = np.where(np.isfinite(velocity), velocity, 0.0)
    speed = np.hypot(velocity[..., 0], velocity[..., 1])
    moving = np.clip(2.0 * speed - 1.0, 0.0, 1.0)
    yaw = np.where(moving == 1.0, 0.0, yaw)  # without effect there, so it need not be known
    share, rest = moving / np.maximum(speed, 0.5), 1.0 - moving
    x = share * velocity[..., 0] + rest * np.cos(yaw)
    y = share * velocity[..., 1] + rest * np.sin(yaw)
    return np.where(np.hypot(x, y) > 0.1, np.arctan2(y, x), np.nan)


def rotate_covariance(covariance: Float64Array, angle: Float64Array | float) -> Float64Array:
    """Return R C R^T for covariances [..., S, S] of S/2 planar vectors rotated by ``angle`` (rad).

    S is 2 (position) or 4 (position, velocity). Each 2x2 block is rotated by itself: one that is
    not known (NaN) leaves the others as they are.
    """
    cos, sin = np.cos(np.asarray(angle)), np.sin(np.asarray(angle))
    turn = np.stack([np.stack([cos, -sin], axis=-1), np.stack([sin, cos], axis=-1)], axis=-2)
    back = np.swapaxes(turn, -1, -2)
    starts = range(0, covariance.shape[-1], 2)
    rows = [
        np.concatenate(
            [turn @ covariance[..., i : i + 2, j : j + 2] @ back for j in starts], axis=-1
        )
        for i in starts
    ]
    return np.concatenate(rows, axis=-2)


def along_and_across(
    covariance: Float64Array, angle: Float64Array
) -> tuple[Float64Array, Float64Array, Float64Array]:
    """Return the entries of covariances in frames turned by ``angle``, without a matrix product.

    Args:
        covariance: [..., 2, 2].
        angle: [...] direction of the frames' x axes (rad).

    Returns:
        [...] variance along the direction, covariance of along and across, variance across.
    """
    xx, xy, yy = covariance[..., 0, 0], covariance[..., 0, 1], covariance[..., 1, 1]
    c, s = np.cos(angle), np.sin(angle)
    along = c * c * xx + 2.0 * c * s * xy + s * s * yy
    across = s * s * xx - 2.0 * c * s * xy + c * c * yy
    return along, c * s * (yy - xx) + (c * c - s * s) * xy, across


@dataclass(frozen=True)
class Pose2:
    """Position, yaw and motion of a frame in another one.

    Attributes:
        x, y: its origin (m).
        yaw: its rotation (rad).
        velocity: its origin's velocity along the axes of the *other* frame (m/s).
        yaw_rate: its rate of rotation (rad/s).
    """

    x: float
    y: float
    yaw: float
    velocity: tuple[float, float] = (0.0, 0.0)
    yaw_rate: float = 0.0

    def point(self, point: Float64Array) -> Float64Array:
        """Return points [..., 2] of this frame in the other frame."""
        return rotate(point, self.yaw) + np.array((self.x, self.y))

    def inverse_point(self, point: Float64Array) -> Float64Array:
        """Return points [..., 2] of the other frame in this one."""
        return rotate(point - np.array((self.x, self.y)), -self.yaw)

    def inverse(self) -> Pose2:
        """Return the pose of the other frame in this one, without motion."""
        x, y = self.inverse_point(np.zeros(2))
        return Pose2(x=float(x), y=float(y), yaw=-self.yaw)


def to_fixed_frame(
    states: TrackedStates, pose: Pose2, frame_id: str, *, relative_velocity: bool = False
) -> TrackedStates:
    """Return states of a vehicle's frame, transformed into the fixed frame.

    Args:
        states: in the vehicle's frame.
        pose: of the vehicle in the fixed frame at the states' stamp.
        frame_id: name of the fixed frame.
        relative_velocity: the velocities are relative to the moving vehicle (a radar's), so the
            vehicle's velocity at each position is added; by default they are over ground and only
            rotated.

    Raises:
        FrameError: the pose is not finite, or its motion where that is needed.
    """
    motion = (*pose.velocity, pose.yaw_rate) if relative_velocity else ()
    values = (pose.x, pose.y, pose.yaw, *motion)
    if not all(map(math.isfinite, values)):
        raise FrameError(
            f"the pose of frame {states.frame_id!r} in {frame_id!r} at {states.stamp_ns} ns is "
            f"{values}, expected finite numbers"
        )
    position = pose.point(states.position)
    velocity = rotate(states.velocity, pose.yaw)
    if relative_velocity:
        arm = position - np.array((pose.x, pose.y))
        turning = pose.yaw_rate * np.stack([-arm[:, 1], arm[:, 0]], axis=1)
        velocity = velocity + np.array(pose.velocity) + turning
    return dataclasses.replace(
        states,
        frame_id=frame_id,
        position=position,
        velocity=velocity,
        acceleration=rotate(states.acceleration, pose.yaw),
        yaw=wrap(states.yaw + pose.yaw),
        covariance=rotate_covariance(states.covariance, pose.yaw),
    )


def is_place(x: float, y: float) -> bool:
    """Return whether coordinates (m) are finite and within :data:`FARTHEST_M`."""
    return abs(x) <= FARTHEST_M and abs(y) <= FARTHEST_M  # false for NaN


_SHORTEST_NS, _LONGEST_NS = 50_000_000, 500_000_000
"""Two poses so far apart in time tell a motion (ns); chosen: noise hardly matters then, and a
vehicle goes on like that."""


class PoseBuffer:
    """The last poses of one frame in another, interpolated at any time.

    Args:
        span_s: how long poses are kept (s).
        max_extrapolation_s: longest extrapolation after the newest or before the oldest pose (s).
        max_gap_s: longest time between two poses that is interpolated (s).
        set_back_s: a pose that is older than the newest one by more than this, or by more than
            the span, means that the clock was set back (s).

    Attributes:
        max_extrapolation_s: as given.
    """

    def __init__(
        self,
        span_s: float = 10.0,
        max_extrapolation_s: float = 0.2,
        max_gap_s: float = math.inf,
        set_back_s: float = math.inf,
    ) -> None:
        self.max_extrapolation_s = max_extrapolation_s
        self._max_gap_s = max_gap_s
        self._span_ns = round(span_s * 1e9)
        self._set_back_ns = round(min(span_s, set_back_s) * 1e9)
        self._reach_ns = round(max_extrapolation_s * 1e9)
        self._stamp: list[int] = []
        self._pose: list[Pose2] = []
        self._twist_filled = False  # ever

    def __len__(self) -> int:
        return len(self._stamp)

    def clear(self) -> None:
        """Forget all poses."""
        self._stamp.clear()
        self._pose.clear()

    def add(self, stamp_ns: int, pose: Pose2) -> bool:
        """Add a pose; return false if it is no place or its stamp exists already.

        When the clock was set back, all earlier poses are forgotten: they are those of another
        time, and would be mixed with the new ones.
        """
        if not (math.isfinite(pose.yaw) and is_place(pose.x, pose.y)):
            return False
        if self._stamp and stamp_ns < self._stamp[-1] - self._set_back_ns:
            self.clear()
        place = bisect_left(self._stamp, stamp_ns)
        if place < len(self._stamp) and self._stamp[place] == stamp_ns:
            return False
        motion = (*pose.velocity, pose.yaw_rate)
        self._twist_filled |= any(motion) and all(map(math.isfinite, motion))
        self._stamp.insert(place, stamp_ns)
        self._pose.insert(place, pose)
        old = bisect_left(self._stamp, self._stamp[-1] - self._span_ns)
        del self._stamp[:old], self._pose[:old]
        return True

    def at(self, stamp_ns: int) -> Pose2:
        """Return the pose at a time (ns), interpolated, the yaw along the shorter arc.

        Outside the stored times the nearest pose is extrapolated by its velocity and yaw rate.
        Where these are not finite, or none has ever been but zero, as of odometry without a
        twist, it is by the poses next to it; a single pose stays.

        Raises:
            FrameError: no pose is near enough in time.
        """
        if not self._stamp:
            raise FrameError(
                f"no pose is known at {stamp_ns} ns, expected odometry before objects"
            )
        place = bisect_left(self._stamp, stamp_ns)
        if 0 < place < len(self._stamp):
            before, after = self._stamp[place - 1], self._stamp[place]
            if (after - before) * 1e-9 > self._max_gap_s and after != stamp_ns:
                raise FrameError(
                    f"the poses before and after {stamp_ns} ns are"
                    f" {(after - before) * 1e-9:.3f} s apart, expected at most"
                    f" {self._max_gap_s:.3f} s"
                )
            return _between(
                self._pose[place - 1], self._pose[place], (stamp_ns - before) / (after - before)
            )
        nearest = 0 if place == 0 else -1
        off_ns = stamp_ns - self._stamp[nearest]
        if abs(off_ns) > self._reach_ns:
            raise FrameError(
                f"the nearest pose to {stamp_ns} ns is {abs(off_ns) * 1e-9:.3f} s away, expected "
                f"at most {self._reach_ns * 1e-9:.3f} s"
            )
        pose, off_s = self._pose[nearest], off_ns * 1e-9
        velocity_x, velocity_y, yaw_rate = self._motion(nearest)
        return dataclasses.replace(
            pose,
            x=pose.x + velocity_x * off_s,
            y=pose.y + velocity_y * off_s,
            yaw=float(wrap(np.asarray(pose.yaw + yaw_rate * off_s))),
        )

    def _motion(self, end: int) -> tuple[float, float, float]:
        """Return velocity (m/s) and yaw rate (rad/s) of the oldest pose, 0, or the newest, -1."""
        pose, stamp_ns = self._pose[end], self._stamp[end]
        given = (*pose.velocity, pose.yaw_rate)
        if self._twist_filled and all(map(math.isfinite, given)):
            return given
        if end == 0:
            other = bisect_left(self._stamp, stamp_ns + _SHORTEST_NS)
        else:
            other = bisect_right(self._stamp, stamp_ns - _SHORTEST_NS) - 1
        if not 0 <= other < len(self._stamp):
            return 0.0, 0.0, 0.0
        took_ns = stamp_ns - self._stamp[other]
        if abs(took_ns) > _LONGEST_NS:
            return 0.0, 0.0, 0.0
        before, per_s = self._pose[other], 1e9 / took_ns
        turn = float(wrap(np.asarray(pose.yaw - before.yaw)))
        return (pose.x - before.x) * per_s, (pose.y - before.y) * per_s, turn * per_s


def _between(a: Pose2, b: Pose2, fraction: float) -> Pose2:
    """Return the linear interpolation of two poses, the yaw along the shorter arc."""

    def mix(left: float, right: float) -> float:
        return left + fraction * (right - left)

    turn = float(wrap(np.asarray(b.yaw - a.yaw)))
    return Pose2(
        x=mix(a.x, b.x),
        y=mix(a.y, b.y),
        yaw=float(wrap(np.asarray(a.yaw + fraction * turn))),
        velocity=(mix(a.velocity[0], b.velocity[0]), mix(a.velocity[1], b.velocity[1])),
        yaw_rate=mix(a.yaw_rate, b.yaw_rate),
    )
