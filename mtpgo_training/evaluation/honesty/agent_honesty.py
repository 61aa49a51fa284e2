# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""All values of honesty and plausibility of n predicted agents of one recording.

Every value is a number for each agent, so that an average over any agents is an average of these;
what is not a mean of agents (RMSE, sigma, calibration error) follows from averages of its parts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.class_size import known_sizes
from mtpgo_core.quality import metrics
from mtpgo_core.quality.metrics import TIMES_S, Array, Mask
from mtpgo_core.schema import MOVING_MPS, BoolArray, IndexArray
from mtpgo_training.data.manoeuvres import is_vehicle, members
from mtpgo_training.evaluation.honesty import (
    box_overlap,
    consistency,
    feasibility,
    mode_diversity,
    mode_weights,
)
from mtpgo_training.evaluation.honesty.mixture_region import region_level
from mtpgo_training.evaluation.scores.agent_scores import ScoredAgents

PERCENTS = (50, 90, 95)
"""Levels of ellipses and regions (%)."""

SPREAD_TIMES_S = (1, 2, 3, 4, 5)
"""Times ahead at which spread and error are given (s)."""

Values = dict[str, Array]


@dataclass(frozen=True)
class PredictedPaths:
    """What was predicted for n agents of one recording, and what they did.

    Attributes:
        stamp_ns: [n] time of the prediction (ns), ascending.
        track: [n] index in the recording.
        agent_class: [n] classes. manoeuvres: [n] bits. speed_mps: [n] then (m/s).
        since_start_s: [n] time since the recording's first road user (s).
        size: [n, 2] length, width (m), NaN where unknown.
        start: [n, 4] position and velocity then (m, m/s). yaw: [n] heading then (rad). NaN where
            they are not known.
        mean: [n, M, H, 2] (m).
        weight: [n, M].
        covariance: [n, M, H, 2, 2] (m^2), NaN where the prediction has none.
        sigma_factor_50: [n, H] of the 50 % ellipses.
        by_model: [n] the modes are a model's own: their weights mean something.
        truth: [n, H, 2] (m).
        mask: [n, H] observed.
    """

    stamp_ns: NDArray[np.int64]
    track: NDArray[np.int64]
    agent_class: NDArray[np.uint8]
    manoeuvres: NDArray[np.uint8]
    speed_mps: Array
    since_start_s: Array
    size: Array
    start: Array
    yaw: Array
    mean: Array
    weight: Array
    covariance: Array
    sigma_factor_50: Array
    by_model: BoolArray
    truth: Array
    mask: Mask

    def __len__(self) -> int:
        return len(self.track)

    def select(self, rows: IndexArray | BoolArray | slice) -> PredictedPaths:
        """Return some of the agents."""
        return replace(self, **{f.name: getattr(self, f.name)[rows] for f in fields(self)})

    @classmethod
    def joined(cls, parts: Sequence[PredictedPaths]) -> PredictedPaths:
        """Return the agents of several instants, given in the order of time.

        Those with fewer modes than others get modes of the weight 0.
        """
        modes = max(part.weight.shape[1] for part in parts)
        parts = [part._with_modes(modes) for part in parts]
        return cls(
            **{f.name: np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(cls)}
        )

    def _with_modes(self, modes: int) -> PredictedPaths:
        """Return the agents with so many modes; those that they lack have the weight 0."""
        lacking = modes - self.weight.shape[1]
        if not lacking:
            return self
        none = [(0, 0), (0, lacking)]
        return replace(
            self,
            mean=np.pad(self.mean, [*none, (0, 0), (0, 0)]),
            weight=np.pad(self.weight, none),
            covariance=np.pad(
                self.covariance, [*none, (0, 0), (0, 0), (0, 0)], constant_values=np.nan
            ),
        )

    @classmethod
    def of(
        cls,
        agents: ScoredAgents,
        *,
        size: Array,
        start: Array,
        yaw: Array,
        mean: Array,
        weight: Array,
        covariance: Array | None,
        by_model: BoolArray,
        truth: Array,
        mask: Mask,
        sigma_factor_50: Array | None = None,
    ) -> PredictedPaths:
        """Return the scored agents of one instant; see the attributes."""
        if covariance is None:
            covariance = np.full((*mean.shape, 2), np.nan)
        if sigma_factor_50 is None:
            sigma_factor_50 = np.ones(mask.shape)
        return cls(
            stamp_ns=np.full(len(agents.track), agents.stamp_ns, dtype=np.int64),
            track=agents.track,
            agent_class=agents.agent_class,
            manoeuvres=agents.manoeuvres,
            speed_mps=agents.speed_mps,
            since_start_s=np.full(len(agents.track), agents.since_start_s),
            size=size,
            start=start,
            yaw=yaw,
            mean=mean,
            weight=weight,
            covariance=covariance,
            sigma_factor_50=sigma_factor_50,
            by_model=by_model,
            truth=truth,
            mask=mask,
        )


