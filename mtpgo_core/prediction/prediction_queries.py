# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Queries on a prediction: by agent, mode, time and frame.

All functions return new arrays. A missing point (NaN, for example from a filtered cloud) stays
missing and does not affect other values.
"""

from __future__ import annotations

import dataclasses
from uuid import UUID

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mtpgo_core.frames import Pose2, rotate, rotate_covariance, wrap
from mtpgo_core.identity import key_to_text, keys_from_integers, keys_from_texts
from mtpgo_core.schema import Float64Array, IndexArray, KeyArray, Prediction

_SLACK_S = 1e-4
"""A time this close to a step is that step's (s): the published times are float32."""


def agent_row(prediction: Prediction, identity: int | str | UUID | KeyArray) -> int:
    """Return the row of the agent with an identity.

    Args:
        prediction: of n agents.
        identity: the tracker's number, UUID or text, or the [4] words of the key.

    Raises:
        KeyError: it is not among the agents.
    """
    if isinstance(identity, np.ndarray):
        key = np.asarray(identity, dtype=np.uint32).reshape(4)
    elif isinstance(identity, str | UUID):
        key = keys_from_texts([str(identity)])[0]
    else:
        key = keys_from_integers([int(identity)])[0]
    rows = np.flatnonzero((prediction.key == key).all(axis=1))
    if not len(rows):
        raise KeyError(f"agent {key_to_text(key)} is not among the {len(prediction)} predicted")
    return int(rows[0])


def most_probable_mode(prediction: Prediction) -> IndexArray:
    """Return [n] the most probable mode of each agent: 0, unless points were filtered out."""
    if prediction.weight.shape[1] == 0:
        return np.zeros(len(prediction), dtype=np.intp)
    return np.asarray(prediction.weight.argmax(axis=1))


def most_probable(prediction: Prediction) -> Prediction:
    """Return the most probable mode of each agent, with its weight: a prediction with M = 1."""
    rows, mode = np.arange(len(prediction))[:, None], most_probable_mode(prediction)[:, None]
    names = ("weight", "mean", "yaw", "covariance")
    if prediction.weight.shape[1] == 0:
        return prediction
    return dataclasses.replace(
        prediction, **{name: getattr(prediction, name)[rows, mode] for name in names}
    )


