# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The probability that the ego's planned footprint overlaps those of predicted road users.

An unknown value is NaN and comes with a reason, so a low probability always means a low risk.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.class_size import known_sizes
from mtpgo_core.errors import FrameError
from mtpgo_core.risk.ego_plan import EgoFootprint, EgoPlan
from mtpgo_core.risk.footprint_distance import smallest_distances, weighted_quantiles
from mtpgo_core.risk.footprint_overlap import is_covariance, overlap_probability
from mtpgo_core.schema import (
    FARTHEST_M,
    BoolArray,
    ClassArray,
    Float64Array,
    KeyArray,
    Prediction,
)

QUANTILES = (0.05, 0.5, 0.95)
"""Levels of the quantiles of the smallest distance."""

WEIGHT_TOLERANCE = 0.01
"""Mode weights that sum to one within this are complete; chosen above float32 rounding."""


_LARGEST_YAW = 1e4
"""A heading beyond this is invalid (rad); chosen: float32 no longer resolves its angle."""


class Unknown(IntEnum):
    """Why a risk is not known; part of every published point."""

    KNOWN = 0
    PARTLY = 1
    """For an agent: the risk is known at some steps only, and its values cover those."""
    NO_PLAN = 2
    """There is no usable plan: none was received, it is too old, or it is in another frame."""
    BEYOND_PLAN = 3
    """The plan does not reach this step."""
    NO_PREDICTION = 4
    """The prediction of the agent is not finite, has impossible values, or lacks modes."""
    STALE = 5
    """The prediction is too old."""


@dataclass(frozen=True)
class CollisionRisk:
    """The risk of n agents at the H steps of their predictions; NaN where it is not known.

    Attributes:
        stamp_ns: time of the observation that the prediction started from (ns).
        frame_id: the frame of the positions.
        time_s: [H] seconds after ``stamp_ns``.
        key: [n, 4], agent_class: [n], source: [n], z: [n] (m) as in :class:`Prediction`.
        position: [n, H, 2] mean of the most probable mode (m).
        yaw: [n, H] heading of that mode (rad).
        size: [n, 2] length, width that were used (m).
        probability: [n, H] that the footprints overlap at that step.
        unknown: [n, H] :class:`Unknown` values.
        peak: [n] the largest probability over the known steps.
        peak_time_s: [n] when that is (s after ``stamp_ns``).
        peak_step: [n] its index, 0 where nothing is known.
        at_least: [n] lower bound of the probability that the footprints overlap at any known
            step: the largest probability of each mode, weighted. It would be exact if errors did
            not change over time.
        distance_m: [n, len(QUANTILES)] quantiles of the smallest distance between the footprints
            over the known steps.
        known_steps: [n] number of steps at which the probability is known.
        agent_unknown: [n] :class:`Unknown` values of the agents.
    """

    stamp_ns: int
    frame_id: str
    time_s: Float64Array
    key: KeyArray
    agent_class: ClassArray
    source: NDArray[np.uint8]
    z: Float64Array
    position: Float64Array
    yaw: Float64Array
    size: Float64Array
    probability: Float64Array
    unknown: NDArray[np.uint8]
    peak: Float64Array
    peak_time_s: Float64Array
    peak_step: NDArray[np.intp]
    at_least: Float64Array
    distance_m: Float64Array
    known_steps: NDArray[np.intp]
    agent_unknown: NDArray[np.uint8]

    def __len__(self) -> int:
        return self.key.shape[0]


