# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A model's calibration and the coverage of its ellipses as text."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from mtpgo_core.quality.metrics import MOVING_COVERAGE_KEY, TIMES_S
from mtpgo_core.task.calibration import Calibration

_BEFORE, _AFTER = MOVING_COVERAGE_KEY.split("{:g}")


def is_moving_score(key: str) -> bool:
    """Return whether a value in a model's metrics is of ``calibration_report.moving_scores``."""
    return key.startswith((_BEFORE, "moving_n"))


def moving_coverage(scores: Mapping[str, Any]) -> dict[float, float | None]:
    """Return the shares in a model's metrics by the time ahead (s), ascending."""
    return {
        float(key.removeprefix(_BEFORE).removesuffix(_AFTER)): scores[key]
        for key in scores
        if key.startswith(_BEFORE)
    }


def moving_text(scores: Mapping[str, Any]) -> str:
    """Return the coverage of moving road users on one line.

    Args:
        scores: of :func:`mtpgo_training.calibration.calibration_report.moving_scores`, and others.

    Returns:
        The line, empty if the scores have no coverage of moving road users.
    """
    shares = moving_coverage(scores)
    if not shares:
        return ""
    times = " / ".join(f"{time_s:g}" for time_s in shares)
    values = " / ".join("-" if share is None else f"{share:.3f}" for share in shares.values())
    return (
        f"{values} of moving road users are inside their 90 % ellipse after "
        f"{times} s ({scores['moving_n']} predictions)"
    )


def calibration_text(calibration: Calibration, step_s: float) -> list[str]:
    """Return lines that say where a calibration was fitted and what it does.

    Args:
        calibration: with or without groups.
        step_s: time between two horizon steps (s).
    """
    if calibration.is_none:
        return ["none"]
    what = "left-out sites" if calibration.left_out else "validation recordings"
    sites = ", ".join(f"{site.name} ({site.agents})" for site in calibration.sites)
    lines = [f"fitted to {what}: {sites}"]
    steps = [round(t / step_s) for t in TIMES_S if round(t / step_s) <= calibration.horizon_steps]
    for group in calibration.groups:
        factors = "  ".join(
            f"{step * step_s:g} s {group.factors[step - 1]:.2f}"
            for step in steps or [calibration.horizon_steps]
        )
        lines.append(
            f"{group.name:<20} covariance x {factors}  temperature {group.temperature:.2f}  "
            f"({group.agents} agents, {group.sites} sites)"
        )
    return lines
