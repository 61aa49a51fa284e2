# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Constant velocity with a growing covariance: the fallback of the model and its baseline.

It needs one observation only. See docs/design.md, decisions 16 and 17.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mtpgo_core.frames import along_and_across, rotate_covariance
from mtpgo_core.prediction.finite_output import definite_in_float32
from mtpgo_core.schema import MOVING_MPS, Float64Array, HistoryWindow, Prediction, Source

LARGEST_STD = 1e4
"""Largest standard deviation that is accepted (m, m/s); chosen, no site is larger."""


@dataclass(frozen=True)
class ConstantVelocityNoise:
    """Uncertainty of an agent that is assumed to keep its velocity.

    Acceleration is white noise along and across the direction of motion, so after a time t the
    variance is ``position_std^2 + velocity_std^2 t^2 + density t^3 / 3`` on each axis. The
    defaults are chosen by order of magnitude from recorded urban and motorway traffic.

    Attributes:
        position_std_m: standard deviation of the observed position (m).
        velocity_std_mps: standard deviation of the observed velocity (m/s).
        unknown_velocity_std_mps: standard deviation of a velocity that was never known and is
            assumed to be zero (m/s).
        along_m2ps3: spectral density of the acceleration along the motion (m^2/s^3).
        across_m2ps3: spectral density of the acceleration across the motion (m^2/s^3).
    """

    position_std_m: float = 0.2
    velocity_std_mps: float = 0.3
    unknown_velocity_std_mps: float = 10.0
    along_m2ps3: float = 1.0
    across_m2ps3: float = 0.1


def predict_constant_velocity(
    window: HistoryWindow,
    *,
    horizon_steps: int,
    dt_s: float,
    modes: int = 1,
    noise: ConstantVelocityNoise = ConstantVelocityNoise(),
) -> Prediction:
    """Return the prediction of every agent of the window at constant velocity, row by row.

    Args:
        window: agents not present at t get NaN.
        horizon_steps: H.
        dt_s: step of the horizon (s).
        modes: M; the first has weight 1, the others are copies of it with weight 0.
        noise: growth of the covariance. A usable covariance of the tracker replaces the standard
            deviations of the observation.
    """
    time_s = dt_s * np.arange(1, horizon_steps + 1, dtype=np.float64)
    initial, yaw = initial_states(window)
    n = len(window)
    mean = np.empty((n, modes, horizon_steps, 4))
    reach = initial[:, None, 2:] * time_s[:, None]
    mean[..., :2] = (initial[:, None, :2] + reach)[:, None]
    mean[..., 2:] = initial[:, None, None, 2:]
    course = motion_yaw(mean[:, :1, :1], yaw)[:, 0, 0]
    covariance = _covariance(window, time_s, course, noise)
    weight = np.zeros((n, modes))
    weight[:, 0] = 1.0
    absent = ~window.valid[:, -1]
    for values in (weight, mean, course, covariance):
        values[absent] = np.nan
    return Prediction(
        stamp_ns=window.stamp_ns,
        frame_id=window.frame_id,
        key=window.key,
        agent_class=window.agent_class,
        z=window.z,
        size=window.size,
        initial=initial,
        initial_yaw=yaw,
        time_s=time_s,
        weight=weight,
        mean=mean,
        yaw=np.broadcast_to(course[:, None, None], (n, modes, horizon_steps)).copy(),
        covariance=np.repeat(covariance[:, None], modes, axis=1),
        source=np.full(n, Source.CONSTANT_VELOCITY, dtype=np.uint8),
    )


def initial_states(window: HistoryWindow) -> tuple[Float64Array, Float64Array]:
    """Return states [n, 4] (m, m/s) and yaws [n] (rad) at t, from which predictions start.

    A velocity or yaw that was never known is 0.
    """
    velocity = np.nan_to_num(window.velocity[:, -1], nan=0.0)
    initial = np.concatenate([window.position[:, -1], velocity], axis=1)
    return initial, np.nan_to_num(window.yaw[:, -1], nan=0.0)


def motion_yaw(mean: Float64Array, initial_yaw: Float64Array) -> Float64Array:
    """Return [n, M, H] the direction of motion (rad); at standstill the last one before.

    Args:
        mean: [n, M, H, 4] x, y, vx, vy along the horizon (m, m/s).
        initial_yaw: [n] for agents that stand still from the start (rad).
    """
    vx, vy = mean[..., 2], mean[..., 3]
    moving = vx * vx + vy * vy > MOVING_MPS**2
    course = np.arctan2(vy, vx)
    if not moving.all():
        steps = np.where(moving, np.arange(1, mean.shape[2] + 1), 0)
        last = np.maximum.accumulate(steps, axis=2)
        first = np.broadcast_to(initial_yaw[:, None, None], (*course.shape[:2], 1))
        course = np.take_along_axis(np.concatenate([first, course], axis=2), last, axis=2)
    return course