def assess(
    prediction: Prediction,
    plan: EgoPlan | None,
    footprint: EgoFootprint,
    *,
    reason: Unknown = Unknown.NO_PLAN,
) -> CollisionRisk:
    """Return the risk of every agent of a prediction.

    Args:
        prediction: without the ego itself.
        plan: where the ego will be; None makes every risk unknown.
        footprint: its box.
        reason: why there is no plan, where ``plan`` is None.

    Raises:
        FrameError: plan and prediction are in different frames.
    """
    n, modes, steps = prediction.yaw.shape
    size = known_sizes(prediction.size, prediction.agent_class)
    if plan is None:
        overlap = _unknown_overlap(n, steps, reason)
    else:
        overlap = _overlap_with_plan(prediction, plan, footprint, size)
    known = overlap.unknown == Unknown.KNOWN
    known_steps = known.sum(axis=1)
    nothing_known = known_steps == 0
    filled = np.where(known, overlap.probability, -1.0)  # below every probability
    peak_step = filled.argmax(axis=1) if steps else np.zeros(n, dtype=np.intp)
    peak_time_s = prediction.time_s[peak_step] if steps else np.full(n, np.nan)
    return CollisionRisk(
        stamp_ns=prediction.stamp_ns,
        frame_id=prediction.frame_id,
        time_s=prediction.time_s,
        key=prediction.key,
        agent_class=prediction.agent_class,
        source=prediction.source,
        z=prediction.z,
        position=_places(prediction) if modes else np.full((n, steps, 2), np.nan),
        yaw=prediction.yaw[:, 0] if modes else np.full((n, steps), np.nan),
        size=size,
        probability=overlap.probability,
        unknown=overlap.unknown,
        peak=np.where(nothing_known, np.nan, filled.max(axis=1, initial=-1.0)),
        peak_time_s=np.where(nothing_known, np.nan, peak_time_s),
        peak_step=np.where(nothing_known, 0, peak_step),
        at_least=overlap.at_least,
        distance_m=overlap.distance_m,
        known_steps=known_steps,
        agent_unknown=_agent_unknown(overlap.unknown, known_steps),
    )


@dataclass(frozen=True)
class _Overlap:
    """The fields of :class:`CollisionRisk` that are computed from the plan."""

    probability: Float64Array
    unknown: NDArray[np.uint8]
    at_least: Float64Array
    distance_m: Float64Array


def _unknown_overlap(n: int, steps: int, reason: Unknown) -> _Overlap:
    """Return the fields of n agents where no step is known."""
    return _Overlap(
        probability=np.full((n, steps), np.nan),
        unknown=np.full((n, steps), reason, dtype=np.uint8),
        at_least=np.full(n, np.nan),
        distance_m=np.full((n, len(QUANTILES)), np.nan),
    )


def _overlap_with_plan(
    prediction: Prediction, plan: EgoPlan, footprint: EgoFootprint, size: Float64Array
) -> _Overlap:
    """Return how likely the footprints of agents of ``size`` [n, 2] (m) overlap the ego's.

    Raises:
        FrameError: plan and prediction are in different frames.
    """
    if plan.frame_id != prediction.frame_id:
        raise FrameError(
            f"the {plan.source} is in the frame {plan.frame_id!r} and the predictions in "
            f"{prediction.frame_id!r}, expected the same"
        )
    point, ego_yaw = plan.at(prediction.stamp_ns, prediction.time_s)
    center = footprint.center(point, ego_yaw)
    usable, complete = _usable(prediction)
    in_plan = np.isfinite(ego_yaw)
    unknown = np.where(in_plan, Unknown.KNOWN, Unknown.BEYOND_PLAN).astype(np.uint8)
    unknown = np.where(complete, unknown[None], Unknown.NO_PREDICTION).astype(np.uint8)
    known = unknown == Unknown.KNOWN

    by_mode = _by_mode(prediction, usable & in_plan, center, ego_yaw, footprint.size, size)
    weight = np.where(np.isfinite(prediction.weight), prediction.weight, 0.0)
    weight = weight / np.maximum(weight.sum(axis=1, keepdims=True), 1e-12)
    mixed = np.einsum("nm,nmh->nh", weight, by_mode)
    largest = np.where(known[:, None], by_mode, 0.0).max(axis=2, initial=0.0)  # [n, M]
    any_known = known.any(axis=1)
    distance_m = np.full((len(prediction), len(QUANTILES)), np.nan)
    if any_known.any():
        agents = np.flatnonzero(any_known)
        distance_m[agents] = _distances(
            prediction, agents, known, weight, center, ego_yaw, footprint.size, size
        )
    return _Overlap(
        probability=np.where(known, np.clip(mixed, 0.0, 1.0), np.nan),
        unknown=unknown,
        at_least=np.where(any_known, np.minimum((weight * largest).sum(axis=1), 1.0), np.nan),
        distance_m=distance_m,
    )


