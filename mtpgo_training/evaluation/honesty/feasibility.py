# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Whether predicted paths can be driven: reversing, creeping, lateral acceleration.

``path`` [n, H, 2] is the heaviest mode (m), ``start`` [n, 4] position and velocity at the time of
the prediction (m, m/s), ``dt_s`` the time between two steps (s).
"""

from __future__ import annotations

import numpy as np

from mtpgo_core.quality.metrics import Array
from mtpgo_core.schema import MOVING_MPS, BoolArray

REVERSE_M = 0.2
"""A second that leads back against the course by more is reversing (m); chosen above the
difference of an exact stop and a predicted one."""

COURSE_M = 0.2
"""A second's displacement gives a new course if it is at least this long (m); chosen."""

CREEP_M = 0.5
"""A standing road user that is predicted to move farther creeps (m); chosen above tracking noise,
below the length of a step or a car's gap."""

LATERAL_MPS2 = (4.0, 8.0)
"""Limits of the lateral acceleration (m/s^2): more than the first is rare in traffic, more than
the second is beyond dry friction for most vehicles; chosen."""


def reverses(path: Array, start: Array, dt_s: float) -> BoolArray:
    """[n] whether a path leads back: in a second, by more than :data:`REVERSE_M`.

    The path is cut into whole seconds. The displacement in each is measured along the course of
    the seconds before: at first that of the velocity, then that of the last displacement of at
    least :data:`COURSE_M`. A turn is none, since the course turns with it second by second. Never
    true for agents that do not move at the start.
    """
    second = max(1, round(1.0 / dt_s))
    points = np.concatenate([start[:, None, :2], path[:, second - 1 :: second]], axis=1)
    moves = np.diff(points, axis=1)
    speed = np.linalg.norm(start[:, 2:], axis=1)
    moving = speed > MOVING_MPS
    course = start[:, 2:] / np.where(moving, speed, 1.0)[:, None]
    back = np.zeros(len(path), dtype=bool)
    for k in range(moves.shape[1]):
        move = moves[:, k]
        back |= (move * course).sum(axis=1) < -REVERSE_M
        length = np.linalg.norm(move, axis=1)
        long = length >= COURSE_M
        course = np.where(long[:, None], move / np.where(long, length, 1.0)[:, None], course)
    return np.asarray(back & moving)


def final_displacement(path: Array, start: Array) -> Array:
    """[n] distance of the end of the path from its start (m)."""
    return np.linalg.norm(path[:, -1] - start[:, :2], axis=1)


def lateral_acceleration(path: Array, dt_s: float) -> Array:
    """[n, H - 2] speed times yaw rate along the path (m/s^2), from its second differences.

    The part of the acceleration across the mean velocity of two consecutive steps; zero where
    that is below ``MOVING_MPS``, since a course is not defined there.
    """
    velocity = np.diff(path, axis=1) / dt_s
    before, after = velocity[:, :-1], velocity[:, 1:]
    cross = before[..., 0] * after[..., 1] - before[..., 1] * after[..., 0]
    speed = 0.5 * np.linalg.norm(before + after, axis=-1)
    moving = speed > MOVING_MPS
    return np.where(moving, np.abs(cross) / (np.where(moving, speed, 1.0) * dt_s), 0.0)
