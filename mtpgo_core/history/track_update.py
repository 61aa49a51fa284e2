# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The rules by which an observation updates a track and samples become a window.

The rules of :class:`mtpgo_core.history.track_history.TrackHistory` without its bookkeeping: they
take the newest observation of many tracks at once, each with its own time. The node applies them
message by message, training to all tracks of a recording. Both get the same numbers
(docs/design.md, decision 13).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.frames import wrap
from mtpgo_core.history.resampling import (
    Brackets,
    fill_backwards,
    interpolate_angle,
    interpolate_linear,
)
from mtpgo_core.history.track_store import (
    ACCELERATION,
    POSITION,
    SAMPLE_COLUMNS,
    VELOCITY,
    YAW,
    TrackStore,
)
from mtpgo_core.schema import (
    FARTHEST_M,
    MOVING_MPS,
    BoolArray,
    Float64Array,
    IndexArray,
    TrackedStates,
)
from mtpgo_core.task.task_description import HistoryConfig

JUMP_M = 5.0
"""A track may always move this far between two observations, however short the time (m); chosen:
a vehicle's length, by which a tracker may shift its reference point."""
JUMP_MPSS = 30.0
"""Largest plausible change of a track's velocity (m/s^2), by collision or a tracker's correction;
chosen: three times full braking."""
_HARDEST_MPSS = 200.0
"""A message's acceleration beyond this is treated as missing (m/s^2); chosen."""


def usable_observations(
    config: HistoryConfig, states: TrackedStates
) -> tuple[BoolArray, BoolArray]:
    """Return two masks [n]: usable position, and usable position but too fast."""
    finite = np.asarray((np.abs(states.position) <= FARTHEST_M).all(axis=1))
    speed_mps = np.hypot(states.velocity[:, 0], states.velocity[:, 1])
    given = np.isfinite(states.velocity).all(axis=1)
    return finite, finite & given & (speed_mps > config.max_speed_mps)


def moved_impossibly(
    config: HistoryConfig,
    store: TrackStore,
    slot: IndexArray,
    stamp_ns: int | NDArray[np.int64],
    position: Float64Array,
) -> BoolArray:
    """Return a mask [n] of tracks that cannot have reached ``position`` since their last sample.

    Only positions are compared, since some trackers send velocities that are zero or in another
    frame than stated.

    Args:
        config: the highest speed.
        store: the tracks.
        slot: [n] which tracks; each has a sample.
        stamp_ns: time of the observation, one for all or [n] (ns).
        position: [n, 2] observed positions (m).
    """
    rings = store.rings
    dt_s = np.asarray((stamp_ns - rings.last_ns[slot]) * 1e-9, dtype=np.float64)
    step = position - rings.last[slot, POSITION]
    return impossible_steps(config, dt_s, step, store.position_velocity[slot])


def impossible_steps(
    config: HistoryConfig,
    dt_s: Float64Array,
    step: Float64Array,
    velocity: Float64Array,
    *,
    spare_m: float = 0.0,
) -> BoolArray:
    """Return a mask [n] of steps that are too far from one observation to the next.

    Args:
        config: the highest speed.
        dt_s: [n] time between the two (s).
        step: [n, 2] the way between them (m).
        velocity: [n, 2] at the first one, estimated from positions (m/s), NaN where unknown.
        spare_m: tolerance: steps shorter than the limit by up to this also count (m).
    """
    deviation = step - velocity * dt_s[:, None]
    moved_m = np.hypot(step[:, 0], step[:, 1]) + spare_m
    deviation_m = np.hypot(deviation[:, 0], deviation[:, 1]) + spare_m
    jumped = moved_m > JUMP_M + config.max_speed_mps * dt_s
    jumped |= deviation_m > JUMP_M + 0.5 * JUMP_MPSS * dt_s**2  # never true for NaN
    return np.asarray(jumped, dtype=np.bool_)


