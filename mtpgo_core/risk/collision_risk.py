# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""How likely predicted road users are to be where the ego will be.

What is not known is NaN, with the reason beside it: a low probability always means a low risk.
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
"""A heading beyond is none (rad); chosen: it has lost its digits in float32."""


class Unknown(IntEnum):
    """Why a risk is not known; part of every published point."""

    KNOWN = 0
    PARTLY = 1
    """Of an agent: known at some steps; its values are over those."""
    NO_PLAN = 2
    """There is no plan that can be used: none, too old, or in another frame."""
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
        at_least: [n] that the footprints overlap at any known step, at least: each mode counts
            with its largest probability. It would be exact if errors did not change over time.
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
        reason: why, if there is no plan.

    Raises:
        FrameError: plan and prediction are in different frames.
    """
    n, modes, steps = prediction.yaw.shape
    size = known_sizes(prediction.size, prediction.agent_class)
    unknown = np.full((n, steps), reason, dtype=np.uint8)
    probability = np.full((n, steps), np.nan)
    at_least = np.full(n, np.nan)
    distance = np.full((n, len(QUANTILES)), np.nan)
    if plan is not None:
        if plan.frame_id != prediction.frame_id:
            raise FrameError(
                f"the {plan.source} is in the frame {plan.frame_id!r} and the predictions in "
                f"{prediction.frame_id!r}, expected the same"
            )
        point, ego_yaw = plan.at(prediction.stamp_ns, prediction.time_s)
        center = footprint.center(point, ego_yaw)
        usable, complete = _usable(prediction)
        covered = np.isfinite(ego_yaw)
        unknown = np.where(covered, Unknown.KNOWN, Unknown.BEYOND_PLAN).astype(np.uint8)
        unknown = np.where(complete, unknown[None], Unknown.NO_PREDICTION).astype(np.uint8)
        by_mode = _by_mode(prediction, usable & covered, center, ego_yaw, footprint.size, size)
        known = unknown == Unknown.KNOWN
        weight = np.where(np.isfinite(prediction.weight), prediction.weight, 0.0)
        weight = weight / np.maximum(weight.sum(axis=1, keepdims=True), 1e-12)
        mixed = np.einsum("nm,nmh->nh", weight, by_mode)
        probability = np.where(known, np.clip(mixed, 0.0, 1.0), np.nan)
        some = known.any(axis=1)
        best = np.where(known[:, None], by_mode, 0.0).max(axis=2, initial=0.0)
        at_least = np.where(some, np.minimum((weight * best).sum(axis=1), 1.0), np.nan)
        if some.any():
            rows = np.flatnonzero(some)
            distance[some] = _distances(
                prediction, rows, known, weight, center, ego_yaw, footprint.size, size
            )
    known = unknown == Unknown.KNOWN
    known_steps = known.sum(axis=1)
    filled = np.where(known, probability, -1.0)
    peak_step = filled.argmax(axis=1) if steps else np.zeros(n, dtype=np.intp)
    none = known_steps == 0
    peak = np.where(none, np.nan, filled.max(axis=1, initial=-1.0))
    time_s = prediction.time_s[peak_step] if steps else np.full(n, np.nan)
    worst = unknown.max(axis=1, initial=0)
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
        probability=probability,
        unknown=unknown,
        peak=peak,
        peak_time_s=np.where(none, np.nan, time_s),
        peak_step=np.where(none, 0, peak_step),
        at_least=at_least,
        distance_m=distance,
        known_steps=known_steps,
        agent_unknown=np.where(
            none, worst, np.where(known_steps < steps, Unknown.PARTLY, Unknown.KNOWN)
        ).astype(np.uint8),
    )


def _places(prediction: Prediction) -> Float64Array:
    """Return [n, H, 2] the most probable mode's positions (m), NaN where impossible."""
    mean = prediction.mean[:, 0, :, :2]
    return np.where(np.abs(mean) <= FARTHEST_M, mean, np.nan)


def known_poses(prediction: Prediction) -> BoolArray:
    """Return [n, M, H] where position, heading and covariance are finite and possible."""
    with np.errstate(invalid="ignore"):
        place = np.maximum(np.abs(prediction.mean[..., 0]), np.abs(prediction.mean[..., 1]))
        known = (place <= FARTHEST_M) & (np.abs(prediction.yaw) <= _LARGEST_YAW)
    return np.asarray(known & is_covariance(prediction.covariance))


def _usable(prediction: Prediction) -> tuple[BoolArray, BoolArray]:
    """Return which modes count at which steps, and which agents are known at which steps.

    Returns:
        [n, M, H] modes with weight that are finite; [n, H] no mode with weight is missing, and
        the weights sum to one.
    """
    weighty = np.isfinite(prediction.weight) & (prediction.weight > 0.0)
    finite = known_poses(prediction)
    with np.errstate(invalid="ignore"):
        whole = np.abs(prediction.weight.sum(axis=1) - 1.0) <= WEIGHT_TOLERANCE
    complete = (finite | ~weighty[:, :, None]).all(axis=1) & whole[:, None]
    return finite & weighty[:, :, None], complete


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
