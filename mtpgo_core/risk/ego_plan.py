# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The ego's plan: its poses over time, from any source, and its footprint."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.class_size import CLASS_SIZE_M
from mtpgo_core.errors import FrameError, MessageError
from mtpgo_core.frames import Pose2, wrap
from mtpgo_core.options import check_options, option
from mtpgo_core.schema import FARTHEST_M, AgentClass, Float64Array

BEFORE_S = 0.5
"""A plan is extended backwards by this much, at the mean velocity of its first so many seconds.
Chosen: a plan begins now, a prediction at the observation that it is made of, a latency earlier.
The first two poses alone give no velocity: they may be a millisecond and a metre apart, or on top
of each other."""

_MOTION_HORIZON_S = 3600.0
"""How far constant velocity reaches (s); chosen beyond any prediction."""

_FASTEST_MPS = 100.0
"""Fastest plan (m/s); chosen as the speed above which the history of road users rejects."""

_JUMP_M = 2.0
"""How much farther than that two poses may be apart (m); chosen: they may be a millisecond
apart in time."""

_MOVES_M = 1e-3
"""Two points this far apart give a heading (m); chosen above rounding."""


@dataclass(frozen=True)
class EgoFootprint:
    """The box of the ego.

    Attributes:
        length, width: of the box (m).
        center_offset: how far the box's centre is ahead of the point that the plan moves (m); for
            a rear axle half the wheelbase, plus half the difference of the overhangs.
        margin: free space required around the box (m); it is treated as part of the box.
    """

    length: float = option(CLASS_SIZE_M[AgentClass.CAR][0], above=0.0, high=100.0)
    width: float = option(CLASS_SIZE_M[AgentClass.CAR][1], above=0.0, high=100.0)
    center_offset: float = option(0.0, low=-50.0, high=50.0)
    margin: float = option(0.0, low=0.0, high=20.0)

    def __post_init__(self) -> None:
        check_options(self)

    @property
    def size(self) -> Float64Array:
        """[2] length and width of the box with its margin (m)."""
        return np.array((self.length, self.width)) + 2.0 * self.margin

    def center(self, position: Float64Array, yaw: Float64Array) -> Float64Array:
        """Return [..., 2] centres of the box where the plan's point is at ``position``."""
        ahead = self.center_offset * np.stack([np.cos(yaw), np.sin(yaw)], axis=-1)
        return position + ahead


