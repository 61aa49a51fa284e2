# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Manoeuvres of road users over the horizon, by which results are broken down.

They are found from the observed positions p_0 (at the instant t) to p_H (at the end of the
horizon), never from a prediction, and only for road users of which all these positions were
observed: a road user that leaves the recording earlier has no manoeuvre. The rules, with T the
length of the horizon:

``standing``
    No position is farther than ``STANDING_M`` from p_0.
``turning``
    Not standing, and the course changes by more than ``TURNING_RAD``. The first course is the
    direction from p_0 to the first position at least ``COURSE_S`` later and ``COURSE_M`` away,
    the last course that to p_H from the last such position before it. A road user that moves less
    has no course and does not turn.
``braking``
    The speed falls by at least ``BRAKING_MPSS`` (T - 1 s) between the first and the last second,
    each the net distance covered in that second. Only where T is 2 s or more.
``change_left``, ``change_right``
    Vehicles (all classes but bicycles, pedestrians and animals) that have a course, do not stand
    and do not turn. *Where the recording has lane markings*: the path crosses more markings to
    that side than to the other one. A step of the path crosses a marking if it meets it at an
    angle of less than ``CROSSING_RAD``. *Where it has none*: p_H is more than ``ASIDE_M`` to
    that side of p_0, across the mean of the first and the last course. On a straight road and in
    a bend of constant curvature, driving on gives zero there. A change that begins before t or
    ends after T may be missed; an S-bend may look like a change.
``lane_keep``
    The other vehicles that have a course, do not stand and do not turn.

All but ``braking`` exclude each other; ``braking`` may come with any of them but ``standing``.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.schema import AgentClass, BoolArray, ClassArray, Float64Array

MANOEUVRES = ("lane_keep", "change_left", "change_right", "standing", "braking", "turning")
"""Names of the manoeuvres; the i-th is bit i of a label."""

STANDING_M = 1.0
"""A road user that stays this close to its position stands (m); chosen above tracking noise."""

TURNING_RAD = np.radians(30.0)
"""A larger change of course is a turn (rad); chosen above what a lane change makes."""

BRAKING_MPSS = 0.75
"""A larger mean deceleration is braking (m/s^2); chosen above that of coasting."""

COURSE_S, COURSE_M = 1.0, 2.0
"""A course is taken over at least this time (s) and this distance (m); chosen so that the noise of
the positions turns it by a few degrees only."""

ASIDE_M = 2.0
"""Without markings, a larger lateral shift is a lane change (m); chosen above half the width of a
lane."""

CROSSING_RAD = np.radians(30.0)
"""Markings crossed at a larger angle belong to another road (rad); chosen far above the angle of a
lane change."""

_NO_VEHICLES = (AgentClass.BICYCLE, AgentClass.PEDESTRIAN, AgentClass.ANIMAL)
_PAIRS_AT_ONCE = 1_000_000
"""Pairs of a step and a marking computed together; chosen, bounds the memory."""

LabelArray = NDArray[np.uint8]


def label(
    path: Float64Array,
    known: BoolArray,
    dt_s: float,
    agent_class: ClassArray,
    lanes: Sequence[Float64Array] = (),
) -> LabelArray:
    """Return [n] the manoeuvres of n road users, bit i for the i-th of :data:`MANOEUVRES`.

    Args:
        path: [n, H + 1, 2] observed positions from t on (m).
        known: [n, H + 1] which of them were observed.
        dt_s: time between two of them (s).
        agent_class: [n] :class:`~mtpgo_core.schema.AgentClass` values.
        lanes: lane markings, [k, 2] each (m); empty where they are not known.
    """
    whole = known.all(axis=1)
    standing = whole & (np.linalg.norm(path - path[:, :1], axis=-1).max(axis=1) <= STANDING_M)
    first, last, has_course = _courses(path, dt_s)
    change = np.arctan2(_cross(first, last), np.sum(first * last, axis=-1))
    turning = whole & ~standing & has_course & (np.abs(change) > TURNING_RAD)
    vehicle = is_vehicle(agent_class)
    drives_on = whole & ~standing & has_course & ~turning & vehicle
    if lanes:
        aside = np.zeros(len(path), dtype=np.int64)
        aside[drives_on] = _crossings(path[drives_on], lanes)
    else:
        aside = _shift(path, first + last)
    found = {
        "lane_keep": drives_on & (aside == 0),
        "change_left": drives_on & (aside > 0),
        "change_right": drives_on & (aside < 0),
        "standing": standing,
        "braking": whole & ~standing & _brakes(path, dt_s),
        "turning": turning,
    }
    bits = np.zeros(len(path), dtype=np.uint8)
    for i, name in enumerate(MANOEUVRES):
        bits |= found[name].astype(np.uint8) << np.uint8(i)
    return bits