def _agent_unknown(unknown: NDArray[np.uint8], known_steps: NDArray[np.intp]) -> NDArray[np.uint8]:
    """Return [n] ``agent_unknown`` of ``unknown`` [n, H] and the number of known steps [n]."""
    steps = unknown.shape[1]
    some = np.where(known_steps < steps, Unknown.PARTLY, Unknown.KNOWN)
    return np.where(known_steps == 0, unknown.max(axis=1, initial=0), some).astype(np.uint8)


def _places(prediction: Prediction) -> Float64Array:
    """Return [n, H, 2] the most probable mode's positions (m), NaN where impossible."""
    mean = prediction.mean[:, 0, :, :2]
    return np.where(np.abs(mean) <= FARTHEST_M, mean, np.nan)


def known_poses(prediction: Prediction) -> BoolArray:
    """Return [n, M, H] whether position, heading and covariance are finite and plausible."""
    with np.errstate(invalid="ignore"):
        place = np.maximum(np.abs(prediction.mean[..., 0]), np.abs(prediction.mean[..., 1]))
        known = (place <= FARTHEST_M) & (np.abs(prediction.yaw) <= _LARGEST_YAW)
    return np.asarray(known & is_covariance(prediction.covariance))


def _usable(prediction: Prediction) -> tuple[BoolArray, BoolArray]:
    """Return which modes are used at which steps, and which agents are known at which steps.

    Returns:
        [n, M, H] the mode has weight and is finite; [n, H] all modes with weight are finite, and
        the weights sum to one.
    """
    has_weight = np.isfinite(prediction.weight) & (prediction.weight > 0.0)
    finite = known_poses(prediction)
    with np.errstate(invalid="ignore"):
        sums_to_one = np.abs(prediction.weight.sum(axis=1) - 1.0) <= WEIGHT_TOLERANCE
    complete = (finite | ~has_weight[:, :, None]).all(axis=1) & sums_to_one[:, None]
    return finite & has_weight[:, :, None], complete


def _by_mode(
    prediction: Prediction,
    usable: BoolArray,
    center: Float64Array,
    ego_yaw: Float64Array,
    ego_size: Float64Array,
    size: Float64Array,
) -> Float64Array:
    """Return [n, M, H] the probability of an overlap in each mode, 0 where not usable."""
    out = np.zeros(usable.shape)
    agent, mode, step = np.nonzero(usable)
    out[agent, mode, step] = overlap_probability(
        prediction.mean[agent, mode, step, :2] - center[step],
        prediction.covariance[agent, mode, step],
        ego_yaw[step],
        prediction.yaw[agent, mode, step],
        np.broadcast_to(ego_size, (len(agent), 2)),
        size[agent],
    )
    return out


def _distances(
    prediction: Prediction,
    agents: NDArray[np.intp],
    known: BoolArray,
    weight: Float64Array,
    center: Float64Array,
    ego_yaw: Float64Array,
    ego_size: Float64Array,
    size: Float64Array,
) -> Float64Array:
    """Return [k, len(QUANTILES)] quantiles of the smallest distance of some agents (m)."""
    modes, steps = prediction.yaw.shape[1:]
    offset = prediction.mean[agents][..., :2] - center
    offset = np.where(known[agents][:, None, :, None], offset, np.nan)
    smallest = smallest_distances(
        offset.reshape(-1, steps, 2),
        prediction.covariance[agents].reshape(-1, steps, 2, 2),
        ego_yaw,
        prediction.yaw[agents].reshape(-1, steps),
        ego_size,
        np.repeat(size[agents], modes, axis=0),
    )
    errors = smallest.shape[1]
    share = np.repeat(weight[agents] / errors, errors, axis=1)
    return weighted_quantiles(smallest.reshape(len(agents), -1), share, QUANTILES)