def agent_honesty(
    given: PredictedPaths, dt_s: float, past: PredictedPaths | None = None
) -> Values:
    """Compute all values, [n] each, NaN where one is not defined.

    ``ellipse_P_Ts``, ``region_P_Ts``: the truth at T s is in the heaviest mode's ellipse, in the
    mixture's highest-density region of P %. ``nll_Ts`` (nats). ``variance_Ts``,
    ``squared_error_Ts``: trace of the heaviest mode's covariance, squared distance (m^2).
    ``brier``, ``heaviest_nearest``, ``chance``, ``brier_min_fde``, ``brier_min_ade`` (m) and,
    for each bin b of weights, ``bin_count_b``, ``bin_weight_b``, ``bin_nearest_b``.
    ``mode_distance`` (m), ``weight_near_heaviest``. ``reverses``, ``lateral_4``, ``lateral_8``
    and, of the truth, ``truth_lateral_4``, ``truth_lateral_8``: moving vehicles. ``creep`` (m),
    ``creeps``: those that stand and stay. ``overlaps``. ``agents``: 1 for each.
    ``cycle_s`` (s), ``jump``, ``mixture_jump`` (m): see :mod:`.consistency`.

    Args:
        given: predictions, those of an instant complete.
        dt_s: time between two horizon steps (s).
        past: earlier predictions, which ``given`` is compared with as with its own.
    """
    row = np.arange(len(given))
    best = given.weight.argmax(axis=1)
    path, spread = given.mean[row, best], given.covariance[row, best]
    return (
        _coverage(given, path, spread, dt_s)
        | _weights(given)
        | _feasibility(given, path, dt_s)
        | _consistency(given, dt_s, past)
    )


def _coverage(given: PredictedPaths, path: Array, spread: Array, dt_s: float) -> Values:
    values: Values = {}
    unknown = np.full(len(given), np.nan)
    has = np.isfinite(spread[:, 0, 0, 0])
    for time_s in SPREAD_TIMES_S:
        k = metrics.step_at(time_s, given.mask.shape[1], dt_s)
        if k is None:
            values |= {f"variance_{time_s}s": unknown, f"squared_error_{time_s}s": unknown}
            continue
        seen = given.mask[:, k]
        error = ((path[:, k] - given.truth[:, k]) ** 2).sum(axis=-1)
        values[f"squared_error_{time_s}s"] = np.where(seen, error, np.nan)
        trace = spread[:, k, 0, 0] + spread[:, k, 1, 1]
        values[f"variance_{time_s}s"] = np.where(seen, trace, np.nan)
    for time_s in TIMES_S:
        k = metrics.step_at(time_s, given.mask.shape[1], dt_s)
        level, ellipse, nll = unknown.copy(), unknown.copy(), unknown.copy()
        rows = has & given.mask[:, k] if k is not None else np.zeros(len(given), dtype=bool)
        if rows.any():
            mean, covariance = given.mean[rows][:, :, k], given.covariance[rows][:, :, k]
            truth, weight = given.truth[rows][:, k], given.weight[rows]
            level[rows] = region_level(mean, weight, covariance, truth)
            squared, _ = metrics.mahalanobis(truth - path[rows][:, k], spread[rows][:, k])
            ellipse[rows] = squared
            step = (slice(None), slice(None), None)
            nll[rows] = metrics.nll(mean[step], weight, covariance[step], truth[:, None])[:, 0]
        values[f"nll_{time_s}s"] = nll
        for percent in PERCENTS:
            share = percent / 100.0
            factor = 1.0 if k is None else given.sigma_factor_50[:, k]
            inside = np.where(rows, metrics.is_inside(ellipse, share, factor), np.nan)
            values[f"ellipse_{percent}_{time_s}s"] = inside
            values[f"region_{percent}_{time_s}s"] = np.where(rows, level <= share, np.nan)
    return values


