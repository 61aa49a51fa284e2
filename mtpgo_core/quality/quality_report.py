# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The scores of the last minutes, and the verdict on how reliable the predictions are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

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

QUALITY_ROW = np.dtype(
    [
        ("stamp_s", "f8"),
        *((name, "i8") for name in ("window_s", "group", "time_s")),
        *((name, "i8") for name in ("agents", "predictions", "by_model")),
        *((name, "f8") for name in SCORES),
    ]
)
"""A row of the table: time of the newest observation (s), window (s), group as a position in
``GROUPS``, time ahead (s), numbers of :class:`QualityReport`, scores."""

_ADE, _COVERAGE, _CV_ADE = (SCORES.index(name) for name in ("ade", "coverage_90", "cv_ade"))

_HARMLESS_M = 0.1
"""A difference of two ADE below this is none (m); chosen: the noise of a good tracker, which makes
up the whole error of standing road users."""

_NOTICEABLE = 0.02
"""Share by which an ADE is worse than constant velocity's before it counts; chosen: less is no
difference that a user would notice, as in the evaluation."""


class Level(IntEnum):
    """How reliable the predictions are; the values are those of ``DiagnosticStatus``."""

    OK = 0
    WARN = 1
    ERROR = 2


@dataclass(frozen=True)
class QualityLimits:
    """Limits of the scores for warnings and errors.

    Attributes:
        min_agents: fewest road users of a group whose scores are given and judged.
        warn_coverage: WARN below this share of truths inside the 90 % ellipses.
        error_coverage: ERROR below it.
        error_cv_ratio: ERROR where the ADE is more than this many times that of constant velocity;
            WARN where it is worse by 2 %. Differences up to 0.1 m do not count.
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

    def rows(self, limits: QualityLimits) -> NDArray[Any]:
        """Return [W G T] rows of :data:`QUALITY_ROW`; the scores of too few agents are NaN."""
        shape = self.agents.shape
        rows = np.zeros(shape, dtype=QUALITY_ROW)
        rows["stamp_s"] = self.now_ns * 1e-9
        rows["window_s"] = np.array(WINDOWS_S)[:, None, None]
        rows["group"] = np.arange(shape[1])[:, None]
        rows["time_s"] = np.array(TIMES_S)
        for name in ("agents", "predictions", "by_model"):
            rows[name] = getattr(self, name)
        for name, scores in zip(SCORES, np.moveaxis(self.trusted(limits), -1, 0), strict=True):
            rows[name] = scores
        return rows.reshape(-1)


@dataclass(frozen=True)
class QualityVerdict:
    """How reliable the predictions of one group, or of all groups, are.

    Attributes:
        level: the worst that applies.
        message: the problems, or the scores if there are none.
    """

    level: Level
    message: str


def judge(report: QualityReport, limits: QualityLimits, window_s: int) -> QualityVerdict:
    """Return the verdict on all groups over one window.

    Args:
        report: scores.
        limits: from when on they are bad.
        window_s: one of :data:`WINDOWS_S`.
    """
    agents = report.agents[WINDOWS_S.index(window_s)]
    last = f"the last {window_s // 60} min"
    if not (agents >= limits.min_agents).any():
        return QualityVerdict(
            Level.OK,
            f"too few road users to judge: at most {int(agents.max(initial=0))} of a group in "
            f"{last}, {limits.min_agents} are needed",
        )
    verdicts = [judge_group(report, limits, window_s, group) for group in range(len(GROUPS))]
    bad = sorted((v for v in verdicts if v.level > Level.OK), key=lambda v: -v.level)
    if not bad:
        return QualityVerdict(Level.OK, f"as good as the predictions say, over {last}")
    return QualityVerdict(bad[0].level, "; ".join(v.message for v in bad))


def judge_group(
    report: QualityReport, limits: QualityLimits, window_s: int, group: int
) -> QualityVerdict:
    """Return the verdict on one group over one window; the arguments are those of :func:`judge`.

    Its message names the times ahead that are bad or, if none is, the last one that can be judged.
    """
    w = WINDOWS_S.index(window_s)
    scores, agents = report.trusted(limits)[w, group], report.agents[w, group]
    name = group_text(group)
    enough = np.flatnonzero(agents >= limits.min_agents)
    if not len(enough):
        most = int(agents.max(initial=0))
        return QualityVerdict(
            Level.OK, f"{name}: too few road users, {most} of {limits.min_agents} needed"
        )
    found: list[tuple[Level, str]] = []
    for t in enough.tolist():
        ade, cv = scores[t, _ADE], scores[t, _CV_ADE]
        if ade > max(cv + _HARMLESS_M, (1.0 + _NOTICEABLE) * cv):
            level = Level.ERROR if ade > limits.error_cv_ratio * cv else Level.WARN
            text = f"worse than constant velocity at {TIMES_S[t]} s, ADE {ade:.2f} m to {cv:.2f} m"
            found.append((level, text))
    coverage = scores[:, _COVERAGE]
    small = [t for t in enough.tolist() if coverage[t] < limits.warn_coverage]
    if small:
        level = Level.ERROR if coverage[small].min() < limits.error_coverage else Level.WARN
        shares = ", ".join(f"{100.0 * coverage[t]:.0f}" for t in small)
        times = ", ".join(str(TIMES_S[t]) for t in small)
        hold = f"90 % ellipses hold {shares} % of the true positions at {times} s"
        found.append((level, hold))
    if found:
        worst = max(level for level, _ in found)
        return QualityVerdict(worst, f"{name}: " + ", ".join(text for _, text in found))
    t = int(enough[-1])
    return QualityVerdict(
        Level.OK,
        f"{name}: at {TIMES_S[t]} s ADE {scores[t, _ADE]:.2f} m, constant velocity "
        f"{scores[t, _CV_ADE]:.2f} m, 90 % ellipses hold {100.0 * scores[t, _COVERAGE]:.0f} %, "
        f"{int(agents[t])} road users",
    )


def group_text(group: int) -> str:
    """Return the name of a group of ``GROUPS`` for people: ``moving vehicle``."""
    name, _, motion = GROUPS[group].rpartition("_")
    kind = "unknown" if name == "any" else name.replace("_", "-")
    return f"{motion} {kind}"
