# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The ego among the tracked objects: its state by its own odometry, at the time of each message.

The ego is one more road user of every message, with an identity, a class and a size, so it has a
history and a place in the graph like any other. Trackers often list it as well, as a track that
its own sensors see; that double is left out.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from msg_adapters.conversions import planar_block, reading, state_covariance
from msg_adapters.inputs.odometry import ODOMETRY, dated_pose, odometry_tilt
from msg_adapters.wire.input_limits import check_frame
from mtpgo_core.class_size import CLASS_SIZE_M
from mtpgo_core.errors import FrameError, MessageError
from mtpgo_core.frames import Pose2, PoseBuffer, rotate
from mtpgo_core.options import check_options, option
from mtpgo_core.schema import (
    AgentClass,
    BoolArray,
    Float64Array,
    KeyArray,
    TrackedStates,
    tracked_states,
)

EGO_NAME = "ego"
"""Identity of the ego, as text, where none was given."""

EGO_CLASSES = tuple(member.name.lower() for member in AgentClass)
"""Names of the classes that an ego may have."""

_MAX_GAP_S = 0.5
"""Between two poses farther apart than this the ego's state is not interpolated (s); the longest
time for which the history carries a road user on."""


@dataclass(frozen=True)
class EgoOptions:
    """What is known of the ego besides its odometry.

    Attributes:
        length_m, width_m: of its box (m).
        class_name: its class, one of :data:`EGO_CLASSES`.
        offset_m: how far the centre of its box is ahead of the odometry's frame (m): half the
            wheelbase where that is the rear axle.
        overlap: an object whose centre lies in the ego's box is the ego and is left out.
    """

    length_m: float = option(CLASS_SIZE_M[AgentClass.CAR][0], low=0.1, high=100.0)
    width_m: float = option(CLASS_SIZE_M[AgentClass.CAR][1], low=0.1, high=20.0)
    class_name: str = option("car", choices=EGO_CLASSES)
    offset_m: float = option(0.0, low=-50.0, high=50.0)
    overlap: bool = True

    def __post_init__(self) -> None:
        check_options(self, "ego ")


@dataclass(frozen=True)
class JoinedEgo:
    """A message with the ego.

    Attributes:
        states: the objects without the ego's doubles and, if it is known, the ego as the last.
        known: the ego's state at the message's time is known.
        added: it is in ``states``: it was not added for the same or a later stamp before.
        doubles: objects left out because they are the ego.
        double_keys: [k, 4] their identities, without the ego's own.
        problem: why the ego is not known, empty if it is.
    """

    states: TrackedStates
    known: bool
    added: bool = False
    doubles: int = 0
    double_keys: KeyArray = field(default_factory=lambda: np.empty((0, 4), dtype=np.uint32))
    problem: str = ""


