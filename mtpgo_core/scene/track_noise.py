# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""How noisy each agent's past is (static features of ``scene.track_noise``).

From a smooth past one can tell how an agent accelerates, and its next seconds follow from that.
From a noisy one the same figures are noise. A network that sees both kinds in training has to tell
them apart before it can trust an acceleration. What it needs for that is told here: the standard
deviation of the noise, estimated from differences of the samples. The k-th difference of white
noise has binom(2 k, k) times its variance, that of a smooth motion is nearly 0 (difference-based
estimation of variance, Hall, Kay and Titterington, Biometrika 77(3), 1990, section 1).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.schema import MOVING_MPS, BoolArray, Float32Array, Float64Array, HistoryWindow

VELOCITY_ORDER, POSITION_ORDER = 2, 3
"""Orders of the differences; chosen: a constant acceleration counts as noise in neither."""

LEAST_DIFFERENCES = 3
"""Differences for an estimate; chosen: of fewer the estimate is mostly chance."""

SMALLEST_STD = 1e-3
"""Added to the deviations (m, m/s); chosen: nobody measures better, and log 0 is not finite."""

MIDDLE_LOG = 1.5
"""Added to the decimal logarithms; chosen: 3 cm and 3 cm/s come out as 0, 1 m as 1.5."""


def track_noise(window: HistoryWindow) -> Float64Array:
    """Return [n, 5] ``NOISE_FEATURES`` of the window's agents.

    The first four are log10(std + ``SMALLEST_STD``) + ``MIDDLE_LOG``, where std is the deviation
    of the white noise in the velocity (m/s) and in the position (m), along the agent's heading at
    t and across it. The last is 1. All are 0 for an agent that was not observed for long enough.

    The values do not depend on the frame of the window.
    """
    along, across = _directions(window)
    offset = window.position - window.position[:, -1:]
    stds, known = [], np.ones(len(window), dtype=np.bool_)
    for vectors, order in ((window.velocity, VELOCITY_ORDER), (offset, POSITION_ORDER)):
        there = window.valid & np.isfinite(vectors).all(axis=-1)
        for direction in (along, across):
            values = np.einsum("ntd,nd->nt", np.nan_to_num(vectors), direction)
            std, enough = _noise_std(values, there, order)
            stds.append(std)
            known &= enough
    columns = np.stack([*map(_level, stds), known], axis=1)
    return np.where(known[:, None], columns, 0.0)


def rescaled_noise(level: Float32Array, scale: float) -> Float32Array:
    """Return one of the first four columns where all lengths are ``scale`` times as long."""
    std = 10.0 ** (level - MIDDLE_LOG) - SMALLEST_STD
    rescaled = _level(scale * np.maximum(std, 0.0)).astype(level.dtype)
    return np.where(level == 0.0, level, rescaled)  # 0 is unknown


def _level(std: NDArray[Any]) -> NDArray[Any]:
    """Return the feature of a deviation (m, m/s)."""
    return np.asarray(np.log10(std + SMALLEST_STD) + MIDDLE_LOG)


def _directions(window: HistoryWindow) -> tuple[Float64Array, Float64Array]:
    """Return [n, 2] unit vectors along and across each agent's heading at t.

    The heading is the direction of the velocity, the yaw where the agent is slower than
    ``MOVING_MPS`` and +x where that is unknown.
    """
    velocity = np.nan_to_num(window.velocity[:, -1])
    moving = np.hypot(velocity[:, 0], velocity[:, 1]) > MOVING_MPS
    course = np.arctan2(velocity[:, 1], velocity[:, 0])
    heading = np.where(moving, course, np.nan_to_num(window.yaw[:, -1]))
    cos, sin = np.cos(heading), np.sin(heading)
    return np.stack([cos, sin], axis=1), np.stack([-sin, cos], axis=1)


def _noise_std(
    values: Float64Array, there: BoolArray, order: int
) -> tuple[Float64Array, BoolArray]:
    """Return [n] the deviation of the noise in [n, T] samples, and where there were enough."""
    differences = np.diff(values, order, axis=1)
    steps = differences.shape[1]
    known = np.ones_like(differences, dtype=np.bool_)
    for shift in range(order + 1):
        known &= there[:, shift : shift + steps]
    count = known.sum(axis=1)
    squares = (np.where(known, differences, 0.0) ** 2).sum(axis=1)
    variance = squares / (np.maximum(count, 1) * math.comb(2 * order, order))
    return np.sqrt(variance), count >= LEAST_DIFFERENCES
