# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The calibration of an adapted model: fitted to its site, elsewhere that of the base model."""

from __future__ import annotations

import dataclasses

import numpy as np

from mtpgo_core.task.calibration import Calibration, CalibrationOrigin
from mtpgo_training.adapt.site_predictions import SitePredictions
from mtpgo_training.calibration.calibration_fit import fit_calibration
from mtpgo_training.calibration.calibration_samples import CalibrationSamples

FEWEST_PREDICTIONS = 100
"""A group with fewer predictions (a road user at an instant) keeps the calibration of the base
model; chosen: the standard deviation of a coverage of 90 % is then 3 %."""


def site_calibration(samples: CalibrationSamples, base: Calibration) -> Calibration:
    """Return the calibration fitted to a site.

    Groups that the site hardly shows keep their calibration, if the base model has one.

    Args:
        samples: of the adapted model on the validation part, without a calibration.
        base: calibration of the base model.
    """
    fitted = fit_calibration(samples)
    if base.is_none or base.horizon_steps != fitted.horizon_steps:
        return fitted
    groups = tuple(
        own if own.agents >= FEWEST_PREDICTIONS else former
        for own, former in zip(fitted.groups, base.groups, strict=True)
    )
    if groups == fitted.groups:
        return fitted
    origins = (CalibrationOrigin(base.sites, base.left_out), *base.base)
    return dataclasses.replace(fitted, groups=groups, base=origins)


def cross_calibrated(predictions: SitePredictions, base: Calibration) -> SitePredictions:
    """Return predictions calibrated by what was fitted to others.

    The calibration of each half of the time is fitted to the other half, so that its coverage is
    not that of the data it was fitted to.

    Args:
        predictions: without a calibration.
        base: see :func:`site_calibration`.
    """
    halves = np.array_split(np.arange(len(predictions)), 2)
    parts = []
    for own, other in zip(halves, reversed(halves), strict=True):
        calibration = site_calibration(predictions.select(other).samples(), base)
        parts.append(predictions.select(own).calibrated(calibration))
    weight = np.concatenate([part.weight for part in parts])
    covariance = np.concatenate([part.covariance for part in parts])
    return dataclasses.replace(predictions, weight=weight, covariance=covariance)