class EgoOdometry:
    """Adds the ego to messages of tracked objects.

    Args:
        options: size, class and place of the ego's box.
        span_s: how long poses are kept (s).
    """

    def __init__(self, options: EgoOptions, span_s: float = 10.0) -> None:
        self._options = options
        self._poses = PoseBuffer(span_s, max_gap_s=_MAX_GAP_S)
        self._frames = ("", "")
        self._newest_ns: int | None = None
        self._twist_filled = False
        self._covariance = np.full((2, 2, 2), np.nan)
        self._added_ns: int | None = None
        self._objects_frame = ""
        self._doubles: dict[bytes, int] = {}  # when each of them was the ego last (ns)

    def clear(self) -> None:
        """Forget everything, as after a jump of the clock."""
        self._poses.clear()
        self._newest_ns = self._added_ns = None
        self._doubles = {}

    def add(self, message: Any) -> None:
        """Add a ``nav_msgs/Odometry`` of the ego.

        A twist of zeros counts as not filled until one that is not zero has come: the velocity is
        then estimated from the positions, as for an object without one.

        Raises:
            MessageError: it has no stamp or no finite pose, other fields, a name that is too long,
                or a frame that does not stand upright.
        """
        with reading(message, ODOMETRY):
            stamp_ns, pose = dated_pose(message, "odometry of the ego")
            frames = (str(message.header.frame_id), str(message.child_frame_id))
            tilt = odometry_tilt(message)
        if tilt:  # its twist is not forward and to the left either
            raise MessageError(f"odometry of the ego: {tilt}")
        twist = (*pose.velocity, pose.yaw_rate)
        if not all(map(math.isfinite, twist)):
            pose = dataclasses.replace(pose, velocity=(0.0, 0.0), yaw_rate=0.0)
            self._twist_filled = False
        elif any(twist):
            self._twist_filled = True
        for frame_id in frames:
            check_frame(frame_id)
        late_ns = 0 if self._newest_ns is None else self._newest_ns - stamp_ns
        if frames != self._frames or late_ns > _MAX_GAP_S * 1e9:
            # Another vehicle or frame, or the clock was set back.
            self._poses.clear()
            self._frames, self._newest_ns = frames, None
        self._poses.add(stamp_ns, pose)
        if self._newest_ns is None or late_ns < 0:
            self._newest_ns = stamp_ns
            self._covariance = np.array(
                [planar_block(part.covariance) for part in (message.pose, message.twist)]
            ).reshape(2, 2, 2)

    def join(
        self,
        states: TrackedStates,
        key: KeyArray,
        to_frame: Callable[[TrackedStates], TrackedStates] = lambda ego: ego,
    ) -> JoinedEgo:
        """Return a message's objects with the ego, or as they are if its state is not known.

        An object with the ego's identity is replaced by the odometry, or taken while there is
        none.

        Args:
            states: the objects, in the frame of the history.
            key: [4] the ego's identity.
            to_frame: transforms the ego from its odometry's frame into that of the history, and
                raises FrameError where it cannot.
        """
        stamp_ns = states.stamp_ns
        if len(states):
            self._objects_frame = states.frame_id
        try:
            ego = to_frame(self._state(stamp_ns, key))
            expected = states.frame_id
            if not len(states):  # some empty messages name no frame
                expected = self._objects_frame or states.frame_id or ego.frame_id
            if ego.frame_id != expected:
                raise FrameError(
                    f"its odometry is in the frame {ego.frame_id!r}, the objects are in"
                    f" {expected!r}, expected the same or a transform (fixed_frame)"
                )
        except FrameError as error:
            return self._without_ego(states, str(error))
        own = np.asarray((states.key == key).all(axis=1))
        double = self._double(states, ego) | own
        rest = _select(states, ~double)
        doubles, double_keys = int(double.sum()), states.key[double & ~own]
        # Two publishers of objects may share a stamp: the ego comes once.
        last_ns = self._added_ns
        if last_ns is not None and 0 <= last_ns - stamp_ns < _MAX_GAP_S * 1e9:
            return JoinedEgo(rest, known=True, doubles=doubles, double_keys=double_keys)
        self._added_ns = stamp_ns
        return JoinedEgo(
            _with(rest, ego), known=True, added=True, doubles=doubles, double_keys=double_keys
        )

    def _without_ego(self, states: TrackedStates, problem: str) -> JoinedEgo:
        """Return a message without the ego, whose doubles stay away while it is carried on."""
        last_ns = self._added_ns
        if last_ns is None or abs(states.stamp_ns - last_ns) > _MAX_GAP_S * 1e9:
            return JoinedEgo(states, known=False, problem=problem)
        double = self._listed(states)
        return JoinedEgo(
            _select(states, ~double), known=False, doubles=int(double.sum()), problem=problem
        )

    def _state(self, stamp_ns: int, key: KeyArray) -> TrackedStates:
        """Return the ego at a time (ns), in its odometry's frame.

        Raises:
            FrameError: its pose is not known then.
        """
        if self._newest_ns is None:
            raise FrameError("no odometry of it has come")
        try:
            pose = self._poses.at(stamp_ns)
        except FrameError as error:
            away_s = (stamp_ns - self._newest_ns) * 1e-9
            if away_s <= 0.0:
                raise
            raise FrameError(
                f"its last odometry is {away_s:.3g} s older than the objects, expected at most"
                f" {self._poses.max_extrapolation_s:g} s"
            ) from error
        options = self._options
        centre, velocity = _centre(pose, options.offset_m)
        if not self._twist_filled:
            velocity = np.full(2, np.nan)
        yaw = np.array([pose.yaw])
        position, twist = self._covariance[:, None]
        return tracked_states(
            stamp_ns,
            self._frames[0],
            key.reshape(1, 4),
            centre[None],
            agent_class=np.array([AgentClass.from_name(options.class_name)], dtype=np.uint8),
            velocity=velocity[None],
            yaw=yaw,
            size=np.array([[options.length_m, options.width_m]]),
            covariance=state_covariance(position, twist, yaw, "object"),
        )

    def _double(self, states: TrackedStates, ego: TrackedStates) -> BoolArray:
        """Return [n] which objects are the ego: their centre lies in its box.

        A track that was the ego stays so until it is a whole box away, so that a tracker that lags
        behind does not make it appear and disappear.
        """
        if not self._options.overlap:
            return np.zeros(len(states), dtype=np.bool_)
        away = np.abs(rotate(states.position - ego.position, -ego.yaw[0]))
        with np.errstate(invalid="ignore"):
            inside = (away <= 0.5 * ego.size).all(axis=1)
            near = (away <= ego.size).all(axis=1)
        listed = self._listed(states)
        double = np.asarray(inside | (listed & near))
        # One that a message does not have, as of another publisher, comes back where it was.
        now_ns, gap_ns = states.stamp_ns, round(_MAX_GAP_S * 1e9)
        ended = {row.tobytes() for row in states.key[listed & ~double]}
        self._doubles = {
            name: seen_ns
            for name, seen_ns in self._doubles.items()
            if name not in ended and abs(now_ns - seen_ns) <= gap_ns
        } | {row.tobytes(): now_ns for row in states.key[double]}
        return double

    def _listed(self, states: TrackedStates) -> BoolArray:
        """Return [n] which objects were the ego lately."""
        found = [row.tobytes() in self._doubles for row in states.key] if self._doubles else []
        return np.array(found or np.zeros(len(states)), dtype=np.bool_)


def _centre(pose: Pose2, offset_m: float) -> tuple[Float64Array, Float64Array]:
    """Return position and velocity of a point ahead of a pose's origin (m, m/s)."""
    ahead = rotate(np.array((offset_m, 0.0)), pose.yaw)
    turning = pose.yaw_rate * np.array((-ahead[1], ahead[0]))
    return np.array((pose.x, pose.y)) + ahead, np.array(pose.velocity) + turning


def _select(states: TrackedStates, keep: BoolArray) -> TrackedStates:
    if keep.all():
        return states
    kept: dict[str, Any] = {name: column[keep] for name, column in _columns(states).items()}
    return dataclasses.replace(states, **kept)


def _with(states: TrackedStates, ego: TrackedStates) -> TrackedStates:
    """Return the objects and the ego, in the ego's frame, which is theirs if there are any."""
    own = _columns(ego)
    both: dict[str, Any] = {
        name: np.concatenate([column, own[name]]) for name, column in _columns(states).items()
    }
    return dataclasses.replace(states, frame_id=ego.frame_id, **both)


def _columns(states: TrackedStates) -> dict[str, Any]:
    return {k: v for k, v in vars(states).items() if isinstance(v, np.ndarray)}
