# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A model's calibration and the coverage of its ellipses as text."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from mtpgo_core.quality.metrics import MOVING_COVERAGE_KEY, SITES_COVERAGE_KEY, scored_steps
from mtpgo_core.task.calibration import Calibration, CalibrationOrigin

_PREFIXES = tuple(key.split("{:g}")[0] for key in (MOVING_COVERAGE_KEY, SITES_COVERAGE_KEY))


def is_moving_score(key: str) -> bool:
    """Return whether a value in a model's metrics is of ``calibration_report.moving_scores``."""
    return key.startswith((*_PREFIXES, "moving_n"))


def moving_coverage(
    scores: Mapping[str, Any], key: str = MOVING_COVERAGE_KEY
) -> dict[float, float | None]:
    """Return the shares in a model's metrics by the time ahead (s), ascending.

    Args:
        scores: the metrics.
        key: name of the share: of all road users, or ``SITES_COVERAGE_KEY``. In files of earlier
            versions, which have only the first, it is the mean of the sites.
    """
    before, after = key.split("{:g}")
    return {
        float(name.removeprefix(before).removesuffix(after)): scores[name]
        for name in scores
        if name.startswith(before)
    }


def moving_text(scores: Mapping[str, Any]) -> str:
    """Return the coverage of moving road users on one line, of all and as the mean of the sites.

    Args:
        scores: of :func:`mtpgo_training.calibration.calibration_report.moving_scores`, and others.

    Returns:
        The line, empty if the scores have no coverage of moving road users.
    """
    of_all, of_sites = (
        moving_coverage(scores, key) for key in (MOVING_COVERAGE_KEY, SITES_COVERAGE_KEY)
    )
    if not of_all:
        return ""
    times = " / ".join(f"{time_s:g}" for time_s in of_all)
    inside = (
        f"of moving road users are inside their 90 % ellipse after {times} s "
        f"({scores['moving_n']} predictions)"
    )
    if not of_sites:
        return f"in the mean of the sites {_shares(of_all)} {inside}"
    return f"{_shares(of_all)} {inside}, in the mean of the sites {_shares(of_sites)}"


def _sites(origin: Calibration | CalibrationOrigin) -> str:
    what = "left-out sites" if origin.left_out else "validation recordings"
    return f"{what}: " + ", ".join(f"{site.name} ({site.agents})" for site in origin.sites)


def _shares(by_time: Mapping[float, float | None]) -> str:
    return " / ".join("-" if share is None else f"{share:.3f}" for share in by_time.values())


def calibration_text(calibration: Calibration, step_s: float) -> list[str]:
    """Return lines that say where a calibration was fitted and what it does.

    Args:
        calibration: with or without groups.
        step_s: time between two horizon steps (s).
    """
    if calibration.is_none:
        return ["none"]
    lines = [f"fitted to {_sites(calibration)}"]
    lines += [
        f"groups that were hardly there, as before the adaptation: fitted to {_sites(origin)}"
        for origin in calibration.base
    ]
    steps = scored_steps(calibration.horizon_steps, step_s)
    for group in calibration.groups:
        factors = "  ".join(f"{t:g} s {group.factors[step]:.2f}" for t, step in steps.items())
        parts = [f"covariance x {factors}", f"temperature {group.temperature:.2f}"]
        if group.sigma_factors_50:
            inner = "  ".join(f"{group.sigma_factors_50[step]:.2f}" for step in steps.values())
            parts.append(f"50 % ellipse x {inner}")
        fitted = f"({group.agents} agents, {group.sites} sites)"
        lines.append(f"{group.name:<20} {'  '.join([*parts, fitted])}")
    return lines
