# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Scores of a calibrated model on the validation part of a site."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import torch

from mtpgo_core.schema import MOVING_MPS
from mtpgo_training.adapt.site_predictions import SitePredictions
from mtpgo_training.evaluation.scores import metrics
from mtpgo_training.training.validation import CovarianceCalibration

COVERAGE_TIMES_S = (1.0, 3.0, 5.0)
"""Times ahead at which the coverage is reported (s)."""


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


def score_site(
    predictions: SitePredictions, dt_s: float, scale: float | None = None
) -> SiteScores:
    """Return the scores of a model.

    Args:
        predictions: of the model for the validation scenes.
        dt_s: time between two horizon steps (s).
        scale: factor on the covariances. None fits it to each half of the time and applies it to
            the other half, so that the coverage is not that of the data it was fitted to.
    """
    n = len(predictions)
    scales = np.ones(n)
    if scale is not None:
        scales[:] = scale
    else:
        first, second = slice(0, n // 2), slice(n // 2, n)
        scales[first] = fit_scale(predictions.select(second))
        scales[second] = fit_scale(predictions.select(first))
    mean, weight = predictions.mean, np.exp(predictions.log_weight)
    covariance = predictions.covariance * scales[:, None, None, None, None]
    truth, mask = predictions.truth, predictions.mask
    moving = predictions.speed_mps > MOVING_MPS
    nees = metrics.nees(mean, weight, covariance, truth)
    inside = (nees <= metrics.radius_squared(0.9)) & mask
    straight = np.linalg.norm(predictions.constant_velocity - truth, axis=-1)
    coverage = {}
    for time_s in COVERAGE_TIMES_S:
        step = round(time_s / dt_s) - 1
        known = moving & mask[:, step] if step < mask.shape[1] else np.zeros(n, np.bool_)
        coverage[time_s] = float(inside[known, step].mean()) if known.any() else float("nan")
    return SiteScores(
        int(moving.sum()),
        metrics.average(metrics.ade(mean, weight, truth, mask)[moving]),
        metrics.average(metrics.over_steps(straight, mask)[moving]),
        metrics.average(metrics.anll(mean, weight, covariance, truth, mask)),
        coverage,
    )


def fit_scale(predictions: SitePredictions) -> float:
    """Return the factor on the covariances that calibrates them on these agents."""
    if not len(predictions):
        return 1.0
    calibration = CovarianceCalibration()
    fields = {
        "target": torch.from_numpy(predictions.truth)[None],
        "weight": torch.from_numpy(predictions.mask).float()[None],
        "primary": torch.ones(1, len(predictions), dtype=torch.bool),
    }
    output = (predictions.log_weight, predictions.mean, predictions.covariance)
    calibration.add(fields, *(torch.from_numpy(value)[None] for value in output))
    return calibration.scale()
