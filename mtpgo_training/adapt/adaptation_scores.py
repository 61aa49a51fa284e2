# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Scores of a model on the validation part of a site."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from mtpgo_core.quality import metrics
from mtpgo_core.task.calibration import is_moving
from mtpgo_training.adapt.site_predictions import SitePredictions
from mtpgo_training.calibration.calibration_fit import LEVEL


@dataclass(frozen=True)
class SiteScores:
    """Errors of a model and of constant velocity.

    Attributes:
        moving: number of moving agents, each at one instant.
        ade_m: ADE of these (m).
        constant_velocity_ade_m: ADE of constant velocity for the same agents (m).
        nll: negative log-likelihood of the position, of all agents (nats).
        coverage_90: by time ahead (s), share of the moving agents in the 90 % ellipse of the
            heaviest mode; NaN where none is observed then.
    """

    moving: int
    ade_m: float
    constant_velocity_ade_m: float
    nll: float
    coverage_90: dict[float, float]

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON; NaN becomes None."""
        plain = asdict(self)
        plain["coverage_90"] = {
            f"{time:g}": None if np.isnan(share) else share
            for time, share in self.coverage_90.items()
        }
        return plain


def score_site(predictions: SitePredictions) -> SiteScores:
    """Return the scores of a model.

    Args:
        predictions: of the model for the validation scenes, calibrated as they are to be scored.
    """
    mean, weight, covariance = predictions.mean, predictions.weight, predictions.covariance
    truth, mask = predictions.truth, predictions.mask
    moving = is_moving(predictions.group)
    nees = metrics.nees(mean, weight, covariance, truth)
    inside = (nees <= metrics.radius_squared(LEVEL)) & mask
    straight = np.linalg.norm(predictions.constant_velocity - truth, axis=-1)
    coverage: dict[float, float] = {}
    for time_s in metrics.TIMES_S:
        step = metrics.step_at(time_s, mask.shape[1], predictions.step_s)
        known = moving & mask[:, step] if step is not None else np.zeros_like(moving)
        coverage[time_s] = float(inside[known, step].mean()) if known.any() else float("nan")
    return SiteScores(
        int(moving.sum()),
        metrics.average(metrics.ade(mean, weight, truth, mask)[moving]),
        metrics.average(metrics.over_steps(straight, mask)[moving]),
        metrics.average(metrics.anll(mean, weight, covariance, truth, mask)),
        coverage,
    )
