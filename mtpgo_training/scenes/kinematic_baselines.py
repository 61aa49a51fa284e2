# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Motion without learning, from the last observed state: the baselines of every result.

All start from the window that the model gets and give [n, H, 2] positions (m) in its frame, for
every agent of the window. An agent that is not valid at t gets NaN.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mtpgo_core.prediction.constant_velocity import predict_constant_velocity
from mtpgo_core.schema import Float64Array, HistoryWindow

BASELINES = ("cv", "ca", "ctrv")
"""Names: constant velocity, constant acceleration, constant turn rate and velocity."""

YAW_RATE_OVER_S = 0.6
"""Time over which the turn rate is measured (s); chosen: shorter ones amplify the tracker's
jitter."""

MOVING_ABOVE_MPS = 1.0
"""Speed below which the course says nothing about turning (m/s); chosen."""


@dataclass(frozen=True)
class BaselinePath:
    """What one baseline predicts.

    Attributes:
        position: [n, H, 2] (m).
        covariance: [n, H, 2, 2] of the positions (m^2), None where the baseline has none.
    """

    position: Float64Array
    covariance: Float64Array | None = None


def predict_baselines(
    window: HistoryWindow, horizon_steps: int, dt_s: float
) -> dict[str, BaselinePath]:
    """Return what each of :data:`BASELINES` predicts for the agents of a window.

    ``cv`` goes straight on at the velocity at t. ``ca`` keeps the acceleration vector at t, open
    loop as in the paper. ``ctrv`` drives on a circle at the speed and turn rate at t: the change
    of course over the last ``YAW_RATE_OVER_S``, zero for an agent that is slower than
    ``MOVING_ABOVE_MPS`` or was not observed that long ago.

    Args:
        window: history up to t.
        horizon_steps: H.
        dt_s: step of the horizon (s).
    """
    straight_on = predict_constant_velocity(window, horizon_steps=horizon_steps, dt_s=dt_s)
    path = straight_on.mean[:, 0, :, :2]
    time = straight_on.time_s
    return {
        "cv": BaselinePath(path, straight_on.covariance[:, 0]),
        "ca": BaselinePath(path + 0.5 * _last(window.acceleration)[:, None] * time[:, None] ** 2),
        "ctrv": BaselinePath(_on_a_circle(window, time, dt_s)),
    }


def _on_a_circle(window: HistoryWindow, time: Float64Array, dt_s: float) -> Float64Array:
    """[n, H, 2] positions of ``ctrv`` at the times [H] ahead (s)."""
    velocity = _last(window.velocity)
    speed = np.linalg.norm(velocity, axis=-1)
    course = np.arctan2(velocity[:, 1], velocity[:, 0])
    angle = _turn_rate(window, dt_s, speed)[:, None] * time  # [n, H]
    # Chord of the arc: v t sinc(angle / 2) along the mean course; smooth through zero rate.
    chord = speed[:, None] * time * np.sinc(angle / (2.0 * np.pi))
    mean_course = course[:, None] + 0.5 * angle
    step = np.stack([chord * np.cos(mean_course), chord * np.sin(mean_course)], axis=-1)
    return np.asarray(window.position[:, -1, None] + step, dtype=np.float64)


def _last(vectors: Float64Array) -> Float64Array:
    """[n, 2] vectors at t, zero where unknown: an agent observed once is taken to stand."""
    return np.nan_to_num(vectors[:, -1], nan=0.0)


def _turn_rate(window: HistoryWindow, dt_s: float, speed: Float64Array) -> Float64Array:
    """[n] change of course over the last ``YAW_RATE_OVER_S`` (rad/s), zero where unknown."""
    back = min(max(1, round(YAW_RATE_OVER_S / dt_s)), window.valid.shape[1] - 1)
    if back < 1:
        return np.zeros(len(window))
    before, now = window.velocity[:, -1 - back], window.velocity[:, -1]
    with np.errstate(invalid="ignore"):
        turn = np.arctan2(
            before[:, 0] * now[:, 1] - before[:, 1] * now[:, 0], np.sum(before * now, axis=-1)
        )
        moving = (np.linalg.norm(before, axis=-1) > MOVING_ABOVE_MPS) & (speed > MOVING_ABOVE_MPS)
    known = window.valid[:, -1 - back] & window.valid[:, -1] & moving & np.isfinite(turn)
    return np.where(known, turn / (back * dt_s), 0.0)