def usable_covariances(covariance: Float64Array) -> Float64Array:
    """Return symmetric covariances [n, S, S], NaN where they are not usable.

    Not usable are covariances that are not finite, not positive definite, or have a standard
    deviation above :data:`LARGEST_STD`, which means unknown.
    """
    # False for NaN; the eigenvalues of numbers near the largest double would overflow.
    usable = np.asarray((np.abs(covariance) <= LARGEST_STD**2).all(axis=(1, 2)))
    result = np.full_like(covariance, np.nan)
    if usable.any():
        some = covariance[usable]
        some = 0.5 * (some + some.transpose(0, 2, 1))
        some[np.linalg.eigvalsh(some)[:, 0] <= 0.0] = np.nan
        result[usable] = some
    return result


def covariance_along_paths(
    observed: Float64Array,
    initial_yaw: Float64Array,
    yaw: Float64Array,
    time_s: Float64Array,
    noise: ConstantVelocityNoise = ConstantVelocityNoise(),
) -> Float64Array:
    """Return [n, M, H, 2, 2] position covariances (m^2) for paths that are given without any.

    The state's covariance at the stamp grows as at constant velocity. Its components along and
    across the heading turn with the path: an agent ahead of its prediction is ahead along the
    road, also after a bend.

    Args:
        observed: [n, 4, 4] of (x, y, vx, vy) at the stamp (m^2, m^2/s, m^2/s^2). Where it is not
            usable, for example NaN, the result is NaN.
        initial_yaw: [n] heading at the stamp (rad).
        yaw: [n, M, H] heading along the paths (rad).
        time_s: [H] seconds after the stamp.
        noise: of the acceleration.
    """
    own = rotate_covariance(usable_covariances(observed), -initial_yaw)
    grown = _grown(own, time_s, np.zeros(len(own)), noise)
    xx, xy, yy = along_and_across(grown[:, None], -yaw)
    return np.stack([np.stack([xx, xy], axis=-1), np.stack([xy, yy], axis=-1)], axis=-2)


def assumed_covariances(
    agents: int, noise: ConstantVelocityNoise = ConstantVelocityNoise()
) -> Float64Array:
    """Return [agents, 4, 4] covariances of (x, y, vx, vy) for observations that give none."""
    variances = np.repeat([noise.position_std_m**2, noise.velocity_std_mps**2], 2)
    return np.tile(np.diag(variances), (agents, 1, 1))


def _covariance(
    window: HistoryWindow, time_s: Float64Array, course: Float64Array, noise: ConstantVelocityNoise
) -> Float64Array:
    """Return [n, H, 2, 2] the covariance of the position (m^2)."""
    known = np.asarray(np.isfinite(window.velocity[:, -1]).all(axis=1))
    speed_std = np.where(known, noise.velocity_std_mps, noise.unknown_velocity_std_mps)
    observed = np.zeros((len(window), 4, 4))
    observed[:, [0, 1], [0, 1]] = noise.position_std_m**2
    observed[:, [2, 3], [2, 3]] = speed_std[:, None] ** 2
    tracked = usable_covariances(window.covariance)
    given = np.isfinite(tracked) & known[:, None, None]
    grown = _grown(np.where(given, tracked, observed), time_s, course, noise)
    # A covariance may be so close to singular that it is not definite after rounding.
    unusable = given.all(axis=(1, 2)) & ~definite_in_float32(grown).all(axis=1)
    if unusable.any():
        grown[unusable] = _grown(observed[unusable], time_s, course[unusable], noise)
    return grown


def _grown(
    observed: Float64Array,
    time_s: Float64Array,
    course: Float64Array,
    noise: ConstantVelocityNoise,
) -> Float64Array:
    """Return [n, H, 2, 2] position covariances (m^2) propagated from those of states [n, 4, 4]."""
    time = time_s[:, None, None]
    cross = observed[:, None, :2, 2:]
    carried = observed[:, None, :2, :2] + time * (cross + np.swapaxes(cross, -1, -2))
    carried = carried + time**2 * observed[:, None, 2:, 2:]

    forward = np.stack([np.cos(course), np.sin(course)], axis=1)
    along = forward[:, :, None] * forward[:, None, :]
    across = np.eye(2) - along
    density = noise.along_m2ps3 * along + noise.across_m2ps3 * across
    return carried + density[:, None] * time**3 / 3.0
