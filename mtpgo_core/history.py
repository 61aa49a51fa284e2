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

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.resampling import (
    NEVER_NS,
    Brackets,
    between,
    between_angles,
    bracket,
    fill_backwards,
    wrap,
)
from mtpgo_core.schema import Float64Array, HistoryWindow, TrackedStates
from mtpgo_core.task import HistoryConfig
from mtpgo_core.trackstore import (
    ACCELERATION,
    POSITION,
    SAMPLE_COLUMNS,
    VELOCITY,
    YAW,
    TrackStore,
)
from mtpgo_core.tracktable import names_of
from mtpgo_core.updates import StreamWatch, UpdateReport, Verdict

__all__ = ["TrackHistory", "UpdateReport"]

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


class TrackHistory:
    """Rolling past of up to ``max_tracks`` tracks.

    Args:
        config: grid, gaps and estimators.
        max_tracks: bound on the memory, see the module's table.
    """

    def __init__(self, config: HistoryConfig, max_tracks: int = 4096) -> None:
        self.config = config
        self._max_tracks = max_tracks
        self._dt_ns = round(config.dt_s * 1e9)
        self._gap_ns = round(config.max_gap_s * 1e9)
        self._reach_ns = round(config.max_extrapolation_s * 1e9)
        self._keep_ns = (config.steps - 1) * self._dt_ns + max(self._gap_ns, self._reach_ns)
        self._watch = StreamWatch(self._keep_ns)
        self.clear()

    def clear(self) -> None:
        """Forget everything, the clock and the frame included."""
        self._watch.clear()
        self._store = TrackStore(self.config, self._max_tracks, self._keep_ns)

    def __len__(self) -> int:
        return len(self._store.table)

    @property
    def newest_stamp_ns(self) -> int | None:
        """Stamp of the newest message (ns), None before the first."""
        return self._watch.newest_ns

    @property
    def frame_id(self) -> str:
        """The frame of the past, empty before the first object."""
        return self._watch.frame_id or ""

    def update(self, states: TrackedStates) -> UpdateReport:
        """Take one message in; the module's table says what becomes of what."""
        stamp_ns = int(states.stamp_ns)
        # Without objects the name of the frame means nothing; some messages then have none.
        verdict = self._watch.judge(stamp_ns, states.frame_id if len(states) else None)
        if verdict is Verdict.STRANGE_FRAME:
            return UpdateReport(frame_changed=True, wrong_frame=len(states))
        if verdict is not Verdict.CONTINUES:
            self._store = TrackStore(self.config, self._max_tracks, self._keep_ns)
        with np.errstate(invalid="ignore", over="ignore"):
            return self._take(stamp_ns, states, verdict)

    def _take(self, stamp_ns: int, states: TrackedStates, verdict: Verdict) -> UpdateReport:
        store, newest_ns = self._store, self._watch.newest_ns
        newest_ns = stamp_ns if newest_ns is None else newest_ns
        forgotten = store.forget_before(newest_ns - self._keep_ns)

        finite = (np.abs(states.position) <= _FARTHEST_M).all(axis=1)
        speed_mps = np.hypot(states.velocity[:, 0], states.velocity[:, 1])
        given = np.isfinite(states.velocity).all(axis=1)
        too_fast = finite & given & (speed_mps > self.config.max_speed_mps)
        usable = np.flatnonzero(finite & ~too_fast)
        names, first = np.unique(names_of(states.key[usable]), return_index=True)
        index = usable[first]
        slot = store.table.find(names)
        last_ns = np.where(slot >= 0, store.rings.last_ns[slot], NEVER_NS)
        fresh = last_ns < stamp_ns
        names, index, slot = names[fresh], index[fresh], slot[fresh]

        known = slot >= 0
        restarted = self._restart_jumped(slot[known], stamp_ns, states.position[index[known]])
        new, dropped = store.admit(names[~known], slot[known])
        slot[~known] = new
        slot, index = slot[slot >= 0], index[slot >= 0]
        if slot.shape[0]:
            store.rings.append(slot, stamp_ns, self._derive(slot, stamp_ns, states, index))
            store.tell(slot, states, index)
        return UpdateReport(
            accepted=slot.shape[0],
            new_tracks=int((new >= 0).sum()),
            restarted=restarted,
            duplicates=int((last_ns == stamp_ns).sum()),
            late=int((last_ns > stamp_ns).sum()),
            duplicate_keys=usable.shape[0] - first.shape[0],
            non_finite=int((~finite).sum()),
            too_fast=int(too_fast.sum()),
            dropped=dropped,
            forgotten=forgotten,
            clock_reset=verdict is Verdict.CLOCK_RESET,
            frame_changed=verdict is Verdict.NEW_FRAME,
        )

    def _restart_jumped(
        self, slot: NDArray[np.intp], stamp_ns: int, position: Float64Array
    ) -> int:
        """Blank the tracks that cannot have moved to ``position`` [n, 2]; returns how many.

        What a track can do is judged by its positions alone: some trackers send velocities of
        zero, or in another frame than they say.
        """
        rings = self._store.rings
        dt_s = (stamp_ns - rings.last_ns[slot]) * 1e-9
        step = position - rings.last[slot, POSITION]
        surprise = step - self._store.motion[slot] * dt_s[:, None]
        moved_m = np.hypot(step[:, 0], step[:, 1])
        surprise_m = np.hypot(surprise[:, 0], surprise[:, 1])
        jumped = moved_m > _JUMP_M + self.config.max_speed_mps * dt_s
        jumped |= surprise_m > _JUMP_M + 0.5 * _JUMP_MPSS * dt_s**2  # never true for NaN
        if jumped.any():
            self._store.blank(slot[jumped])
        return int(jumped.sum())

    def _derive(
        self, slot: NDArray[np.intp], stamp_ns: int, states: TrackedStates, index: NDArray[np.intp]
    ) -> Float64Array:
        """[n, 7] position, velocity, acceleration and yaw, with what is missing estimated."""
        config, store = self.config, self._store
        first = store.rings.count[slot] == 0
        dt_s = np.where(first, 0.0, (stamp_ns - store.rings.last_ns[slot]) * 1e-9)
        sample = np.empty((slot.shape[0], SAMPLE_COLUMNS))
        sample[:, POSITION] = states.position[index]

        velocity = store.velocity.step(slot, dt_s, sample[:, POSITION])
        store.motion[slot] = velocity
        if config.velocity_source == "message":
            velocity = _prefer(states.velocity[index], velocity)
        sample[:, VELOCITY] = velocity

        acceleration = store.acceleration.step(slot, dt_s, velocity)
        if config.acceleration_source == "message":
            sane = np.abs(states.acceleration[index]) <= _HARDEST_MPSS
            given = np.where(sane, states.acceleration[index], np.nan)
            acceleration = _prefer(given, acceleration)
        sample[:, ACCELERATION] = acceleration

        moving = np.hypot(velocity[:, 0], velocity[:, 1]) > _MOVING_MPS
        course = np.arctan2(velocity[:, 1], velocity[:, 0])
        yaw = states.yaw[index]
        angle = np.abs(yaw) < 1e6  # false for NaN; what lies beyond is no angle
        unknown = np.where(moving, course, store.rings.last[slot, YAW])
        sample[:, YAW] = np.where(angle, wrap(np.where(angle, yaw, 0.0)), unknown)
        return sample

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
        store, steps = self._store, self.config.steps
        if stamp_ns is None:
            stamp_ns = self._watch.newest_ns or 0
        slot = store.table.slots
        stamps, place = store.rings.in_order(slot)
        brackets = bracket(
            stamps,
            stamp_ns + self._dt_ns * np.arange(1 - steps, 1, dtype=np.int64),
            max_gap_ns=self._gap_ns,
            max_extrapolation_ns=self._reach_ns,
        )
        seen = np.flatnonzero(brackets.valid.any(axis=1))
        if seen.shape[0] < slot.shape[0]:
            brackets = Brackets(**{k: v[seen] for k, v in vars(brackets).items()})
            slot, place = slot[seen], place[seen]
        sample = self._interpolate(slot, place, brackets)
        return HistoryWindow(
            stamp_ns=stamp_ns,
            frame_id=self.frame_id,
            key=store.key[slot],
            agent_class=store.agent_class[slot],
            z=store.z[slot],
            size=store.size[slot],
            position=sample[..., POSITION],
            velocity=sample[..., VELOCITY],
            acceleration=sample[..., ACCELERATION],
            yaw=sample[..., YAW],
            valid=brackets.valid,
            covariance=_carry(store.covariance[slot], brackets.after_s),
        )

    def _interpolate(
        self, slot: NDArray[np.intp], place: NDArray[np.intp], brackets: Brackets
    ) -> Float64Array:
        """[n, T, 7] samples at the grid times, NaN where not valid or not known."""
        rows = np.arange(slot.shape[0])[:, None]
        left = self._store.rings.samples(slot, place[rows, brackets.left])
        right = self._store.rings.samples(slot, place[rows, brackets.right])
        sample = between(left, right, brackets.fraction[..., None])
        sample[..., YAW] = between_angles(left[..., YAW], right[..., YAW], brackets.fraction)
        for part in (VELOCITY, ACCELERATION, slice(YAW, None)):
            sample[..., part] = fill_backwards(sample[..., part], brackets.valid)
        reach_m = np.nan_to_num(sample[:, -1, VELOCITY]) * brackets.after_s[:, None]
        sample[:, -1, POSITION] += reach_m
        return np.where(brackets.valid[..., None], sample, np.nan)


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