def is_vehicle(agent_class: ClassArray) -> BoolArray:
    """Return [n] whether a class is that of a vehicle: all but bicycles, pedestrians, animals."""
    return np.asarray(~np.isin(agent_class, _NO_VEHICLES))


def members(labels: LabelArray, name: str) -> BoolArray:
    """Return [n] whether a road user does the manoeuvre ``name``."""
    return np.asarray(labels >> np.uint8(MANOEUVRES.index(name)) & 1, dtype=np.bool_)


def _courses(path: Float64Array, dt_s: float) -> tuple[Float64Array, Float64Array, BoolArray]:
    """Return the first and last course as unit vectors [n, 2], and [n] whether they exist."""
    steps = max(1, int(np.ceil(COURSE_S / dt_s - 1e-6)))
    first, ahead = _first_stretch(path, steps)
    last, behind = _first_stretch(path[:, ::-1], steps)
    return first, -last, ahead & behind


def _first_stretch(path: Float64Array, steps: int) -> tuple[Float64Array, BoolArray]:
    """Return [n, 2] the direction to the first point late and far enough, [n] if there is one."""
    away = path - path[:, :1]
    far = np.linalg.norm(away, axis=-1) >= COURSE_M
    far[:, :steps] = False
    reached = away[np.arange(len(path)), np.argmax(far, axis=1)]
    there = far.any(axis=1)
    length = np.where(there, np.linalg.norm(reached, axis=-1), 1.0)
    return np.where(there[:, None], reached / length[:, None], 0.0), there


def _brakes(path: Float64Array, dt_s: float) -> BoolArray:
    steps = round(1.0 / dt_s)
    horizon_s = (path.shape[1] - 1) * dt_s
    if steps < 1 or horizon_s < 2.0 - 1e-6:
        return np.zeros(len(path), dtype=np.bool_)
    begin = np.linalg.norm(path[:, steps] - path[:, 0], axis=-1)
    end = np.linalg.norm(path[:, -1] - path[:, -1 - steps], axis=-1)
    lost = (begin - end) / (steps * dt_s)
    return np.asarray(lost >= BRAKING_MPSS * (horizon_s - 1.0), dtype=np.bool_)


def _shift(path: Float64Array, along: Float64Array) -> NDArray[np.int64]:
    """Return [n] 1 for a shift to the left of the mean course, -1 to the right, 0 for neither."""
    length = np.linalg.norm(along, axis=-1)
    across = _cross(along, path[:, -1] - path[:, 0]) / np.where(length > 0.0, length, 1.0)
    return np.where(np.abs(across) > ASIDE_M, np.sign(across), 0.0).astype(np.int64)


def _crossings(path: Float64Array, lanes: Sequence[Float64Array]) -> NDArray[np.int64]:
    """Return [n] the number of markings crossed to the left minus those crossed to the right."""
    start = np.concatenate([line[:-1] for line in lanes])
    line = np.concatenate([line[1:] - line[:-1] for line in lanes])
    net = np.zeros(len(path), dtype=np.int64)
    at_once = max(1, _PAIRS_AT_ONCE // max(1, len(line) * path.shape[1]))
    for begin in range(0, len(path), at_once):
        some = path[begin : begin + at_once]
        move = np.diff(some, axis=1)[:, :, None]  # [n, H, 1, 2]
        before = _cross(line, some[:, :-1, None] - start)  # > 0: left of the line as it runs
        after = _cross(line, some[:, 1:, None] - start)
        met = (before >= 0.0) != (after >= 0.0)
        with np.errstate(invalid="ignore", divide="ignore"):
            share = before / (before - after)
            point = some[:, :-1, None] + share[..., None] * move - start
            place = np.sum(point * line, axis=-1) / np.sum(line * line, axis=-1)
        dot = np.sum(move * line, axis=-1)
        steep = np.abs(_cross(line, move)) > np.tan(CROSSING_RAD) * np.abs(dot)
        met &= (place >= 0.0) & (place < 1.0) & ~steep
        # To the left of the motion, whichever way the line runs.
        net[begin : begin + at_once] = (met * np.sign(after - before) * np.sign(dot)).sum((1, 2))
    return net


def _cross(a: Float64Array, b: Float64Array) -> Float64Array:
    """Return [...] the third component of the cross product of plane vectors."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0], dtype=np.float64)
