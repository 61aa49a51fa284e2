# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The prediction that always can be given: straight on, with a covariance that grows honestly.

It serves where the model cannot (design section 4), and stands beside every result (D16).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mtpgo_core.schema import Float64Array, HistoryWindow, Prediction, Source

MOVING_MPS = 0.5
"""Up to this speed the direction of motion is taken from the yaw."""


@dataclass(frozen=True)
class ConstantVelocityNoise:
    """How uncertain an agent is that is taken to keep its velocity.

    Acceleration is white noise along and across the direction of motion, so after a time t the
    variance is ``position_std^2 + velocity_std^2 t^2 + density t^3 / 3`` on each axis. The
    defaults are of the size seen on recorded urban and motorway traffic.

    Attributes:
        position_std_m: of the observed position (m).
        velocity_std_mps: of the observed velocity (m/s).
        unknown_velocity_std_mps: of a velocity that was never known and is taken as zero (m/s).
        along_m2ps3: spectral density of the acceleration along the motion (m^2/s^3).
        across_m2ps3: likewise across it.
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
    """Every agent of the window at constant velocity, row by row.

    Args:
        window: agents not present at t get NaN.
        horizon_steps: H.
        dt_s: step of the horizon (s).
        modes: M; the first has all the weight, the others are copies of it with none.
        noise: growth of the covariance. The tracker's covariance, where the window has a usable
            one, takes the place of the observation's.
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
    """States [n, 4] (m, m/s) and yaws [n] (rad) at t, from which predictions start.

    A velocity that was never known is zero; a yaw that was never known is 0.
    """
    velocity = np.nan_to_num(window.velocity[:, -1], nan=0.0)
    initial = np.concatenate([window.position[:, -1], velocity], axis=1)
    return initial, np.nan_to_num(window.yaw[:, -1], nan=0.0)


def motion_yaw(mean: Float64Array, initial_yaw: Float64Array) -> Float64Array:
    """[n, M, H] direction of motion of states [n, M, H, 4]; where one stands, the last before.

    Args:
        mean: x, y, vx, vy along the horizon.
        initial_yaw: [n] for agents that stand from the start (rad).
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
    """Covariances [n, S, S] made symmetric; NaN where not finite or not positive definite."""
    usable = np.asarray(np.isfinite(covariance).all(axis=(1, 2)))
    result = np.full_like(covariance, np.nan)
    if usable.any():
        some = covariance[usable]
        some = 0.5 * (some + some.transpose(0, 2, 1))
        some[np.linalg.eigvalsh(some)[:, 0] <= 0.0] = np.nan
        result[usable] = some
    return result


def _covariance(
    window: HistoryWindow, time_s: Float64Array, course: Float64Array, noise: ConstantVelocityNoise
) -> Float64Array:
    """[n, H, 2, 2] of the position (m^2)."""
    known = np.asarray(np.isfinite(window.velocity[:, -1]).all(axis=1))
    speed_std = np.where(known, noise.velocity_std_mps, noise.unknown_velocity_std_mps)
    observed = np.zeros((len(window), 4, 4))
    observed[:, [0, 1], [0, 1]] = noise.position_std_m**2
    observed[:, [2, 3], [2, 3]] = speed_std[:, None] ** 2
    tracked = usable_covariances(window.covariance)
    observed = np.where(np.isfinite(tracked) & known[:, None, None], tracked, observed)
    time = time_s[:, None, None]
    cross = observed[:, None, :2, 2:]
    carried = observed[:, None, :2, :2] + time * (cross + np.swapaxes(cross, -1, -2))
    carried = carried + time**2 * observed[:, None, 2:, 2:]

    forward = np.stack([np.cos(course), np.sin(course)], axis=1)
    along = forward[:, :, None] * forward[:, None, :]
    across = np.eye(2) - along
    density = noise.along_m2ps3 * along + noise.across_m2ps3 * across
    return carried + density[:, None] * time**3 / 3.0
