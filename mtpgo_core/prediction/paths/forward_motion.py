# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Moving vehicles do not reverse: a predicted path that turns back stops there instead."""

from __future__ import annotations

import dataclasses

import numpy as np

from mtpgo_core.schema import (
    MOVING_MPS,
    AgentClass,
    BoolArray,
    Float64Array,
    HistoryWindow,
    IndexArray,
    Prediction,
)

_NEVER_TURNS = np.ones(256, dtype=np.bool_)
_NEVER_TURNS[[AgentClass.UNKNOWN, AgentClass.PEDESTRIAN, AgentClass.ANIMAL]] = False
"""Classes that do not turn round within a step; an unknown road user may be a pedestrian."""

_VEHICLE_MPS = 4.0
"""Speed from which an agent of unknown class is no pedestrian (m/s); chosen: a fast run."""

_FAST_SAMPLES = 3
"""Samples of the window that are faster, or all where there are fewer; chosen: of pedestrians from
simulated trackers noise makes single samples faster, never three (measured)."""

_VEHICLE_M = 2.2
"""Length from which an agent of unknown class is no pedestrian (m); chosen: shorter than the
shortest cars, longer than a pedestrian with a pram or a bicycle."""

_COURSE_M = 3.0
"""Length of path whose chord is a course (m); chosen: a chord of an arc is at right angles to its
end where the radius is the length over pi, 0.95 m, which no vehicle with a driver reaches."""

_LEAST_M = 1e-3
"""Shortest displacement in a step whose direction counts (m); chosen: 5 mm/s."""


def moving_vehicles(window: HistoryWindow) -> BoolArray:
    """Return [n] which agents are vehicles that move at t.

    An agent of unknown class counts as a vehicle if it is too long, or was too fast at enough
    samples, to be anything else. An agent whose velocity was never known counts as standing.
    """
    speed = np.hypot(window.velocity[..., 0], window.velocity[..., 1])  # [n, T]
    fast = ((speed > _VEHICLE_MPS) & window.valid).sum(axis=1)
    was_fast = fast >= np.clip(window.valid.sum(axis=1), 1, _FAST_SAMPLES)
    unknown = window.agent_class == AgentClass.UNKNOWN
    vehicle = unknown & (was_fast | (window.size[:, 0] > _VEHICLE_M))
    return np.asarray((_NEVER_TURNS[window.agent_class] | vehicle) & (speed[:, -1] > MOVING_MPS))


def without_reversing(prediction: Prediction, window: HistoryWindow) -> Prediction:
    """Return the prediction with no vehicle that moves at t reversing in any mode.

    A path turns back at the first step whose displacement points against its course, that is the
    chord of the last :data:`_COURSE_M` of the path (straight before t). A turn with a radius below
    about a metre therefore counts as turning back, too. From that step on the path keeps its
    position, with velocity 0; yaw and covariance are unchanged. The network rarely predicts such
    paths, for vehicles that brake to a stop.

    Args:
        prediction: of all agents of the window.
        window: that it was made from.
    """
    rows = np.flatnonzero(moving_vehicles(window))
    initial, mean = prediction.initial[rows], prediction.mean[rows]  # [r, 4], [r, M, H, 4]
    start = np.broadcast_to(initial[:, None, None, :2], (*mean.shape[:2], 1, 2))
    displacement = np.diff(mean[..., :2], axis=2, prepend=start)
    some = _may_turn_back(displacement, initial)
    if not some.any():
        return prediction
    rows, initial, mean, start = rows[some], initial[some], mean[some], start[some]
    last = _last_forward_step(displacement[some], initial)  # [r, M]
    steps = mean.shape[2]
    stops = last < steps - 1
    if not stops.any():
        return prediction
    after = np.arange(steps) > last[..., None]
    place = np.take_along_axis(mean, np.maximum(last, 0)[..., None, None], axis=2)[:, :, 0, :2]
    place = np.where(last[..., None] >= 0, place, start[:, :, 0])
    held = np.concatenate([place, np.zeros_like(place)], axis=-1)[:, :, None]
    whole = prediction.mean.copy()
    whole[rows] = np.where(after[..., None], held, mean)
    yaw = prediction.yaw.copy()
    before = np.take_along_axis(yaw[rows], np.maximum(last, 0)[..., None], axis=2)
    yaw_at_stop = np.where(last[..., None] >= 0, before, prediction.initial_yaw[rows, None, None])
    yaw[rows] = np.where(after, yaw_at_stop, yaw[rows])
    return dataclasses.replace(prediction, mean=whole, yaw=yaw)


def _may_turn_back(displacement: Float64Array, initial: Float64Array) -> BoolArray:
    """Return [r] whether any path deviates from the course at t by more than 45 degrees.

    A path that does not cannot turn by 90 degrees from any of its own courses. This cheap test
    leaves few agents for :func:`_last_forward_step`.

    Args:
        displacement: [r, M, H, 2] in each step (m).
        initial: [r, 4] states at t.
    """
    along = (displacement * initial[:, None, None, 2:]).sum(axis=-1)
    squared = (displacement**2).sum(axis=-1)
    half = 0.5 * squared * (initial[:, 2:] ** 2).sum(axis=-1)[:, None, None]
    leaves = (squared > _LEAST_M**2) & ~((along > 0.0) & (along**2 >= half))
    return np.asarray(leaves.any(axis=(1, 2)))


def _last_forward_step(displacement: Float64Array, initial: Float64Array) -> IndexArray:
    """Return [r, M] the last step before a path turns back, -1 for none, H - 1 if it does not.

    Args:
        displacement: [r, M, H, 2] in each step (m).
        initial: [r, 4] states at t.
    """
    rows, modes, steps, _ = displacement.shape
    moves = displacement.reshape(-1, steps, 2)  # [r M, H, 2]
    length = np.hypot(moves[..., 0], moves[..., 1])
    course = initial[:, 2:] / np.hypot(initial[:, 2], initial[:, 3])[:, None]
    # The points of each path and their arc lengths: _COURSE_M before t, at t, after each step.
    past = np.repeat(-_COURSE_M * course, modes, axis=0)
    zero = np.zeros((len(past), 1))
    point = np.concatenate([past[:, None], np.zeros((len(past), 1, 2)), moves.cumsum(axis=1)], 1)
    arc = np.concatenate([zero - _COURSE_M, zero, length.cumsum(axis=1)], axis=1)  # [r M, H + 2]
    # The point _COURSE_M behind the begin of each step, interpolated along the path.
    wanted = arc[:, 1:-1] - _COURSE_M
    low = (arc[:, None] <= wanted[..., None]).sum(axis=-1) - 1
    path = np.arange(len(past))[:, None]
    part = (wanted - arc[path, low]) / np.maximum(arc[path, low + 1] - arc[path, low], 1e-12)
    behind = point[path, low] + part[..., None] * (point[path, low + 1] - point[path, low])
    chord = point[:, 1:-1] - behind
    turns_back = (length > _LEAST_M) & ((moves * chord).sum(axis=-1) < 0.0)
    last = np.where(turns_back.any(axis=1), turns_back.argmax(axis=1) - 1, steps - 1)
    return np.asarray(last.reshape(rows, modes))
