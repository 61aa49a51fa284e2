# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What each agent's past says in a few numbers (static features of ``scene.track_summary``).

From a clean past one can tell how an agent accelerates, and its next seconds follow from that.
From a noisy one the same figures are noise. A network that sees both kinds in training has to tell
them apart before it can trust an acceleration. What it needs for that is told here: how noisy the
track is, and how its velocity changed over the last step and over longer times.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.frames import rotate
from mtpgo_core.schema import MOVING_MPS, BoolArray, Float64Array, HistoryWindow
from mtpgo_core.task.task_description import CHANGE_STEPS

VELOCITY_ORDER, POSITION_ORDER = 2, 3
"""Orders of the differences; chosen: a constant acceleration counts as noise in neither."""

LEAST_DIFFERENCES = 3
"""Differences for an estimate; chosen: of fewer the estimate is mostly chance."""

SMALLEST_STD = 1e-3
"""Added to the deviations (m, m/s); chosen: no tracker is better, and log 0 is not finite."""

LARGEST_STD = 10.0
"""Largest deviation told apart (m, m/s); chosen: such a track tells nothing."""

MIDDLE_LOG = 1.5
"""Added to the decimal logarithms; chosen: 3 cm and 3 cm/s come out as 0, 1 m as 1.5."""

CHANGE_MPS = 0.4
"""Change of velocity per step that comes out as 1 (m/s); chosen: 2 m/s^2 at steps of 0.2 s."""

LARGEST_CHANGE = 3.0
"""Largest scaled change; chosen: what is above 6 m/s^2 is noise or an emergency."""


def track_summary(window: HistoryWindow) -> Float64Array:
    """Return [n, 15] ``TRACK_FEATURES`` of the window's agents.

    * Four levels of noise: log10(std + ``SMALLEST_STD``) + ``MIDDLE_LOG``, where std is the
      deviation of the white noise in the velocity (m/s) and in the position (m), along the agent's
      heading at t and across it. It is estimated from differences of the samples: the k-th
      difference of white noise has binom(2 k, k) times its variance, that of a smooth motion is
      nearly 0 (difference-based estimation of variance, Hall, Kay and Titterington, Biometrika
      77(3), 1990, section 1).
    * 1; like the levels it is 0 for an agent that was not observed for long enough.
    * The change of the velocity over the last ``CHANGE_STEPS`` steps, along the heading and
      across it: per step, divided by ``CHANGE_MPS``, at most ``LARGEST_CHANGE``. 0 where the
      agent was not observed that long ago.

    The values do not depend on the frame of the window.
    """
    heading = _heading(window)
    offset = window.position - window.position[:, -1:]
    velocity, velocity_known = _along_heading(window, window.velocity, heading)
    position, position_known = _along_heading(window, offset, heading)
    velocity_std, velocity_enough = _noise_std(velocity, velocity_known, VELOCITY_ORDER)
    position_std, position_enough = _noise_std(position, position_known, POSITION_ORDER)
    known = (velocity_enough & position_enough)[:, None]
    levels = _level(np.concatenate([velocity_std, position_std], axis=1))
    changes = _changes(velocity, velocity_known).reshape(len(window), 2 * len(CHANGE_STEPS))
    return np.concatenate([np.where(known, levels, 0.0), known, changes], axis=1)


def velocity_changes(window: HistoryWindow) -> Float64Array:
    """Return [n, 2, 5] the last features of :func:`track_summary`: changes along and across."""
    return _changes(*_along_heading(window, window.velocity, _heading(window)))


def rescaled_noise(level: NDArray[Any], scale: float) -> NDArray[Any]:
    """Return a level of noise where all lengths are ``scale`` times as long."""
    std = 10.0 ** (level - MIDDLE_LOG) - SMALLEST_STD
    rescaled = _level(scale * np.maximum(std, 0.0)).astype(level.dtype)
    return np.where(level == 0.0, level, rescaled)  # 0 is unknown


def _level(std: NDArray[Any]) -> NDArray[Any]:
    """Return the feature of a deviation (m, m/s)."""
    return np.asarray(np.log10(np.minimum(std, LARGEST_STD) + SMALLEST_STD) + MIDDLE_LOG)


def _heading(window: HistoryWindow) -> Float64Array:
    """Return [n] the heading of each agent at t (rad).

    It is the direction of the velocity, the yaw where the agent is slower than ``MOVING_MPS`` and
    0 where that is unknown.
    """
    velocity = np.nan_to_num(window.velocity[:, -1])
    moving = np.hypot(velocity[:, 0], velocity[:, 1]) > MOVING_MPS
    course = np.arctan2(velocity[:, 1], velocity[:, 0])
    return np.where(moving, course, np.nan_to_num(window.yaw[:, -1]))


def _along_heading(
    window: HistoryWindow, vectors: Float64Array, heading: Float64Array
) -> tuple[Float64Array, BoolArray]:
    """Return [n, T, 2] components along the heading and to its left, and [n, T] if known."""
    known = window.valid & np.isfinite(vectors).all(axis=-1)
    return rotate(np.where(known[..., None], vectors, 0.0), -heading[:, None]), known


def _noise_std(
    values: Float64Array, known: BoolArray, order: int
) -> tuple[Float64Array, BoolArray]:
    """Return [n, 2] the deviation of the noise in samples [n, T, 2], and [n] if it is known."""
    differences = np.diff(values, order, axis=1)
    count = differences.shape[1]
    complete = np.ones((len(values), count), dtype=np.bool_)
    for shift in range(order + 1):
        complete &= known[:, shift : shift + count]
    enough = complete.sum(axis=1)
    squares = (np.where(complete[..., None], differences, 0.0) ** 2).sum(axis=1)
    variance = squares / (np.maximum(enough, 1) * math.comb(2 * order, order))[:, None]
    return np.sqrt(variance), enough >= LEAST_DIFFERENCES


def _changes(velocity: Float64Array, known: BoolArray) -> Float64Array:
    """Return [n, 2, 5] the scaled changes of the velocities [n, T, 2] over ``CHANGE_STEPS``."""
    return np.stack([_change(velocity, known, steps) for steps in CHANGE_STEPS], axis=-1)


def _change(velocity: Float64Array, known: BoolArray, steps: int) -> Float64Array:
    """Return [n, 2] the scaled change of the velocities [n, T, 2] over the last steps."""
    if steps >= velocity.shape[1]:
        return np.zeros((len(velocity), 2))
    change = (velocity[:, -1] - velocity[:, -1 - steps]) / (CHANGE_MPS * steps)
    both = known[:, -1] & known[:, -1 - steps]
    return np.where(both[:, None], np.clip(change, -LARGEST_CHANGE, LARGEST_CHANGE), 0.0)