@dataclass(frozen=True)
class EgoPlan:
    """Poses of the ego at ascending times, in one frame; see :func:`make_plan`.

    Attributes:
        stamp_ns: when the plan was made (ns).
        frame_id: frame of the poses.
        time_ns: [k] times of the poses (ns), strictly ascending.
        position: [k, 2] (m).
        yaw: [k] headings (rad).
        stands_after: the ego stands at the last pose after the plan's end; otherwise its position
            is unknown from there on.
        source: what the plan was made of, for error messages.
    """

    stamp_ns: int
    frame_id: str
    time_ns: NDArray[np.int64]
    position: Float64Array
    yaw: Float64Array
    stands_after: bool
    source: str

    def at(self, stamp_ns: int, time_s: Float64Array) -> tuple[Float64Array, Float64Array]:
        """Return positions [H, 2] (m) and headings [H] (rad), NaN where the plan has none.

        Interpolates linearly, headings along the shorter arc. Up to :data:`BEFORE_S` before the
        first pose, the position is extrapolated with the velocity at the plan's beginning.

        Args:
            stamp_ns: from which the times count (ns).
            time_s: [H] (s).
        """
        # Relative to the plan's beginning: seconds since the epoch leave float64 0.2 us.
        known = (self.time_ns - self.time_ns[0]) * 1e-9
        wanted = (stamp_ns - int(self.time_ns[0])) * 1e-9 + time_s
        last = len(known) - 1
        before = np.clip(np.searchsorted(known, wanted, side="right") - 1, 0, max(last - 1, 0))
        after = np.minimum(before + 1, last)
        span = np.where(after > before, known[after] - known[before], 1.0)
        share = (wanted - known[before]) / span
        if self.stands_after:
            share = np.minimum(share, 1.0)
        share = np.where(after > before, share, 0.0)[:, None]
        position = self.position[before] + share * (self.position[after] - self.position[before])
        early = wanted < known[0]
        if early.any():
            position[early] = self.position[0] + (wanted[early, None] - known[0]) * self._begin()
        turn = wrap(self.yaw[after] - self.yaw[before])
        # Backwards the heading stays: a turn is not extrapolated.
        yaw = wrap(self.yaw[before] + np.clip(share[:, 0], 0.0, 1.0) * turn)
        slack_s = 1e-4  # rounding of float32 times of a prediction
        unknown = wanted < known[0] - BEFORE_S
        if not self.stands_after:
            unknown |= wanted > known[last] + slack_s
        position[unknown], yaw[unknown] = np.nan, np.nan
        return position, yaw

    def _begin(self) -> Float64Array:
        """Return [2] the mean velocity over the first :data:`BEFORE_S` (m/s), 0 for one pose."""
        known = (self.time_ns - self.time_ns[0]) * 1e-9
        end_s = min(BEFORE_S, float(known[-1]))
        if end_s <= 0.0:
            return np.zeros(2)
        end = [np.interp(end_s, known, self.position[:, axis]) for axis in range(2)]
        moved = np.array(end) - self.position[0]
        # The way of two poses in a moment may be more than a vehicle drives in it.
        return np.asarray(moved / max(end_s, float(np.hypot(*moved)) / _FASTEST_MPS))


def make_plan(
    stamp_ns: int,
    frame_id: str,
    time_ns: NDArray[np.int64],
    position: Float64Array,
    yaw: Float64Array,
    *,
    stands_after: bool = False,
    source: str = "plan",
) -> EgoPlan:
    """Return a checked plan.

    Args:
        stamp_ns: when it was made (ns).
        frame_id: its frame.
        time_ns: [k] times of the poses (ns).
        position: [k, 2] (m).
        yaw: [k] headings (rad); NaN where there is none, which is then that of the motion.
        stands_after: see :class:`EgoPlan`.
        source: what it was made of.

    Raises:
        MessageError: there is no frame or too few poses, or times and poses are not usable.
    """
    least = 1 if stands_after else 2
    if not frame_id:
        raise MessageError(f"{source} names no frame, expected that of the predictions")
    if len(time_ns) < least:
        raise MessageError(f"{source} has {len(time_ns)} poses, expected at least {least}")
    if len(time_ns) > 1 and not (time_ns != time_ns[0]).any():
        raise MessageError(
            f"{source} has no times: its {len(time_ns)} poses all have the time "
            f"{int(time_ns[0]) * 1e-9:.9g} s, expected ascending times"
        )
    falls = np.flatnonzero(np.diff(time_ns) <= 0)
    if len(falls):
        at = int(falls[0])
        raise MessageError(
            f"{source} has times that do not ascend: pose {at + 1} is "
            f"{int(time_ns[at + 1] - time_ns[at]) * 1e-9:g} s after pose {at}"
        )
    require_places(position, source)
    _require_speeds(time_ns, position, source)
    return EgoPlan(
        stamp_ns=int(stamp_ns),
        frame_id=frame_id,
        time_ns=np.asarray(time_ns, dtype=np.int64),
        position=np.asarray(position, dtype=np.float64),
        yaw=_headings(position, yaw, source),
        stands_after=stands_after,
        source=source,
    )


def require_places(position: Float64Array, source: str) -> None:
    """Check that positions [k, 2] (m) are finite and plausible.

    Raises:
        MessageError: one is not finite, or beyond :data:`~mtpgo_core.schema.FARTHEST_M`.
    """
    bad = np.flatnonzero(~(np.abs(position) <= FARTHEST_M).all(axis=1))
    if len(bad):
        raise MessageError(
            f"{source} has the position {position[bad[0]].tolist()} at pose {int(bad[0])}, "
            f"expected finite numbers up to {FARTHEST_M:g} m"
        )


