# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Predictions in an autoware_perception_msgs/PredictedObjects.

Autoware's conventions: ``path[0]`` is the present pose, and the confidences of an object's paths
sum to one. The message has no covariance of the paths, but one of the pose and of the twist at the
stamp; docs/risk.md says what is made of these.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from msg_adapters.conversions import (
    finite,
    positive,
    rotate,
    state_covariance,
    table,
    yaw_from_quaternions,
)
from msg_adapters.inputs.autoware import object_class, object_size
from msg_adapters.predictions.prediction_cloud import LATEST_S, MAX_COUNT, SOONEST_S, check_cells
from msg_adapters.wire.predicted_objects_bytes import (
    ObjectContent,
    PathContent,
    predicted_objects_from_cdr,
)
from mtpgo_core.errors import MessageError
from mtpgo_core.frames import wrap
from mtpgo_core.identity import keys_from_uuid_bytes
from mtpgo_core.prediction.constant_velocity import assumed_covariances, covariance_along_paths
from mtpgo_core.risk.collision_risk import WEIGHT_TOLERANCE
from mtpgo_core.schema import Float64Array, Prediction, Source

_SLACK = 1e-6
"""Share of a step by which a path may be short of it: times are whole nanoseconds."""


def prediction_from_predicted_objects(data: Any, *, assume_covariance: bool = False) -> Prediction:
    """Return the predictions in a serialised PredictedObjects message.

    The confidences are the weights; those of an object that do not sum to one are no probabilities
    and are NaN, as is a path beyond its end. Where paths have different time steps, all are
    interpolated onto the smallest. The covariance along the paths grows from that of pose and
    twist at the stamp (:func:`covariance_along_paths`).

    Args:
        data: CDR bytes with their encoding header, as a subscription with ``raw=True`` or a bag
            gives them.
        assume_covariance: objects that give no covariance of position and velocity get the one
            that constant velocity starts from; otherwise theirs is NaN.

    Returns:
        :class:`~mtpgo_core.schema.Prediction` in the frame of the message, modes sorted by falling
        weight, ``source`` :attr:`~mtpgo_core.schema.Source.OTHER`. The velocity of a step is the
        mean one since the step before.

    Raises:
        MessageError: the bytes are no such message, or its paths have no time step, or one that
            no prediction has.
    """
    content = predicted_objects_from_cdr(data)
    objects = content.objects
    ordered = [sorted(item.paths, key=_falling, reverse=True) for item in objects]
    step_ns, steps = _grid(ordered)
    modes = max([1, *map(len, ordered)])
    if modes > MAX_COUNT or steps > MAX_COUNT:
        raise MessageError(
            f"PredictedObjects message has {modes} paths of an object and {steps} steps of"
            f" {step_ns * 1e-9:g} s, expected at most {MAX_COUNT} each"
        )
    if step_ns and not SOONEST_S <= steps * step_ns * 1e-9 <= LATEST_S:
        raise MessageError(
            f"PredictedObjects message has paths that end after {steps * step_ns * 1e-9:g} s,"
            f" expected {SOONEST_S:g} to {LATEST_S:g} s"
        )
    poses = sum(len(path.poses) for paths in ordered for path in paths)
    check_cells("PredictedObjects message", poses, len(objects), modes, steps)
    now = _stacked([item.pose for item in objects], 7)
    position, initial_yaw = finite(now[:, :2]), yaw_from_quaternions(now[:, 3:])
    weight = np.zeros((len(objects), modes))
    for i, paths in enumerate(ordered):
        weight[i, : len(paths)] = [path.confidence for path in paths]
    rows = _rows(ordered, modes, step_ns, steps)
    time_s = 1e-9 * step_ns * np.arange(1, steps + 1, dtype=np.float64)
    observed = _observed(objects, initial_yaw, assume_covariance)
    twist = _stacked([item.twist[:2] for item in objects], 2)
    return Prediction(
        stamp_ns=content.stamp_ns,
        frame_id=content.frame_id,
        key=keys_from_uuid_bytes(np.frombuffer(b"".join(o.uuid for o in objects), np.uint8)),
        agent_class=np.array([object_class(o.classification) for o in objects], np.uint8),
        z=finite(now[:, 2]),
        size=positive(table([object_size(item.shape) for item in objects], 2)),
        initial=np.concatenate([position, rotate(finite(twist), initial_yaw)], axis=1),
        initial_yaw=initial_yaw,
        time_s=time_s,
        weight=_probabilities(weight),
        mean=_with_velocity(rows[..., :2], 1e-9 * step_ns),
        yaw=rows[:, :, 1:, 2],
        covariance=covariance_along_paths(observed, initial_yaw, rows[:, :, 1:, 2], time_s),
        source=np.full(len(objects), Source.OTHER, dtype=np.uint8),
    )


