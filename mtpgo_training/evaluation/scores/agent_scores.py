# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""All metrics of n predicted agents, and who these agents are: one batch of rows of the table."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.quality import metrics
from mtpgo_core.quality.metrics import Array, Mask
from mtpgo_core.schema import BoolArray, ClassArray
from mtpgo_training.data.manoeuvres import LabelArray
from mtpgo_training.evaluation.scores.kernel_density import kernel_nll

KEYS = (
    "ade",
    "fde",
    "mr",
    "apde",
    "anll",
    "fnll",
    "anll_kde",
    "fnll_kde",
    "min_ade",
    "min_fde",
    "coverage_50",
    "coverage_90",
    "coverage_95",
)
"""Names of the values of an agent, as in the JSON."""

STEP_KEYS = (
    "displacement",
    "nll",
    "nees",
    "nees_mixture",
    "coverage_50",
    "coverage_90",
    "coverage_95",
)
"""Names of the values of an agent at a horizon step, as in the JSON."""

LEVELS = (*(round(0.05 * i, 2) for i in range(1, 20)), 0.99)
"""Nominal levels of the ellipses in the reliability diagram; chosen."""

_PERCENT = (50, 90, 95)


@dataclass(frozen=True)
class ScoredAgents:
    """Who n scored agents are: the columns by which results are broken down.

    Attributes:
        recording: name of the recording.
        site: its location, as the data set names it, after its folder where there are several.
        stamp_ns: time of the prediction (ns).
        step_s: time between two horizon steps (s).
        track: [n] index in the recording.
        agent_class: [n] :class:`~mtpgo_core.schema.AgentClass` values.
        manoeuvres: [n] bits, see :func:`mtpgo_training.data.manoeuvres.label`.
        speed_mps: [n] at the time of the prediction (m/s), NaN where it is not known.
        since_start_s: time from the recording's first road user to the prediction (s): what a
            model can have seen of the site. NaN where it is not known.
    """

    recording: str
    site: str
    stamp_ns: int
    step_s: float
    track: NDArray[np.int64]
    agent_class: ClassArray
    manoeuvres: LabelArray
    speed_mps: Array
    since_start_s: float = np.nan

    @classmethod
    def unknown(cls, n: int) -> ScoredAgents:
        """Return n agents of which only the scores are known."""
        none = np.zeros(n, dtype=np.uint8)
        return cls("", "", 0, np.nan, np.full(n, -1), none, none, np.full(n, np.nan))

    def select(self, rows: BoolArray) -> ScoredAgents:
        """Return some of the agents."""
        return dataclasses.replace(
            self,
            track=self.track[rows],
            agent_class=self.agent_class[rows],
            manoeuvres=self.manoeuvres[rows],
            speed_mps=self.speed_mps[rows],
        )


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
    mean: Array,
    weight: Array,
    covariance: Array | None,
    truth: Array,
    mask: Mask,
    sigma_factor_50: Array | float = 1.0,
    kde_samples: int = 0,
) -> AgentScores:
    """Compute every metric of n agents.

    Args:
        mean: [n, M, H, 2] (m).
        weight: [n, M].
        covariance: [n, M, H, 2, 2] (m^2), NaN where it is not known, or None.
        truth: [n, H, 2] (m).
        mask: [n, H] observed.
        sigma_factor_50: [n, H] of the 50 % ellipses, see :class:`~mtpgo_core.schema.Prediction`.
        kde_samples: samples of each agent for the likelihood by a kernel density estimate, which
            is NaN with 0.
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
    values["anll_kde"] = values["fnll_kde"] = unknown
    if kde_samples:
        values["anll_kde"], values["fnll_kde"] = kernel_nll(
            mean, weight, covariance, truth, mask, kde_samples
        )
    steps |= {
        "nll": nll,
        "nees": nees,
        "nees_mixture": metrics.mixture_nees(mean, weight, covariance, truth),
    }
    drawn = ~np.isnan(nees)  # where there is an ellipse
    for percent in _PERCENT:
        inside_at = metrics.is_inside(nees, percent / 100.0, sigma_factor_50).astype(float)
        values[f"coverage_{percent}"] = metrics.over_steps(inside_at, mask & drawn)
        steps[f"coverage_{percent}"] = np.where(drawn, inside_at, np.nan)
    shares = [metrics.share_inside(nees, mask & drawn, level, sigma_factor_50) for level in LEVELS]
    inside = np.stack(shares, axis=-1)
    return AgentScores(values, steps, inside, mask)


def score_paths(
    path: Array, truth: Array, mask: Mask, covariance: Array | None = None
) -> AgentScores:
    """Compute every metric of n agents with one path each.

    Args:
        path: [n, H, 2] (m).
        truth: [n, H, 2] (m).
        mask: [n, H] observed.
        covariance: [n, H, 2, 2] (m^2) or None.
    """
    spread = None if covariance is None else covariance[:, None]
    return score_agents(path[:, None], np.ones((len(path), 1)), spread, truth, mask)
