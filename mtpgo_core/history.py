# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The rolling past of every track, resampled on the model's grid (design D1, D2, D13, section 4).

Observations may come at any rate and jitter. What happens to odd ones is fixed here, and counted:

===========================================  ==================================================
observation                                  outcome
===========================================  ==================================================
position NaN, infinite or beyond 1e8 m       that agent's observation is rejected (``non_finite``)
velocity, acceleration, yaw not finite       taken as missing, estimated
given speed above ``max_speed_mps``          that agent's observation is rejected (``too_fast``)
moved farther than it can have moved         the track starts anew there (``restarted``)
same track twice in a message                the first usable one counts (``duplicate_keys``)
same stamp as the track's newest             dropped (``duplicates``)
older than the track's newest                dropped (``late``); other tracks are served
stamp older than the whole window, or the    the clock jumped back (a bag loops): the past is
third message in a row older than the        forgotten and begins with this message
newest by more than 0.5 s                    (``clock_reset``)
another frame                                message rejected (``frame_changed``); the third in a
                                             row in one new frame starts a new past in it
empty message                                the time goes on, nothing else
more tracks than ``max_tracks``              those not seen for longest go, then the surplus of
                                             the message is dropped (``dropped``)
not seen for the window and one gap          forgotten (``forgotten``)
===========================================  ==================================================

No loop runs over agents: every step is an array operation over the agents of a message.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.derivatives import CausalSlope
from mtpgo_core.resampling import (
    NEVER_NS,
    Brackets,
    between,
    between_angles,
    bracket,
    fill_backwards,
    wrap,
)
from mtpgo_core.schema import BoolArray, Float64Array, HistoryWindow, TrackedStates
from mtpgo_core.task import HistoryConfig
from mtpgo_core.tracktable import TrackTable, names_of

_ACCELERATION_PRIOR_S2 = (0.1 / 2.2) ** 2
"""Prior of the acceleration estimate: velocities good to about 0.1 m/s, accelerations of about
2 m/s^2; keeps the first estimates of a track from being noise divided by a short time."""
_FARTHEST_M = 1e8
"""No map reaches farther (UTM coordinates stay below 1e7 m)."""
_JUMP_M = 5.0
"""A track may always move by this much between two observations, whatever the time (m)."""
_JUMP_MPSS = 30.0
"""Change of velocity, by collision or tracker, that a track may show and stay the same."""
_HARDEST_MPSS = 200.0
"""A given acceleration beyond is taken as missing."""
_MOVING_MPS = 0.5
"""From this speed on the direction of motion stands in for an unknown yaw."""
_LATE_NS = 500_000_000
_PATIENCE = 3
"""Messages in a row it takes to believe a small jump of the clock or a change of frame."""
_HIGHEST_RATE_HZ = 200.0
"""Faster observations of one track replace each other, so the memory stays bounded."""

_POSITION, _VELOCITY, _ACCELERATION, _YAW = slice(0, 2), slice(2, 4), slice(4, 6), 6


@dataclass(frozen=True)
class UpdateReport:
    """What became of one message; all counts are agents unless said otherwise.

    Attributes:
        accepted: observations that entered the history.
        new_tracks: of these, first observations of an agent.
        restarted: of these, tracks begun anew because of an impossible move (reused identity).
        duplicates: dropped, the track has an observation with this stamp.
        late: dropped, the track has a newer observation.
        duplicate_keys: dropped, the identity stands in the message already.
        non_finite: dropped, no usable position.
        too_fast: dropped, faster than ``max_speed_mps``.
        dropped: new tracks dropped, and old ones evicted, for lack of room.
        wrong_frame: dropped with the message, see ``frame_changed``.
        forgotten: tracks forgotten because they were not seen for a whole window.
        clock_reset: the clock jumped back and the past was forgotten.
        frame_changed: the message came in another frame than the past; rejected, or, when
            ``accepted`` is not zero, taken as the start of a new past.
    """

    accepted: int = 0
    new_tracks: int = 0
    restarted: int = 0
    duplicates: int = 0
    late: int = 0
    duplicate_keys: int = 0
    non_finite: int = 0
    too_fast: int = 0
    dropped: int = 0
    wrong_frame: int = 0
    forgotten: int = 0
    clock_reset: bool = False
    frame_changed: bool = False