def _stacked(rows: list[Float64Array], *shape: int) -> Float64Array:
    """Return [n, *shape] arrays on top of each other, also for n = 0."""
    return np.array(rows, dtype=np.float64).reshape(len(rows), *shape)


def _falling(path: PathContent) -> float:
    return path.confidence if np.isfinite(path.confidence) else -np.inf


def _grid(ordered: list[list[PathContent]]) -> tuple[int, int]:
    """Return the smallest time step (ns), and the steps that the longest path reaches.

    Raises:
        MessageError: a path has no time step.
    """
    paths = [path for some in ordered for path in some if len(path.poses) > 1]
    step_ns = min((path.step_ns for path in paths), default=0)
    if paths and step_ns <= 0:
        raise MessageError(
            f"PredictedObjects message has a path with the time_step {step_ns * 1e-9:g} s,"
            " expected more than 0"
        )
    # Without any path, one unknown step at the stamp stands for the future.
    return step_ns, max([1, *(_reach(path, step_ns) for path in paths)])


def _reach(path: PathContent, step_ns: int) -> int:
    """Return how many steps of a grid (ns) a path reaches."""
    return int((len(path.poses) - 1) * path.step_ns / step_ns + _SLACK)


def _rows(ordered: list[list[PathContent]], modes: int, step_ns: int, steps: int) -> Float64Array:
    """Return [n, modes, 1 + steps, 3] x, y, yaw (m, rad), the present first, NaN where unknown."""
    poses = np.full((len(ordered), modes, 1 + steps, 7), np.nan)
    others = []
    for i, paths in enumerate(ordered):
        for mode, path in enumerate(paths):
            if len(path.poses) < 2:
                continue
            if path.step_ns == step_ns:
                poses[i, mode, : len(path.poses)] = path.poses
            else:
                others.append((i, mode, path))
    rows = _planar(poses)  # of all paths at once, which is much faster
    for i, mode, path in others:
        found = _interpolated(path, step_ns)
        rows[i, mode, : len(found)] = found
    return rows


def _interpolated(path: PathContent, step_ns: int) -> Float64Array:
    """Return [1 + k, 3] x, y, yaw of a path at the steps of a grid (ns) that it reaches."""
    given = _planar(path.poses)
    wanted = np.arange(1 + _reach(path, step_ns)) * (step_ns / path.step_ns)
    before = np.minimum(wanted.astype(np.intp), len(given) - 2)
    change = given[before + 1] - given[before]
    change[:, 2] = wrap(change[:, 2])
    return np.asarray(given[before] + (wanted - before)[:, None] * change)


def _planar(poses: Float64Array) -> Float64Array:
    """Return [..., 3] x, y, yaw of [..., 7] poses."""
    yaw = yaw_from_quaternions(poses[..., 3:])
    return np.concatenate([finite(poses[..., :2]), yaw[..., None]], axis=-1)


def _probabilities(weight: Float64Array) -> Float64Array:
    """Return [n, M] weights, NaN throughout for an object whose weights are no probabilities."""
    with np.errstate(invalid="ignore"):
        usable = np.abs(weight.sum(axis=1) - 1.0) <= WEIGHT_TOLERANCE
        usable &= (weight >= 0.0).all(axis=1)
    return np.where(usable[:, None], weight, np.nan)


def _with_velocity(place: Float64Array, step_s: float) -> Float64Array:
    """Return [n, M, H, 4] x, y, vx, vy of [n, M, 1 + H, 2] places, the first at the stamp."""
    moved = np.diff(place, axis=2)
    velocity = moved / step_s if step_s else np.full_like(moved, np.nan)
    return np.concatenate([place[:, :, 1:], velocity], axis=-1)


def _observed(objects: list[ObjectContent], yaw: Float64Array, assume: bool) -> Float64Array:
    """Return [n, 4, 4] covariances of x, y, vx, vy at the stamp, NaN where there are none."""
    given = state_covariance(
        _stacked([item.pose_covariance[:2, :2] for item in objects], 2, 2),
        _stacked([item.twist_covariance[:2, :2] for item in objects], 2, 2),
        yaw,
        "object",
    )
    if not assume:
        return given
    known = np.asarray(np.isfinite(given).all(axis=(1, 2)))
    return np.where(known[:, None, None], given, assumed_covariances(len(objects)))
