# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The scores of one model on one recording, kept small: a row an agent, a sum a horizon step."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mtpgo_training.evaluation import metrics
from mtpgo_training.evaluation.metrics import Array, Mask

KEYS = (
    "ade",
    "fde",
    "mr",
    "apde",
    "anll",
    "fnll",
    "min_ade",
    "min_fde",
    "coverage_50",
    "coverage_90",
    "coverage_95",
)
"""Names of the values, as in the JSON; ``n`` agents and ``n_final`` beside them."""

STEP_KEYS = (
    "displacement",
    "nll",
    "nees",
    "nees_mixture",
    "coverage_50",
    "coverage_90",
    "coverage_95",
)
"""Names of the values by horizon step."""

LEVELS = (*(round(0.05 * i, 2) for i in range(1, 20)), 0.99)
"""Nominal levels of the ellipses in the reliability diagram."""

_PERCENT = (50, 90, 95)


@dataclass(frozen=True)
class AgentScores:
    """Every metric of n agents; those of the distribution NaN where there is none.

    Attributes:
        values: by :data:`KEYS`, [n].
        steps: by :data:`STEP_KEYS`, [n, H].
        inside: [n, len(LEVELS)] share of the observed steps inside the ellipse of each level.
        mask: [n, H] observed.
    """

    values: dict[str, Array]
    steps: dict[str, Array]
    inside: Array
    mask: Mask


def score_agents(
    mean: Array, weight: Array, covariance: Array | None, truth: Array, mask: Mask
) -> AgentScores:
    """Every metric of n agents.

    Args:
        mean: [n, M, H, 2] (m).
        weight: [n, M].
        covariance: [n, M, H, 2, 2] (m^2) or None.
        truth: [n, H, 2] (m).
        mask: [n, H] observed.
    """
    n, horizon = mask.shape
    unknown, no_steps = np.full(n, np.nan), np.full((n, horizon), np.nan)
    values: dict[str, Array] = {
        "ade": metrics.ade(mean, weight, truth, mask),
        "fde": metrics.fde(mean, weight, truth, mask),
        "mr": metrics.miss_rate(mean, weight, truth, mask),
        "apde": metrics.apde(mean, weight, truth, mask),
        "min_ade": metrics.min_ade(mean, truth, mask),
        "min_fde": metrics.min_fde(mean, truth, mask),
    }
    steps: dict[str, Array] = {"displacement": metrics.displacement(mean, weight, truth)}
    if covariance is None:
        values |= {key: unknown for key in KEYS if key not in values}
        steps |= {key: no_steps for key in STEP_KEYS if key not in steps}
        return AgentScores(values, steps, np.full((n, len(LEVELS)), np.nan), mask)
    nll = metrics.nll(mean, weight, covariance, truth)
    nees = metrics.nees(mean, weight, covariance, truth)
    values["anll"] = metrics.over_steps(nll, mask)
    values["fnll"] = np.where(mask[:, -1], nll[:, -1], np.nan)
    steps |= {
        "nll": nll,
        "nees": nees,
        "nees_mixture": metrics.mixture_nees(mean, weight, covariance, truth),
    }
    for percent in _PERCENT:
        values[f"coverage_{percent}"] = metrics.share_inside(nees, mask, percent / 100.0)
        radius = metrics.radius_squared(percent / 100.0)
        steps[f"coverage_{percent}"] = (nees <= radius).astype(float)
    inside = np.stack([metrics.share_inside(nees, mask, level) for level in LEVELS], axis=-1)
    return AgentScores(values, steps, inside, mask)


@dataclass
class Page:
    """The scores of one model by one protocol on one recording.

    Attributes:
        rows: by :data:`KEYS`, lists of [n] float32.
        agent_class: lists of [n].
        manoeuvres: lists of [n], bits of :mod:`mtpgo_training.data.manoeuvres`.
        step_sums: by :data:`STEP_KEYS`, [H] sums over agents observed at the step.
        step_counts: by :data:`STEP_KEYS`, [H] over how many.
        inside: [len(LEVELS)] sums over agents. inside_count: over how many.
    """

    rows: dict[str, list[NDArray[np.float32]]] = field(
        default_factory=lambda: {key: [] for key in KEYS}
    )
    agent_class: list[NDArray[np.uint8]] = field(default_factory=list)
    manoeuvres: list[NDArray[np.uint8]] = field(default_factory=list)
    step_sums: dict[str, Array] = field(
        default_factory=lambda: {key: np.zeros(0) for key in STEP_KEYS}
    )
    step_counts: dict[str, Array] = field(
        default_factory=lambda: {key: np.zeros(0) for key in STEP_KEYS}
    )
    inside: Array = field(default_factory=lambda: np.zeros(len(LEVELS)))
    inside_count: int = 0

    def add(
        self, scores: AgentScores, agent_class: NDArray[np.uint8], manoeuvres: NDArray[np.uint8]
    ) -> None:
        """Take n agents in."""
        for key in KEYS:
            self.rows[key].append(scores.values[key].astype(np.float32))
        self.agent_class.append(agent_class.astype(np.uint8))
        self.manoeuvres.append(manoeuvres.astype(np.uint8))
        for key in STEP_KEYS:
            known = scores.mask & np.isfinite(scores.steps[key])
            self._add_steps(key, np.where(known, scores.steps[key], 0.0).sum(0), known.sum(0))
        judged = scores.inside[np.isfinite(scores.inside[:, 0])]
        self.inside = self.inside + judged.sum(axis=0)
        self.inside_count += len(judged)

    def merge(self, other: Page) -> None:
        """Take the agents of another page in."""
        for key in KEYS:
            self.rows[key] += other.rows[key]
        self.agent_class += other.agent_class
        self.manoeuvres += other.manoeuvres
        for key in STEP_KEYS:
            self._add_steps(key, other.step_sums[key], other.step_counts[key])
        self.inside = self.inside + other.inside
        self.inside_count += other.inside_count

    def _add_steps(self, key: str, sums: Array, counts: Array) -> None:
        self.step_sums[key] = _added(self.step_sums[key], sums)
        self.step_counts[key] = _added(self.step_counts[key], counts)

    def values(self, key: str) -> NDArray[np.float32]:
        """[agents] one metric of all agents so far."""
        return np.concatenate(self.rows[key]) if self.rows[key] else np.zeros(0, np.float32)

    def classes(self) -> NDArray[np.uint8]:
        """[agents] class of each."""
        return np.concatenate(self.agent_class) if self.agent_class else np.zeros(0, np.uint8)

    def labels(self) -> NDArray[np.uint8]:
        """[agents] manoeuvres of each."""
        return np.concatenate(self.manoeuvres) if self.manoeuvres else np.zeros(0, np.uint8)


def _added(a: Array, b: Array) -> Array:
    """The sum of two arrays over the horizon, of which one may be shorter."""
    if len(a) == len(b):
        return a + b
    length = max(len(a), len(b))
    return np.pad(a, (0, length - len(a))) + np.pad(b, (0, length - len(b))).astype(np.float64)
