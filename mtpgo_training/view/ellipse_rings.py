# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Ellipses as polygons."""

from __future__ import annotations

import numpy as np

from mtpgo_core.quality.metrics import radius_squared, sigma_factor
from mtpgo_core.schema import Float64Array, Prediction
from mtpgo_training.data.recording import Int64Array
from mtpgo_training.view.view_scene import ELLIPSE_LEVEL

_CIRCLE = np.linspace(0.0, 2.0 * np.pi, 33)[:-1]


def ellipse_rings(
    prediction: Prediction, agent: int, mode: int, steps: Int64Array
) -> list[Float64Array]:
    """Return [corners, 2] the ellipses of a mode at some steps (m), where they are known."""
    rings = []
    for step in steps.tolist():
        covariance = prediction.covariance[agent, mode, step]
        if not np.isfinite(covariance).all():
            continue
        factor = float(sigma_factor(ELLIPSE_LEVEL, prediction.sigma_factor_50[agent, step]))
        radius = factor * float(np.sqrt(radius_squared(ELLIPSE_LEVEL)))
        value, vector = np.linalg.eigh(covariance)
        circle = radius * np.stack([np.cos(_CIRCLE), np.sin(_CIRCLE)], axis=-1)
        ring = (circle * np.sqrt(np.maximum(value, 0.0))) @ vector.T
        rings.append(prediction.mean[agent, mode, step, :2] + ring)
    return rings
