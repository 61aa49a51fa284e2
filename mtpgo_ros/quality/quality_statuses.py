# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The scores of the predictions as text: diagnostic statuses, and a text in the scene."""

from __future__ import annotations

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus

from mtpgo_core.quality.metrics import TIMES_S
from mtpgo_core.quality.quality_report import (
    SCORES,
    WINDOWS_S,
    QualityLimits,
    QualityReport,
    QualityVerdict,
    group_text,
    judge_group,
)
from mtpgo_core.task.calibration import GROUPS
from mtpgo_ros.diagnostics.diagnostic_status import make_status


def group_statuses(
    name: str, report: QualityReport, limits: QualityLimits
) -> list[DiagnosticStatus]:
    """Return a status of the node ``name`` for each window and group that was predicted."""
    found = []
    for w, window_s in enumerate(WINDOWS_S):
        for group in range(len(GROUPS)):
            if not report.predictions[w, group].any():
                continue
            verdict = judge_group(report, limits, window_s, group)
            values = {"window_s": str(window_s), "group": GROUPS[group]}
            for t, time_s in enumerate(TIMES_S):
                values |= _at_time(report, limits, (w, group, t), time_s)
            title = f"{name}: quality of {group_text(group)} in {window_s // 60} min"
            found.append(make_status(title, bytes([verdict.level]), verdict.message, values))
    return found


def summary_values(report: QualityReport, limits: QualityLimits, window_s: int) -> dict[str, str]:
    """Return the values of the status ``quality`` in ``/diagnostics``."""
    w = WINDOWS_S.index(window_s)
    values = {
        "window_s": str(window_s),
        "min_agents": str(limits.min_agents),
        "warn_coverage": f"{limits.warn_coverage:g}",
        "error_coverage": f"{limits.error_coverage:g}",
        "error_cv_ratio": f"{limits.error_cv_ratio:g}",
    }
    for group in np.flatnonzero(report.predictions[w].any(axis=1)).tolist():
        verdict = judge_group(report, limits, window_s, group)
        values[GROUPS[group]] = verdict.message.partition(": ")[2]
    return values | {f"no_truth_{cause}": str(n) for cause, n in report.unknown.items()}


def overlay_text(
    verdict: QualityVerdict, report: QualityReport, limits: QualityLimits, window_s: int
) -> str:
    """Return lines for a text in the scene: the verdict, then each group that was predicted."""
    w = WINDOWS_S.index(window_s)
    groups = np.flatnonzero(report.predictions[w].any(axis=1)).tolist()
    lines = [judge_group(report, limits, window_s, group).message for group in groups]
    return "\n".join([f"{verdict.level.name}, last {window_s // 60} min", *lines])


def _at_time(
    report: QualityReport, limits: QualityLimits, place: tuple[int, int, int], time_s: int
) -> dict[str, str]:
    """Return the numbers at one time ahead; of too few agents only how many they are."""
    values = {
        f"agents_{time_s}s": str(report.agents[place]),
        f"predictions_{time_s}s": str(report.predictions[place]),
        f"by_model_{time_s}s": str(report.by_model[place]),
    }
    if report.agents[place] < limits.min_agents:
        return values | {f"scores_{time_s}s": "too few road users"}
    scores = zip(SCORES, report.scores[place].tolist(), strict=True)
    return values | {f"{name}_{time_s}s": f"{value:.4f}" for name, value in scores}
