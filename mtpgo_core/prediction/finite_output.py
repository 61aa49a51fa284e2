# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Which predictions can be published: every number finite and every covariance definite.

Predictions are published in float32. What is finite and positive definite in float64 may be
neither after rounding, so both are checked on the rounded values.
"""

from __future__ import annotations

import numpy as np

from mtpgo_core.schema import BoolArray, Float64Array, Prediction

_WEIGHT_TOLERANCE = 1e-3
"""Largest difference of the sum of weights from 1; chosen far above rounding."""


def definite_in_float32(covariance: Float64Array) -> BoolArray:
    """Return [...] whether covariances [..., 2, 2] are finite and positive definite in float32."""
    with np.errstate(invalid="ignore", over="ignore"):
        rounded = covariance.astype(np.float32).astype(np.float64)
        xx, xy, yy = rounded[..., 0, 0], rounded[..., 0, 1], rounded[..., 1, 1]
        definite = (xx > 0.0) & (yy > 0.0) & (xx * yy - xy * xy > 0.0)
        return np.asarray(definite & np.isfinite(xx + yy))


def finite_in_float32(values: np.ndarray) -> BoolArray:
    """Return [n] whether all numbers of each row of [n, ...] values are finite in float32."""
    with np.errstate(invalid="ignore"):
        axes = tuple(range(1, values.ndim))
        largest = np.abs(values).max(axis=axes, initial=0.0)
        return np.asarray(largest <= np.finfo(np.float32).max)  # false for NaN


def publishable(prediction: Prediction) -> BoolArray:
    """Return [n] which agents' predictions can be published; an unknown height can be."""
    z = np.where(np.isnan(prediction.z), 0.0, prediction.z)
    usable = np.abs(prediction.weight.sum(axis=1) - 1.0) <= _WEIGHT_TOLERANCE
    usable &= (prediction.weight >= 0.0).all(axis=1)
    for values in (z, prediction.mean, prediction.yaw, prediction.initial):
        usable &= finite_in_float32(values)
    return np.asarray(usable & definite_in_float32(prediction.covariance).all(axis=(1, 2)))
