# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The scores of the last minutes, and what they say about how far to trust the predictions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.options import check_options, option
from mtpgo_core.quality.metrics import TIMES_S
from mtpgo_core.schema import Float64Array
from mtpgo_core.task.calibration import GROUPS

WINDOWS_S = (60, 300, 1800)
"""Lengths of the windows (s)."""

SCORES = ("ade", "fde", "miss_rate", "nll", "coverage_50", "coverage_90", "cv_ade")
"""Names of the scores, in the order of the last axis of :class:`QualityReport`."""

_ADE, _COVERAGE, _CV_ADE = (SCORES.index(name) for name in ("ade", "coverage_90", "cv_ade"))

_HARMLESS_M = 0.1
"""A difference of two ADE below this is none (m); chosen: the noise of a good tracker, which makes
up the whole error of standing road users."""

_NOTICEABLE = 0.02
"""Share by which an ADE is worse than constant velocity's before it counts; chosen: less is no
difference that a user would notice, as in the evaluation."""


class Level(IntEnum):
    """How far to trust the predictions; the values are those of ``DiagnosticStatus``."""

    OK = 0
    WARN = 1
    ERROR = 2


@dataclass(frozen=True)
class QualityLimits:
    """From when on the scores are bad.

    Attributes:
        min_agents: fewest road users of a group whose scores are given and judged.
        warn_coverage: WARN below this share of truths inside the 90 % ellipses.
        error_coverage: ERROR below it.
        error_cv_ratio: ERROR where the ADE is this many times that of constant velocity; WARN
            where it is worse at all.
    """

    min_agents: int = option(10, low=1)
    warn_coverage: float = option(0.8, low=0.0, high=1.0)
    error_coverage: float = option(0.5, low=0.0, high=1.0)
    error_cv_ratio: float = option(1.2, low=1.0, high=100.0)

    def __post_init__(self) -> None:
        check_options(self, "quality.")


@dataclass(frozen=True)
class QualityReport:
    """Scores by window, calibrated group and time ahead: axes W, G, T.

    Attributes:
        now_ns: time of the newest observation (ns).
        scores: [W, G, T, scores] averages of :data:`SCORES` (m, shares, nats), NaN where nothing
            was scored. Only those of enough agents mean something, see :meth:`trusted`.
        agents: [W, G, T] different road users.
        predictions: [W, G, T] predictions of them whose time ahead was observed.
        by_model: [W, G, T] of these, made by the model.
        unknown: number of steps without a truth by cause, since the start.
    """

    now_ns: int
    scores: Float64Array
    agents: NDArray[np.int64]
    predictions: NDArray[np.int64]
    by_model: NDArray[np.int64]
    unknown: Mapping[str, int]

    def trusted(self, limits: QualityLimits) -> Float64Array:
        """Return the scores, NaN where there are too few agents."""
        return np.where((self.agents >= limits.min_agents)[..., None], self.scores, np.nan)


@dataclass(frozen=True)
class QualityVerdict:
    """The summary of a report.

    Attributes:
        level: the worst of all groups.
        message: what is bad, or that nothing is.
    """

    level: Level
    message: str


def judge(report: QualityReport, limits: QualityLimits, window_s: int) -> QualityVerdict:
    """Return the verdict on the scores of one window.

    Args:
        report: scores.
        limits: from when on they are bad.
        window_s: one of :data:`WINDOWS_S`.
    """
    w = WINDOWS_S.index(window_s)
    scores = report.trusted(limits)[w]
    enough = report.agents[w] >= limits.min_agents
    if not enough.any():
        least = f"{limits.min_agents} are needed"
        return QualityVerdict(
            Level.OK,
            f"too few road users to judge: {int(report.agents[w].max(initial=0))} of a group in "
            f"the last {window_s // 60} min, {least}",
        )
    found: list[tuple[Level, str]] = []
    for g, t in np.argwhere(enough).tolist():
        where = f"{GROUPS[g].replace('_', ' ')} at {TIMES_S[t]} s"
        ade, cv, coverage = (scores[g, t, i] for i in (_ADE, _CV_ADE, _COVERAGE))
        if ade > max(cv + _HARMLESS_M, (1.0 + _NOTICEABLE) * cv):
            level = Level.ERROR if ade > limits.error_cv_ratio * cv else Level.WARN
            text = f"{where}: ADE {ade:.2f} m, constant velocity has {cv:.2f} m"
            found.append((level, text))
        if coverage < limits.warn_coverage:
            level = Level.ERROR if coverage < limits.error_coverage else Level.WARN
            found.append((level, f"{where}: 90 % ellipses hold {100 * coverage:.0f} %"))
    if not found:
        return QualityVerdict(Level.OK, f"as good as it says, over the last {window_s // 60} min")
    found.sort(key=lambda item: -item[0])
    return QualityVerdict(found[0][0], "; ".join(text for _, text in found))