def complete_samples(
    config: HistoryConfig,
    store: TrackStore,
    slot: IndexArray,
    stamp_ns: int | NDArray[np.int64],
    states: TrackedStates,
    row: IndexArray,
) -> Float64Array:
    """Return [n, 7] position, velocity, acceleration and yaw, with missing values estimated.

    Updates the estimators of the store.

    Args:
        config: sources of the derivatives.
        store: the tracks.
        slot: [n] which tracks, each at most once.
        stamp_ns: time of the observations, one for all or [n] (ns).
        states: the observations; their own stamp is ignored.
        row: [n] the row of ``states`` that belongs to each slot.
    """
    first = store.rings.count[slot] == 0
    dt_s = np.where(first, 0.0, (stamp_ns - store.rings.last_ns[slot]) * 1e-9)
    sample = np.empty((slot.shape[0], SAMPLE_COLUMNS))
    sample[:, POSITION] = states.position[row]

    velocity = store.velocity.step(slot, dt_s, sample[:, POSITION])
    store.position_velocity[slot] = velocity
    if config.velocity_source == "message":
        velocity = _prefer(states.velocity[row], velocity)
    sample[:, VELOCITY] = velocity

    acceleration = store.acceleration.step(slot, dt_s, velocity)
    if config.acceleration_source == "message":
        sane = np.abs(states.acceleration[row]) <= _HARDEST_MPSS
        given = np.where(sane, states.acceleration[row], np.nan)
        acceleration = _prefer(given, acceleration)
    sample[:, ACCELERATION] = acceleration

    moving = np.hypot(velocity[:, 0], velocity[:, 1]) > MOVING_MPS
    course = np.arctan2(velocity[:, 1], velocity[:, 0])
    yaw = states.yaw[row]
    angle = np.abs(yaw) < 1e6  # false for NaN; anything larger is not an angle
    unknown = np.where(moving, course, store.rings.last[slot, YAW])
    sample[:, YAW] = np.where(angle, wrap(np.where(angle, yaw, 0.0)), unknown)
    return sample


def interpolate(left: Float64Array, right: Float64Array, brackets: Brackets) -> Float64Array:
    """Return the samples [n, T, 7] at the grid times, NaN where not valid or unknown.

    Args:
        left: [n, T, 7] samples at ``brackets.left``.
        right: [n, T, 7] samples at ``brackets.right``.
        brackets: the position of each grid time between them.
    """
    sample = interpolate_linear(left, right, brackets.fraction[..., None])
    sample[..., YAW] = interpolate_angle(left[..., YAW], right[..., YAW], brackets.fraction)
    for part in (VELOCITY, ACCELERATION, slice(YAW, None)):
        sample[..., part] = fill_backwards(sample[..., part], brackets.valid)
    reach_m = np.nan_to_num(sample[:, -1, VELOCITY]) * brackets.after_s[:, None]
    sample[:, -1, POSITION] += reach_m
    return np.where(brackets.valid[..., None], sample, np.nan)


def extrapolate_covariance(covariance: Float64Array, time_s: Float64Array) -> Float64Array:
    """Return covariances [n, 4, 4] of (x, y, vx, vy) after ``time_s`` [n] of constant velocity."""
    later = np.flatnonzero(time_s)
    if not len(later):
        return covariance
    step = np.zeros((len(later), 4, 4))
    step[:] = np.eye(4)
    step[:, [0, 1], [2, 3]] = time_s[later, None]
    # A row without time is not multiplied: what is not known of it (NaN) would spread.
    result = covariance.copy()
    result[later] = step @ covariance[later] @ step.transpose(0, 2, 1)
    return result


def _prefer(given: Float64Array, estimate: Float64Array) -> Float64Array:
    """Return the given vectors [n, 2] where finite, else the estimate."""
    return np.where(np.isfinite(given).all(axis=1, keepdims=True), given, estimate)
