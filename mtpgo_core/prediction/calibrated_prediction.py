# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Applies the calibration of a model to its predictions."""

from __future__ import annotations

import dataclasses

import numpy as np

from mtpgo_core.schema import CalibrationStage, Float64Array, HistoryWindow, Prediction
from mtpgo_core.task.calibration import Calibration, GroupArray, calibration_groups


def calibrate(
    prediction: Prediction, calibration: Calibration, velocity: Float64Array | None = None
) -> Prediction:
    """Return a prediction with calibrated covariances, 50 % ellipses and mode weights.

    Means do not change. The order of the modes does not change either, because w^(1/T) rises with
    w.

    Args:
        prediction: of the model, as it computes it.
        calibration: of that model; one without groups changes nothing.
        velocity: [n, 2] at t (m/s), NaN where it was never known; by default that of
            ``prediction.initial``, which is 0 there.
    """
    if calibration.is_none or not len(prediction):
        return prediction
    known = prediction.initial[:, 2:] if velocity is None else velocity
    group = calibration_groups(prediction.agent_class, known)
    return dataclasses.replace(
        prediction,
        weight=calibrated_weights(prediction.weight, group, calibration),
        covariance=calibrated_covariances(prediction.covariance, group, calibration),
        sigma_factor_50=calibration.sigma_factor_50_table[group],
        calibration=np.full(len(prediction), CalibrationStage.SHIPPED, dtype=np.uint8),
    )


def weight_temperatures(window: HistoryWindow, calibration: Calibration) -> Float64Array:
    """Return [n] the temperatures with which the mode weights of a window's agents are calibrated.

    Args:
        window: of the agents.
        calibration: one without groups has the temperature 1.
    """
    if calibration.is_none:
        return np.ones(len(window))
    group = calibration_groups(window.agent_class, window.velocity[:, -1])
    return np.asarray(1.0 / calibration.inverse_temperatures[group])


def calibrated_weights(
    weight: Float64Array, group: GroupArray, calibration: Calibration
) -> Float64Array:
    """Return [n, M] the weights w^(1/T), normalised.

    Args:
        weight: [n, M], summing to 1; NaN stays NaN.
        group: [n] positions in :data:`~mtpgo_core.task.calibration.GROUPS`.
        calibration: with groups.
    """
    largest = weight.max(axis=1, keepdims=True)
    powers = (weight / largest) ** calibration.inverse_temperatures[group][:, None]
    return np.asarray(powers / powers.sum(axis=1, keepdims=True))


def calibrated_covariances(
    covariance: Float64Array, group: GroupArray, calibration: Calibration
) -> Float64Array:
    """Return [n, M, H, 2, 2] the covariances times the factors of the groups.

    Args:
        covariance: [n, M, H, 2, 2] (m^2).
        group: [n] positions in :data:`~mtpgo_core.task.calibration.GROUPS`.
        calibration: with groups, for H steps.
    """
    return covariance * calibration.factor_table[group][:, None, :, None, None]
