# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The model's share of the period, and the report when it is not sufficient.

No ROS in here.
"""

from __future__ import annotations

from mtpgo_core.prediction.scene_predictor import PredictionReport

_MARGIN = 2.0
"""Time kept for publishing the fallback, as a multiple of what it took lately; chosen."""

_MODEL_MARGIN = 3.0
"""The same for the model, which is not to be over budget; chosen: transport and the subscriber's
reading of a message take about as long as making it (measured)."""

_FADE = 0.9
"""Factor per prediction by which a long publication is forgotten; chosen."""

_LEAST = 0.2
"""Share of the period that the model always has; chosen."""

_MODEL_SHARE = 0.95
"""Share of the time left that the model may take; the rest is for decoding and history; chosen."""


class LoadControl:
    """Reduces the model's time budget by the time that publishing takes."""

    def __init__(self) -> None:
        self._publishing_ns = 0.0

    def published(self, took_ns: int) -> None:
        """Take the duration of a publication (ns) into account."""
        self._publishing_ns = max(took_ns, _FADE * self._publishing_ns)

    def budget_ns(self, budget: float, period_ns: int) -> int:
        """Return how long after an observation the fallback answers (ns).

        Args:
            budget: the parameter, a share of the period.
            period_ns: shortest time between two predictions (ns).
        """
        left_ns = period_ns - _MARGIN * self._publishing_ns
        return round(min(budget * period_ns, max(_LEAST * period_ns, left_ns)))

    def allowed_s(self, budget: float, period_s: float) -> float:
        """Return how long a prediction may take (s)."""
        left_s = budget * period_s - _MODEL_MARGIN * 1e-9 * self._publishing_ns
        return _MODEL_SHARE * max(_LEAST * period_s, left_s)


def overload(report: PredictionReport, modes: int) -> str:
    """Return what a prediction lacks because there are many agents, empty if nothing.

    Args:
        report: on the prediction.
        modes: of a prediction without overload.
    """
    found = []
    if report.over_limit:
        why = (
            "max_agents is the limit"
            if report.agent_limit is None
            else "there is no time for more"
        )
        found.append(
            f"the model predicts the nearest {report.by_model} of {report.agents} agents, constant"
            f" velocity the others: {why}"
        )
    if report.modes < modes:
        found.append(
            f"{report.modes} of {modes} modes are published: {report.agents} agents are more than"
            " max_points allows with all"
        )
    return "; ".join(found)