def _require_speeds(time_ns: NDArray[np.int64], position: Float64Array, source: str) -> None:
    """Check that the speed between consecutive poses is possible for a vehicle.

    Without this check, a plan in other units than m and s would give a low risk everywhere.

    Raises:
        MessageError: two poses are too far apart for the time between them.
    """
    took_s = np.diff(time_ns) * 1e-9
    moved_m = np.hypot(*np.diff(position, axis=0).T)
    fast = np.flatnonzero(moved_m > _JUMP_M + _FASTEST_MPS * took_s)
    if len(fast):
        at = int(fast[0])
        raise MessageError(
            f"{source} moves {moved_m[at]:.4g} m in {took_s[at]:.4g} s from pose {at} to pose"
            f" {at + 1}, expected at most {_FASTEST_MPS:g} m/s"
        )


def plan_of_motion(stamp_ns: int, frame_id: str, pose: Pose2) -> EgoPlan:
    """Return a plan at constant velocity and heading.

    Args:
        stamp_ns: time of the pose (ns).
        frame_id: frame of the pose.
        pose: with the velocity along the frame's axes.

    Raises:
        MessageError: the pose or its velocity is not finite, or faster than a vehicle.
    """
    source = "odometry"
    if not all(map(math.isfinite, (pose.yaw, *pose.velocity))):
        raise MessageError(
            f"{source} has the yaw {pose.yaw} and the velocity {pose.velocity}, "
            "expected finite numbers"
        )
    if math.hypot(*pose.velocity) > _FASTEST_MPS:
        raise MessageError(
            f"{source} has the velocity {pose.velocity} m/s, expected at most {_FASTEST_MPS:g} m/s"
        )
    start = np.array((pose.x, pose.y))
    end = start + _MOTION_HORIZON_S * np.array(pose.velocity)
    return make_plan(
        stamp_ns,
        frame_id,
        stamp_ns + np.array((0, round(_MOTION_HORIZON_S * 1e9)), dtype=np.int64),
        np.stack([start, end]),
        np.full(2, pose.yaw),
        source=source,
    )


def plan_in_frame(plan: EgoPlan, pose: Pose2, frame_id: str) -> EgoPlan:
    """Return a plan in another frame.

    Args:
        plan: in its own frame.
        pose: of that frame in the other one, at the plan's stamp.
        frame_id: name of the other frame.

    Raises:
        FrameError: the pose is not finite.
    """
    values = (pose.x, pose.y, pose.yaw)
    if not all(map(math.isfinite, values)):
        raise FrameError(
            f"the pose of frame {plan.frame_id!r} in {frame_id!r} is {values}, expected finite"
            " numbers"
        )
    return dataclasses.replace(
        plan,
        frame_id=frame_id,
        position=pose.point(plan.position),
        yaw=wrap(plan.yaw + pose.yaw),
    )


def _headings(position: Float64Array, yaw: Float64Array, source: str) -> Float64Array:
    """Return [k] headings (rad): the given ones, else the direction of motion around the pose.

    Raises:
        MessageError: a pose has neither.
    """
    missing = ~np.isfinite(yaw)
    if not missing.any():
        return np.asarray(yaw, dtype=np.float64)
    moves = np.diff(position, axis=0)
    moving = np.flatnonzero(np.hypot(*moves.T) >= _MOVES_M)
    if not len(moving):
        raise MessageError(
            f"{source} has no orientation at pose {int(np.flatnonzero(missing)[0])} and does not "
            "move, expected a heading"
        )
    course = np.arctan2(moves[moving, 1], moves[moving, 0])
    place = np.searchsorted(moving, np.arange(len(position)), side="left")
    return np.where(missing, course[np.minimum(place, len(moving) - 1)], yaw)
