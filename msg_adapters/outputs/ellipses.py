# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Covariance ellipses as line segments."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.schema import Float64Array


def ellipse_sides(
    mean: Float64Array, covariance: Float64Array, *, sigma: float, corners: int
) -> Float64Array:
    """Return [n, M, E * corners * 2, 2] side ends of polygons inscribed in the ellipses (m).

    Args:
        mean: [n, M, E, 2] centres (m).
        covariance: [n, M, E, 2, 2] (m^2).
        sigma: Mahalanobis radius.
        corners: corners of a polygon.
    """
    angle = np.linspace(0.0, 2.0 * np.pi, corners, endpoint=False)
    # The Cholesky factor maps the circle of radius sigma onto the ellipse.
    variance = np.maximum(covariance[..., 0, 0], 1e-12)
    a = np.sqrt(variance)
    b = covariance[..., 1, 0] / a
    c = np.sqrt(np.maximum(covariance[..., 1, 1] - b**2, 0.0))
    cos, sin = sigma * np.cos(angle), sigma * np.sin(angle)
    x = mean[..., 0, None] + a[..., None] * cos
    y = mean[..., 1, None] + b[..., None] * cos + c[..., None] * sin
    ring = np.stack([x, y], axis=-1)
    sides = np.stack([ring, np.roll(ring, -1, axis=-2)], axis=-2)
    n, modes, count = mean.shape[:3]
    return sides.reshape(n, modes, count * corners * 2, 2)


def ellipse_steps(time_s: Float64Array, every_s: float) -> NDArray[np.intp]:
    """Return the steps nearest to the multiples of ``every_s`` within the horizon."""
    if len(time_s) == 0:
        return np.empty(0, dtype=np.intp)
    wanted = every_s * np.arange(1, int(time_s[-1] / every_s + 1e-6) + 1)
    steps: NDArray[np.intp] = np.unique(np.abs(time_s - wanted[:, None]).argmin(axis=1))
    return steps
