# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The modes of a prediction lie as far apart as its covariance says that futures do.

Networks that are trained on the likelihood of a mixture draw their modes together: each covariance
explains what lies between them. Around the heaviest mode, the others are therefore moved apart
where they lie closer together than its own standard deviation allows for (docs/design.md, "Spread
of the modes").
"""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Floats = TypeVar("Floats", NDArray[np.float64], NDArray[np.float32])

LARGEST_STRETCH = 3.0
"""Largest factor on the distances from the heaviest mode; chosen on left-out sites: of factors up
to 2, 2.5 and 3 the last has the smallest error of the nearest mode."""

LARGEST_DEVIATION = 0.6
"""Tangent of the largest angle between the courses of a mode and of the moved mode; chosen on
left-out sites: of 0.6 and 1 it leaves fewer modes that turn round, with the same errors."""

SLOW_MPS = 0.5
"""Added to a mode's speed where courses are compared (m/s), so that modes that stop may be moved;
chosen in the same way, of 0.5 and 1."""


def with_least_spread(
    mean: Floats,
    weight: NDArray[np.floating],
    covariance: NDArray[np.floating],
    least: float,
    dt_s: float,
) -> Floats:
    """Return the means with modes that end at least as far apart as wanted.

    The spread of an agent's modes is the root of the mean squared distance of their last points
    from that of the heaviest mode, averaged with the mode weights. Where it is below ``least``
    times the standard deviation of the heaviest mode's last point, the root of the trace of its
    covariance, the other modes are moved away from the heaviest one: at the last step by the
    factor that is missing (:data:`LARGEST_STRETCH` at most), before by one that grows evenly from
    1 at t. A mode is moved less where its path would turn away from its course or back
    (:data:`LARGEST_DEVIATION`): a slow mode in a bend lies behind and beside the heaviest one, and
    farther out would be a path that turns round. The velocities are those of the moved paths. The
    heaviest mode stays as it is.

    Args:
        mean: [n, M, H, S] position (m), and velocity if S is 4 (m/s). Rows that are not finite
            stay so.
        weight: [n, M] mode weights.
        covariance: [n, M, H, 2, 2] of the position (m^2), as the network gives it.
        least: smallest spread, in standard deviations; 0 returns the means as they are.
        dt_s: step of the horizon (s).
    """
    if not least or mean.shape[1] < 2 or not len(mean):
        return mean
    rows = np.arange(len(mean))
    heaviest = weight.argmax(axis=1)
    centre = mean[rows, heaviest][:, None]  # [n, 1, H, S]
    variance = covariance[rows, heaviest, -1]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        offset = mean - centre
        squared = (weight * (offset[:, :, -1, :2] ** 2).sum(axis=-1)).sum(axis=1)
        allowed = variance[:, 0, 0] + variance[:, 1, 1]
        stretch = np.clip(least * np.sqrt(allowed / squared), 1.0, LARGEST_STRETCH)
        step = np.arange(1, mean.shape[2] + 1, dtype=mean.dtype)[:, None]
        added = step * offset  # for a growth of 1 in a step
        if mean.shape[3] == 4:
            added[..., 2:] += offset[..., :2] / mean.dtype.type(dt_s)
        growth = ((stretch - 1.0) / mean.shape[2])[:, None]
        growth = np.minimum(growth, _largest_growth(mean[..., :2], added[..., :2], dt_s))
        moved = mean + growth.astype(mean.dtype)[..., None, None] * added
    moved[rows, heaviest] = centre[:, 0]  # Also where no other mode is finite.
    return moved


def _largest_growth(mean: Floats, added: Floats, dt_s: float) -> NDArray[np.floating]:
    """Return [n, M] up to which multiple of what is added a path keeps its course.

    Args:
        mean: [n, M, H, 2] positions (m).
        added: [n, M, H, 2] to them (m).
        dt_s: step of the horizon (s).
    """
    course, change = np.diff(mean, axis=2), np.diff(added, axis=2)  # [n, M, H - 1, 2] in a step
    length = np.hypot(course[..., 0], course[..., 1])
    along = (course * change).sum(axis=-1) / np.maximum(length, 1e-6)
    across = np.sqrt(np.maximum((change**2).sum(axis=-1) - along**2, 0.0))
    turns = across - LARGEST_DEVIATION * along
    allowed = LARGEST_DEVIATION * (length + SLOW_MPS * dt_s) / np.maximum(turns, 1e-12)
    return np.asarray(np.where(turns > 0.0, allowed, np.inf).min(axis=2, initial=np.inf))