def mixture_moments(
    prediction: Prediction, time_s: ArrayLike | None = None
) -> tuple[Float64Array, Float64Array]:
    """Return mean and covariance of the whole mixture of each agent (moment matching).

    The covariance is the weighted mean of the modes' covariances plus the spread of their means.
    One Gaussian cannot represent two separate paths, so this is for gating and coarse bounds. At
    each step, modes without a point are left out.

    Args:
        prediction: of n agents.
        time_s: [k] times after the stamp (s), see :func:`at_times`; by default the H steps.

    Returns:
        [n, k, 4] mean of x, y (m), vx, vy (m/s); [n, k, 2, 2] covariance of the position (m^2).
    """
    if time_s is not None:
        prediction = at_times(prediction, time_s)
    known = np.isfinite(prediction.mean[..., 0]) & np.isfinite(prediction.covariance[..., 0, 0])
    weight = np.where(known, prediction.weight[:, :, None], 0.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        weight = weight / weight.sum(axis=1, keepdims=True)
    each = np.where(known[..., None], prediction.mean, 0.0)
    mean = (weight[..., None] * each).sum(axis=1)
    away = each[..., :2] - mean[:, None, :, :2]
    inner = np.where(known[..., None, None], prediction.covariance, 0.0)
    spread = inner + away[..., :, None] * away[..., None, :]
    covariance = (weight[..., None, None] * spread).sum(axis=1)
    return mean, covariance


def without_missing_steps(prediction: Prediction) -> Prediction:
    """Return the prediction without the steps at which no agent has a point (time NaN)."""
    known = np.flatnonzero(np.isfinite(prediction.time_s))
    if len(known) == len(prediction.time_s):
        return prediction
    return dataclasses.replace(
        prediction,
        time_s=prediction.time_s[known],
        mean=prediction.mean[:, :, known],
        yaw=prediction.yaw[:, :, known],
        covariance=prediction.covariance[:, :, known],
        sigma_factor_50=prediction.sigma_factor_50[:, known],
    )


def first_places(prediction: Prediction) -> Float64Array:
    """Return [n, 2] positions of the agents at the stamp (m), NaN for an agent without points.

    They are extrapolated backwards by the velocity from the first point of the first mode with
    points.
    """
    n, modes, steps = prediction.yaw.shape
    if not modes * steps:
        return np.full((n, 2), np.nan)
    known = np.asarray(np.isfinite(prediction.mean[..., :2]).all(axis=-1))
    step = np.asarray(known.any(axis=1)).argmax(axis=1)
    mode = known[np.arange(n), :, step].argmax(axis=1)
    state = prediction.mean[np.arange(n), mode, step]
    back_s = np.nan_to_num(prediction.time_s[step])[:, None]
    return np.asarray(state[:, :2] - back_s * np.nan_to_num(state[:, 2:]))


def at_times(prediction: Prediction, time_s: ArrayLike) -> Prediction:
    """Return the prediction at other times, which replace its H steps.

    Between two steps everything is interpolated linearly, the yaw along the shorter arc; the
    covariances stay positive definite. Between the stamp and the first step, the first step is
    carried back by its velocity. Before the stamp and after the last step all is NaN.

    Args:
        prediction: of n agents.
        time_s: [k] times after the stamp (s), or one; a time t (ns) is ``(t - stamp_ns) * 1e-9``.
    """
    wanted = np.atleast_1d(np.asarray(time_s, dtype=np.float64))
    step = np.flatnonzero(np.isfinite(prediction.time_s))
    given = prediction.time_s[step]
    shape = (*prediction.mean.shape[:2], len(wanted))
    if not len(given):
        return _without_values(prediction, wanted, shape)
    after = np.minimum(np.searchsorted(given, wanted - _SLACK_S), len(given) - 1)
    before = np.maximum(after - 1, 0)
    exact = (np.abs(given[after] - wanted) <= _SLACK_S) | (after == 0)
    before = np.where(exact, after, before)
    gap = np.where(exact, 1.0, given[after] - given[before])
    share = np.where(exact, 0.0, (wanted - given[before]) / gap)
    outside = ~((wanted >= 0.0) & (wanted <= given[-1] + _SLACK_S))
    left, right = step[before], step[after]

    def mix(values: Float64Array, axis: int) -> Float64Array:
        a, b = np.take(values, left, axis), np.take(values, right, axis)
        part = share.reshape((-1,) + (1,) * (values.ndim - axis - 1))
        mixed = a + part * (b - a)
        return np.where(outside.reshape(part.shape), np.nan, mixed)

    mean = mix(prediction.mean, 2)
    back_s = np.minimum(wanted - given[0], 0.0)[:, None]
    mean[..., :2] += back_s * np.where(back_s < 0.0, mean[..., 2:], 0.0)
    yaw = np.take(prediction.yaw, left, 2)
    turn = wrap(np.take(prediction.yaw, right, 2) - yaw)
    yaw = np.where(outside, np.nan, wrap(yaw + share * turn))
    return dataclasses.replace(
        prediction,
        time_s=wanted,
        mean=mean,
        yaw=yaw,
        covariance=mix(prediction.covariance, 2),
        sigma_factor_50=mix(prediction.sigma_factor_50, 1),
    )


def to_frame(prediction: Prediction, pose: Pose2, frame_id: str) -> Prediction:
    """Return the prediction in another frame: positions, velocities, yaws and covariances.

    Velocities are rotated only: they stay over ground. Heights are not changed.

    Args:
        prediction: in its own frame.
        pose: of that frame in the other one, as TF's ``lookup_transform(frame_id,
            prediction.frame_id, time)`` gives it; ``pose.inverse()`` where the other is known.
        frame_id: name of the other frame.
    """
    return dataclasses.replace(
        prediction,
        frame_id=frame_id,
        initial=_moved(prediction.initial, pose),
        initial_yaw=wrap(prediction.initial_yaw + pose.yaw),
        mean=_moved(prediction.mean, pose),
        yaw=wrap(prediction.yaw + pose.yaw),
        covariance=rotate_covariance(prediction.covariance, pose.yaw),
    )


def _moved(state: Float64Array, pose: Pose2) -> Float64Array:
    """Return states [..., 4] x, y, vx, vy of the pose's frame in the other frame."""
    moved = [pose.point(state[..., :2]), rotate(state[..., 2:], pose.yaw)]
    return np.concatenate(moved, axis=-1)


def _without_values(
    prediction: Prediction, time_s: Float64Array, shape: tuple[int, ...]
) -> Prediction:
    """Return the prediction with all values unknown (NaN) at these times."""

    def unknown(*dimensions: int) -> NDArray[np.float64]:
        return np.full(dimensions, np.nan)

    return dataclasses.replace(
        prediction,
        time_s=time_s,
        mean=unknown(*shape, 4),
        yaw=unknown(*shape),
        covariance=unknown(*shape, 2, 2),
        sigma_factor_50=unknown(shape[0], shape[2]),
    )
