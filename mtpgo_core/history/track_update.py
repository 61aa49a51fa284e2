# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What an observation adds to a track, and how a track's samples become a window (design D13).

The rules of :class:`mtpgo_core.history.track_history.TrackHistory`, apart from the bookkeeping:
they take the newest observation of many tracks at once, each with a time of its own. The node
calls them message by message; a recording, of which all is known, track by track. Both get the
same numbers.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.frames import wrap
from mtpgo_core.history.resampling import Brackets, between, between_angles, fill_backwards
from mtpgo_core.history.track_store import (
    ACCELERATION,
    POSITION,
    SAMPLE_COLUMNS,
    VELOCITY,
    YAW,
    TrackStore,
)
from mtpgo_core.schema import BoolArray, Float64Array, TrackedStates
from mtpgo_core.task.task_description import HistoryConfig

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


def usable(config: HistoryConfig, states: TrackedStates) -> tuple[BoolArray, BoolArray]:
    """[n] observations with a usable position, and [n] those of them that are too fast."""
    finite = np.asarray((np.abs(states.position) <= _FARTHEST_M).all(axis=1))
    speed_mps = np.hypot(states.velocity[:, 0], states.velocity[:, 1])
    given = np.isfinite(states.velocity).all(axis=1)
    return finite, finite & given & (speed_mps > config.max_speed_mps)


def has_jumped(
    config: HistoryConfig,
    store: TrackStore,
    slot: NDArray[np.intp],
    stamp_ns: int | NDArray[np.int64],
    position: Float64Array,
) -> BoolArray:
    """[n] tracks that cannot have moved to ``position`` [n, 2] since their last sample.

    What a track can do is judged by its positions alone: some trackers send velocities of zero, or
    in another frame than they say.

    Args:
        config: the greatest speed.
        store: the tracks.
        slot: [n] which tracks; each has a sample.
        stamp_ns: time of the observation, one for all or [n] (ns).
        position: [n, 2] where they are now (m).
    """
    rings = store.rings
    dt_s = (stamp_ns - rings.last_ns[slot]) * 1e-9
    step = position - rings.last[slot, POSITION]
    surprise = step - store.motion[slot] * dt_s[:, None]
    moved_m = np.hypot(step[:, 0], step[:, 1])
    surprise_m = np.hypot(surprise[:, 0], surprise[:, 1])
    jumped = moved_m > _JUMP_M + config.max_speed_mps * dt_s
    jumped |= surprise_m > _JUMP_M + 0.5 * _JUMP_MPSS * dt_s**2  # never true for NaN
    return np.asarray(jumped, dtype=np.bool_)


def derive(
    config: HistoryConfig,
    store: TrackStore,
    slot: NDArray[np.intp],
    stamp_ns: int | NDArray[np.int64],
    states: TrackedStates,
    index: NDArray[np.intp],
) -> Float64Array:
    """[n, 7] position, velocity, acceleration and yaw, with what is missing estimated.

    The estimators of the store take the observations in.

    Args:
        config: sources of the derivatives.
        store: the tracks.
        slot: [n] which tracks, each at most once.
        stamp_ns: time of the observations, one for all or [n] (ns).
        states: the observations; their own stamp is not looked at.
        index: [n] which of ``states`` belongs to each slot.
    """
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


def interpolate(left: Float64Array, right: Float64Array, brackets: Brackets) -> Float64Array:
    """[n, T, 7] samples at the grid times, NaN where not valid or not known.

    Args:
        left: [n, T, 7] samples at ``brackets.left``.
        right: [n, T, 7] samples at ``brackets.right``.
        brackets: where each grid time lies between them.
    """
    sample = between(left, right, brackets.fraction[..., None])
    sample[..., YAW] = between_angles(left[..., YAW], right[..., YAW], brackets.fraction)
    for part in (VELOCITY, ACCELERATION, slice(YAW, None)):
        sample[..., part] = fill_backwards(sample[..., part], brackets.valid)
    reach_m = np.nan_to_num(sample[:, -1, VELOCITY]) * brackets.after_s[:, None]
    sample[:, -1, POSITION] += reach_m
    return np.where(brackets.valid[..., None], sample, np.nan)


def carry(covariance: Float64Array, time_s: Float64Array) -> Float64Array:
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