class TrackHistory:
    """Rolling past of up to ``max_tracks`` tracks.

    Args:
        config: grid, gaps and estimators.
        max_tracks: bound on the memory, see the module's table.
    """

    def __init__(self, config: HistoryConfig, max_tracks: int = 4096) -> None:
        self.config = config
        self.max_tracks = max_tracks
        self._dt_ns = round(config.dt_s * 1e9)
        self._gap_ns = round(config.max_gap_s * 1e9)
        self._keep_ns = (config.steps - 1) * self._dt_ns + max(
            self._gap_ns, round(config.max_extrapolation_s * 1e9)
        )
        self._spacing_ns = round(1e9 / _HIGHEST_RATE_HZ)
        self._most_samples = self._keep_ns // self._spacing_ns + 3
        self.clear()

    def clear(self) -> None:
        """Forget everything, the clock and the frame included."""
        self._newest_ns: int | None = None
        self._frame_id = ""
        self._strange_frame, self._strange_count, self._late_count = "", 0, 0
        capacity = min(64, self.max_tracks)
        width = min(64, self._most_samples)
        self._table = TrackTable()
        self._free = np.arange(capacity, dtype=np.intp)[::-1]
        self._velocity = CausalSlope(capacity, self.config.velocity_tau_s)
        self._acceleration = CausalSlope(
            capacity, self.config.acceleration_tau_s, _ACCELERATION_PRIOR_S2
        )
        self._stamp = np.full((capacity, width), NEVER_NS, dtype=np.int64)
        self._sample = np.full((capacity, width, 7), np.nan)
        self._count = np.zeros(capacity, dtype=np.int64)
        self._last_ns = np.full(capacity, NEVER_NS, dtype=np.int64)
        self._last = np.full((capacity, 7), np.nan)
        self._motion = np.full((capacity, 2), np.nan)  # velocity by the positions alone
        self._key = np.zeros((capacity, 4), dtype=np.uint32)
        self._agent_class = np.zeros(capacity, dtype=np.uint8)
        self._z = np.full(capacity, np.nan)
        self._size = np.full((capacity, 2), np.nan)
        self._covariance = np.full((capacity, 4, 4), np.nan)

    def __len__(self) -> int:
        return len(self._table)

    @property
    def newest_stamp_ns(self) -> int | None:
        """Stamp of the newest message (ns), None before the first."""
        return self._newest_ns

    @property
    def frame_id(self) -> str:
        """The frame of the past, empty before the first message."""
        return self._frame_id

    # ------------------------------------------------------------------ taking a message in

    def update(self, states: TrackedStates) -> UpdateReport:
        """Take one message in; the module's table says what becomes of what."""
        with np.errstate(invalid="ignore", over="ignore"):
            return self._update(states)

    def _update(self, states: TrackedStates) -> UpdateReport:
        frame_changed = self._newest_ns is not None and states.frame_id != self._frame_id
        if frame_changed and not self._believe_frame(states.frame_id):
            return UpdateReport(frame_changed=True, wrong_frame=len(states))
        stamp_ns = int(states.stamp_ns)
        clock_reset = not frame_changed and self._jumped_back(stamp_ns)
        if frame_changed or clock_reset:
            self.clear()
        self._frame_id = states.frame_id
        self._strange_count = 0
        self._newest_ns = max(stamp_ns, self._newest_ns or stamp_ns)
        forgotten = self._release(
            self._last_ns[self._table.slots] < self._newest_ns - self._keep_ns
        )

        finite = (np.abs(states.position) <= _FARTHEST_M).all(axis=1)
        speed_mps = np.hypot(states.velocity[:, 0], states.velocity[:, 1])
        given = np.isfinite(states.velocity).all(axis=1)
        too_fast = finite & given & (speed_mps > self.config.max_speed_mps)
        usable = np.flatnonzero(finite & ~too_fast)
        names, first = np.unique(names_of(states.key[usable]), return_index=True)
        index = usable[first]
        slot = self._table.find(names)
        last_ns = np.where(slot >= 0, self._last_ns[slot], NEVER_NS)
        fresh = last_ns < stamp_ns
        names, index, slot = names[fresh], index[fresh], slot[fresh]

        known = slot >= 0
        restarted = self._restart_jumped(slot[known], stamp_ns, states.position[index[known]])
        new, dropped = self._admit(names[~known], slot[known])
        slot[~known] = new
        taken = slot >= 0
        self._append(slot[taken], stamp_ns, states, index[taken])
        return UpdateReport(
            accepted=int(taken.sum()),
            new_tracks=int((new >= 0).sum()),
            restarted=restarted,
            duplicates=int((last_ns == stamp_ns).sum()),
            late=int((last_ns > stamp_ns).sum()),
            duplicate_keys=usable.shape[0] - first.shape[0],
            non_finite=int((~finite).sum()),
            too_fast=int(too_fast.sum()),
            dropped=dropped,
            forgotten=forgotten,
            clock_reset=clock_reset,
            frame_changed=frame_changed,
        )

    def _believe_frame(self, frame_id: str) -> bool:
        """Whether enough messages in a row came in this one new frame."""
        self._strange_count = self._strange_count + 1 if frame_id == self._strange_frame else 1
        self._strange_frame = frame_id
        return self._strange_count >= _PATIENCE

    def _jumped_back(self, stamp_ns: int) -> bool:
        """Whether the clock was set back, as opposed to one message being late."""
        if self._newest_ns is None:
            return False
        behind_ns = self._newest_ns - stamp_ns
        self._late_count = self._late_count + 1 if behind_ns > _LATE_NS else 0
        return behind_ns > self._keep_ns or self._late_count >= _PATIENCE

    def _release(self, rows: BoolArray) -> int:
        """Forget the tracks in these rows of the table."""
        if not rows.any():
            return 0
        slots = self._table.remove(rows)
        self._free = np.concatenate([self._free, slots])
        return int(slots.shape[0])

    def _blank(self, slot: NDArray[np.intp]) -> None:
        """Make the slots as good as new."""
        self._count[slot] = 0
        self._stamp[slot] = NEVER_NS
        self._last_ns[slot] = NEVER_NS
        self._last[slot] = np.nan
        self._motion[slot] = np.nan
        self._agent_class[slot] = 0
        self._z[slot] = np.nan
        self._size[slot] = np.nan
        self._covariance[slot] = np.nan
        self._velocity.reset(slot)
        self._acceleration.reset(slot)

    def _restart_jumped(
        self, slot: NDArray[np.intp], stamp_ns: int, position: Float64Array
    ) -> int:
        """Blank the tracks that cannot have moved to ``position`` [n, 2]; returns how many."""
        dt_s = (stamp_ns - self._last_ns[slot]) * 1e-9
        step = position - self._last[slot, _POSITION]
        surprise = step - self._motion[slot] * dt_s[:, None]
        moved_m = np.hypot(step[:, 0], step[:, 1])
        surprise_m = np.hypot(surprise[:, 0], surprise[:, 1])
        jumped = moved_m > _JUMP_M + self.config.max_speed_mps * dt_s
        jumped |= surprise_m > _JUMP_M + 0.5 * _JUMP_MPSS * dt_s**2  # never true for NaN
        if not jumped.any():
            return 0
        self._blank(slot[jumped])
        return int(jumped.sum())

    def _admit(
        self, names: NDArray[np.bytes_], others: NDArray[np.intp]
    ) -> tuple[NDArray[np.intp], int]:
        """Slots for new tracks, -1 where there is no room, and the number dropped.

        Args:
            names: sorted names of the new tracks.
            others: slots of the known tracks in the same message; these are never evicted.
        """
        new = np.full(names.shape[0], -1, dtype=np.intp)
        if names.shape[0] == 0:
            return new, 0
        room = min(names.shape[0], self.max_tracks - others.shape[0])
        surplus = len(self._table) + room - self.max_tracks
        if surplus > 0:
            seen_ns = np.where(
                np.isin(self._table.slots, others),
                np.iinfo(np.int64).max,
                self._last_ns[self._table.slots],
            )
            oldest = np.argsort(seen_ns, kind="stable")[:surplus]
            rows = np.zeros(len(self._table), dtype=bool)
            rows[oldest] = True
            self._release(rows)
        if room > self._free.shape[0]:
            self._grow_tracks(len(self._table) + room)
        slots, self._free = self._free[::-1][:room], self._free[::-1][room:][::-1]
        self._blank(slots)
        self._table.add(names[:room], slots)
        new[:room] = slots
        return new, names.shape[0] - room + max(surplus, 0)

    def _append(
        self, slot: NDArray[np.intp], stamp_ns: int, states: TrackedStates, index: NDArray[np.intp]
    ) -> None:
        """Store the observations ``index`` of the message as the newest of their tracks."""
        if slot.shape[0] == 0:
            return
        value = self._derive(slot, stamp_ns, states, index)
        column = self._columns(slot, stamp_ns)
        self._stamp[slot, column] = stamp_ns
        self._sample[slot, column] = value
        self._last_ns[slot] = stamp_ns
        self._last[slot] = value
        self._key[slot] = states.key[index]
        agent_class, z, size = states.agent_class[index], states.z[index], states.size[index]
        self._agent_class[slot] = np.where(agent_class > 0, agent_class, self._agent_class[slot])
        self._z[slot] = np.where(np.isfinite(z), z, self._z[slot])
        self._size[slot] = np.where(np.isfinite(size), size, self._size[slot])
        self._covariance[slot] = states.covariance[index]

    def _derive(
        self, slot: NDArray[np.intp], stamp_ns: int, states: TrackedStates, index: NDArray[np.intp]
    ) -> Float64Array:
        """[n, 7] position, velocity, acceleration and yaw, with what is missing estimated."""
        config = self.config
        first = self._count[slot] == 0
        dt_s = np.where(first, 0.0, (stamp_ns - self._last_ns[slot]) * 1e-9)
        value = np.empty((slot.shape[0], 7))
        value[:, _POSITION] = states.position[index]

        velocity = self._velocity.step(slot, dt_s, value[:, _POSITION])
        self._motion[slot] = velocity
        if config.velocity_source == "message":
            velocity = _prefer(states.velocity[index], velocity)
        value[:, _VELOCITY] = velocity

        acceleration = self._acceleration.step(slot, dt_s, velocity)
        if config.acceleration_source == "message":
            sane = np.abs(states.acceleration[index]) <= _HARDEST_MPSS
            given = np.where(sane, states.acceleration[index], np.nan)
            acceleration = _prefer(given, acceleration)
        value[:, _ACCELERATION] = acceleration

        moving = np.hypot(velocity[:, 0], velocity[:, 1]) > _MOVING_MPS
        course = np.where(moving, np.arctan2(velocity[:, 1], velocity[:, 0]), self._last[slot, 6])
        yaw = states.yaw[index]
        angle = np.abs(yaw) < 1e6  # false for NaN; what lies beyond is no angle
        value[:, _YAW] = np.where(angle, wrap(np.where(angle, yaw, 0.0)), course)
        return value

    def _columns(self, slot: NDArray[np.intp], stamp_ns: int) -> NDArray[np.intp]:
        """Where in the rings the new samples go; widens the rings while they are too short."""
        while True:
            width = self._stamp.shape[1]
            count = self._count[slot]
            column = count % width
            # Of samples that come faster than the highest rate, only the newest is kept.
            before_ns = self._stamp[slot, (count - 2) % width]
            crowded = (count >= 2) & (self._last_ns[slot] - before_ns < self._spacing_ns)
            lost = ~crowded & (self._stamp[slot, column] >= stamp_ns - self._keep_ns)
            if not lost.any() or width >= self._most_samples:
                break
            self._widen(min(2 * width, self._most_samples))
        self._count[slot] += ~crowded
        return np.where(crowded, (count - 1) % width, column)

    def _widen(self, width: int) -> None:
        """Longer rings; the oldest sample comes to stand first."""
        capacity, old = self._stamp.shape
        rows = np.arange(capacity)[:, None]
        ring = (np.maximum(self._count, old)[:, None] + np.arange(old)) % old
        stamp = np.full((capacity, width), NEVER_NS, dtype=np.int64)
        sample = np.full((capacity, width, 7), np.nan)
        stamp[:, :old], sample[:, :old] = self._stamp[rows, ring], self._sample[rows, ring]
        self._count = np.minimum(self._count, old)
        self._stamp, self._sample = stamp, sample

    def _grow_tracks(self, least: int) -> None:
        """Room for at least ``least`` tracks."""
        old = self._stamp.shape[0]
        capacity = min(max(2 * old, least), self.max_tracks)
        extra = capacity - old

        def longer(array: NDArray) -> NDArray:
            return np.concatenate([array, np.zeros((extra, *array.shape[1:]), dtype=array.dtype)])

        for name in (
            "_stamp", "_sample", "_count", "_last_ns", "_last", "_motion", "_key",
            "_agent_class", "_z", "_size", "_covariance",
        ):  # fmt: skip
            setattr(self, name, longer(getattr(self, name)))
        self._velocity.grow(capacity)
        self._acceleration.grow(capacity)
        self._free = np.concatenate([np.arange(old, capacity, dtype=np.intp)[::-1], self._free])

    # ------------------------------------------------------------------ giving the window out

    def window(self, stamp_ns: int | None = None) -> HistoryWindow:
        """The grid samples up to a common time, of every track that has any.

        The agents stand in the order of their 128-bit numbers, whatever the order of messages.

        Args:
            stamp_ns: the common time t (ns), default the newest stamp. Samples after t are not
                looked at; tracks not seen at t are carried on to t at constant velocity, for
                ``max_extrapolation_s`` at most.

        Returns:
            The window; empty (stamp 0 unless given) before the first message.
        """
        config = self.config
        if stamp_ns is None:
            stamp_ns = self._newest_ns or 0
        grid_ns = stamp_ns + self._dt_ns * np.arange(1 - config.steps, 1, dtype=np.int64)
        slot = self._table.slots
        width = self._stamp.shape[1]
        ring = (self._count[slot][:, None] + np.arange(width)) % width
        stamps = np.where(
            np.arange(width) >= width - self._count[slot][:, None],
            self._stamp[slot[:, None], ring],
            NEVER_NS,
        )
        brackets = bracket(
            stamps,
            grid_ns,
            max_gap_ns=self._gap_ns,
            max_extrapolation_ns=round(config.max_extrapolation_s * 1e9),
        )
        seen = np.flatnonzero(brackets.valid.any(axis=1))
        if seen.shape[0] < slot.shape[0]:
            brackets = Brackets(**{k: v[seen] for k, v in vars(brackets).items()})
            slot, ring = slot[seen], ring[seen]
        value = self._interpolate(slot, ring, brackets)
        return HistoryWindow(
            stamp_ns=stamp_ns,
            frame_id=self._frame_id,
            key=self._key[slot],
            agent_class=self._agent_class[slot],
            z=self._z[slot],
            size=self._size[slot],
            position=value[..., _POSITION],
            velocity=value[..., _VELOCITY],
            acceleration=value[..., _ACCELERATION],
            yaw=value[..., _YAW],
            valid=brackets.valid,
            covariance=_carry(self._covariance[slot], brackets.after_s),
        )

    def _interpolate(
        self, slot: NDArray[np.intp], ring: NDArray[np.intp], brackets: Brackets
    ) -> Float64Array:
        """[n, T, 7] values at the grid times, NaN where not valid or not known."""
        rows = np.arange(slot.shape[0])[:, None]
        left = self._sample[slot[:, None], ring[rows, brackets.left]]
        right = self._sample[slot[:, None], ring[rows, brackets.right]]
        fraction = brackets.fraction[..., None]
        value = between(left, right, fraction)
        value[..., _YAW] = between_angles(left[..., _YAW], right[..., _YAW], brackets.fraction)
        for part in (_VELOCITY, _ACCELERATION, slice(_YAW, None)):
            value[..., part] = fill_backwards(value[..., part], brackets.valid)
        reach_m = np.nan_to_num(value[:, -1, _VELOCITY]) * brackets.after_s[:, None]
        value[:, -1, _POSITION] += reach_m
        return np.where(brackets.valid[..., None], value, np.nan)


def _carry(covariance: Float64Array, time_s: Float64Array) -> Float64Array:
    """Covariances [n, 4, 4] of (x, y, vx, vy) after ``time_s`` [n] at constant velocity."""
    if not time_s.any():
        return covariance
    step = np.zeros((time_s.shape[0], 4, 4))
    step[:] = np.eye(4)
    step[:, [0, 1], [2, 3]] = time_s[:, None]
    return step @ covariance @ step.transpose(0, 2, 1)


def _prefer(given: Float64Array, estimate: Float64Array) -> Float64Array:
    """The given vectors [n, 2] where finite, else the estimate."""
    return np.where(np.isfinite(given).all(axis=1, keepdims=True), given, estimate)
