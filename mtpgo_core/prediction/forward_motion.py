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
    ClassArray,
    Float64Array,
    IndexArray,
    Prediction,
)

_NEVER_TURNS = np.ones(256, dtype=np.bool_)
_NEVER_TURNS[[AgentClass.UNKNOWN, AgentClass.PEDESTRIAN, AgentClass.ANIMAL]] = False
"""Classes that do not turn round within a step; an unknown road user may be a pedestrian."""

_VEHICLE_MPS = 4.0
"""Speed from which an agent of unknown class is no pedestrian (m/s); chosen: a fast run."""

_LEAST_M = 1e-3
"""Shortest displacement in a step whose direction counts (m); chosen: 5 mm/s."""


def moving_vehicles(agent_class: ClassArray, velocity: Float64Array) -> BoolArray:
    """Return [n] which agents are vehicles, or too fast to be anything else, and move.

    Args:
        agent_class: [n] :class:`~mtpgo_core.schema.AgentClass` values.
        velocity: [n, 2] at t (m/s), NaN where it was never known, which counts as not moving.
    """
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    unknown = (agent_class == AgentClass.UNKNOWN) & (speed > _VEHICLE_MPS)
    return np.asarray((_NEVER_TURNS[agent_class] | unknown) & (speed > MOVING_MPS))


def without_reversing(prediction: Prediction) -> Prediction:
    """Return the prediction with no vehicle that moves at t reversing in any mode.

    A path turns back in the first step whose displacement has a component against that of the
    step before (at first, against the velocity at t). From there on it stays where it was, with
    velocity 0; direction and covariance stay. Networks give such paths rarely, for vehicles that
    brake to a stop.
    """
    rows = np.flatnonzero(moving_vehicles(prediction.agent_class, prediction.initial[:, 2:]))
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
    """Return [r] whether any path has a displacement against the one before, however short.

    Few agents have one, and only those are looked at step by step.

    Args:
        displacement: [r, M, H, 2] in each step (m).
        initial: [r, 4] states at t.
    """
    back = (displacement[:, :, 1:] * displacement[:, :, :-1]).sum(axis=-1) < 0.0
    at_first = (displacement[:, :, 0] * initial[:, None, 2:]).sum(axis=-1) < 0.0
    return np.asarray(back.any(axis=(1, 2)) | at_first.any(axis=1))


def _last_forward_step(displacement: Float64Array, initial: Float64Array) -> IndexArray:
    """Return [r, M] the last step before a path turns back, -1 for none, H - 1 if it does not.

    Args:
        displacement: [r, M, H, 2] in each step (m).
        initial: [r, 4] states at t.
    """
    rows, modes, steps, _ = displacement.shape
    long = (displacement**2).sum(axis=-1) > _LEAST_M**2
    before = np.broadcast_to(initial[:, None, 2:], (rows, modes, 2))
    last = np.full((rows, modes), steps - 1)
    going = np.ones((rows, modes), dtype=np.bool_)
    for k in range(steps):
        step = displacement[:, :, k]
        back = going & long[:, :, k] & ((step * before).sum(axis=-1) < 0.0)
        last[back] = k - 1
        going &= ~back
        before = np.where(long[:, :, k, None], step, before)
    return last