def _weights(given: PredictedPaths) -> Values:
    """Values of the weights and of the modes' diversity, of several modes of a model only."""
    n, modes = given.weight.shape
    names = ["brier", "heaviest_nearest", "chance", "brier_min_fde", "brier_min_ade"]
    names += ["mode_distance", "weight_near_heaviest"]
    kinds = ("count", "weight", "nearest")
    values = {name: np.full(n, np.nan) for name in names}
    values |= {f"bin_{k}_{b}": np.full(n, np.nan) for k in kinds for b in range(mode_weights.BINS)}
    rows = given.by_model
    if modes < 2 or not rows.any():
        return values
    mean, weight = given.mean[rows], given.weight[rows]
    truth, mask = given.truth[rows], given.mask[rows]
    end = mode_weights.final_distance(mean, truth, mask)
    event = mode_weights.nearest(end)
    known = np.isfinite(event).all(axis=1)
    found = {
        "brier": mode_weights.brier_score(weight, event),
        "heaviest_nearest": mode_weights.heaviest_is_nearest(weight, event),
        "chance": np.where(known, 1.0 / modes, np.nan),
        "brier_min_fde": mode_weights.brier_min(weight, end, end),
        "brier_min_ade": mode_weights.brier_min(
            weight, end, mode_weights.average_distance(mean, truth, mask)
        ),
        "mode_distance": mode_diversity.mode_distance(mean[:, :, -1], weight),
        "weight_near_heaviest": mode_diversity.weight_near_heaviest(mean[:, :, -1], weight),
    }
    for kind, bins in zip(kinds, mode_weights.weight_bins(weight, event), strict=True):
        found |= {f"bin_{kind}_{b}": bins[:, b] for b in range(mode_weights.BINS)}
    for name, value in found.items():
        values[name][rows] = value
    return values


def _feasibility(given: PredictedPaths, path: Array, dt_s: float) -> Values:
    moving = np.nan_to_num(given.speed_mps) > MOVING_MPS
    drives = moving & is_vehicle(given.agent_class)
    begins = np.isfinite(given.start).all(axis=1) & np.isfinite(given.yaw)  # known where
    reverses = feasibility.reverses(path, given.start, dt_s)
    seen = given.mask[:, :-2] & given.mask[:, 1:-1] & given.mask[:, 2:]
    lateral = {
        "lateral": (feasibility.lateral_acceleration(path, dt_s), np.ones_like(seen)),
        "truth_lateral": (feasibility.lateral_acceleration(given.truth, dt_s), seen),
    }
    stays = ~moving & members(given.manoeuvres, "standing") & begins
    creep = feasibility.final_displacement(path, given.start)
    size = known_sizes(given.size, given.agent_class)
    overlaps = box_overlap.new_overlaps(
        path,
        given.truth,
        given.mask,
        given.start[:, :2],
        given.yaw,
        size,
        box_overlap.pairs_within(given.stamp_ns),
    )
    values = {
        "agents": np.ones(len(given)),
        "reverses": np.where(drives & begins, reverses, np.nan),
        "creep": np.where(stays, creep, np.nan),
        "creeps": np.where(stays, creep > feasibility.CREEP_M, np.nan),
        "overlaps": np.where(begins, overlaps, np.nan),
    }
    for name, (acceleration, known) in lateral.items():
        for limit in feasibility.LATERAL_MPS2:
            share = metrics.over_steps((acceleration > limit).astype(np.float64), known)
            values[f"{name}_{limit:g}"] = np.where(drives, share, np.nan)
    return values


def _consistency(given: PredictedPaths, dt_s: float, past: PredictedPaths | None) -> Values:
    whole = given if past is None else PredictedPaths.joined([past, given])
    row, steps = consistency.earlier_rows(whole.track, whole.stamp_ns, whole.mask.shape[1], dt_s)
    heaviest = metrics.top_mode(whole.mean, whole.weight)
    middle = (whole.weight[:, :, None, None] * whole.mean).sum(axis=1)
    values = {
        "cycle_s": np.where(row >= 0, steps * dt_s, np.nan),
        "jump": consistency.jumps(heaviest, row, steps),
        "mixture_jump": consistency.jumps(middle, row, steps),
    }
    return {name: value[len(whole) - len(given) :] for name, value in values.items()}
