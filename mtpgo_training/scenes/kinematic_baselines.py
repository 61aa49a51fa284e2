# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Motion without learning, from the last observed state: the yardsticks of every result.

Each takes the window that the model gets and returns [n, H, 2] positions (m) in its frame, for
every agent of the window. An agent that is not valid at t gets NaN.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mtpgo_core.prediction.constant_velocity import predict_constant_velocity
from mtpgo_core.schema import Float64Array, HistoryWindow

Baseline = Callable[[HistoryWindow, int, float], Float64Array]


YAW_RATE_OVER_S = 0.6
"""Time over which the turn rate is measured (s): shorter ones amplify the tracker's jitter."""

MOVING_ABOVE_MPS = 1.0
"""Speed below which the course says nothing about turning (m/s)."""


def constant_velocity(window: HistoryWindow, horizon_steps: int, dt_s: float) -> Float64Array:
    """[n, H, 2] straight on at the velocity at t (m)."""
    prediction = predict_constant_velocity(window, horizon_steps=horizon_steps, dt_s=dt_s)
    return prediction.mean[:, 0, :, :2]


def constant_acceleration(window: HistoryWindow, horizon_steps: int, dt_s: float) -> Float64Array:
    """[n, H, 2] at the acceleration vector at t, open loop as in the paper (m)."""
    time = _times(horizon_steps, dt_s)
    straight = constant_velocity(window, horizon_steps, dt_s)
    return straight + 0.5 * _last(window.acceleration)[:, None] * time**2


def constant_turn_rate(window: HistoryWindow, horizon_steps: int, dt_s: float) -> Float64Array:
    """[n, H, 2] on a circle at the speed and turn rate at t (CTRV) (m).

    The turn rate is the change of course over the last ``YAW_RATE_OVER_S``; an agent slower than
    ``MOVING_ABOVE_MPS`` or not seen that long goes straight on.
    """
    velocity = _last(window.velocity)
    speed = np.linalg.norm(velocity, axis=-1)
    course = np.arctan2(velocity[:, 1], velocity[:, 0])
    rate = _turn_rate(window, dt_s, speed)[:, None]
    time = _times(horizon_steps, dt_s)[:, 0]
    angle = rate * time  # [n, H]
    # Chord of the arc: v t sinc(angle / 2) along the mean course; smooth through zero rate.
    chord = speed[:, None] * time * np.sinc(angle / (2.0 * np.pi))
    mean_course = course[:, None] + 0.5 * angle
    step = np.stack([chord * np.cos(mean_course), chord * np.sin(mean_course)], axis=-1)
    return np.asarray(window.position[:, -1, None] + step, dtype=np.float64)


BASELINES: dict[str, Baseline] = {
    "cv": constant_velocity,
    "ca": constant_acceleration,
    "ctrv": constant_turn_rate,
}


def _times(horizon_steps: int, dt_s: float) -> Float64Array:
    return (np.arange(1, horizon_steps + 1, dtype=np.float64) * dt_s)[:, None]


def _last(vectors: Float64Array) -> Float64Array:
    """[n, 2] vectors at t, zero where unknown: an agent seen once is taken to stand."""
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
