# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Predicted paths do not jump from cycle to cycle without news.

Five seconds ahead, noise of 0.1 m/s^2 in an agent's acceleration is more than a metre. What the
model predicted for the same time in the cycle before was computed from nearly the same past with
other noise, so a mean of the two is as accurate and jumps less (docs/design.md, "Smooth paths").
And of two modes that are about as likely, now one and now the other would be the heaviest.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mtpgo_core.history.track_index import SortKeyArray, find_sort_keys, sort_keys
from mtpgo_core.prediction.paths.forward_motion import moving_vehicles
from mtpgo_core.schema import BoolArray, Float64Array, HistoryWindow, IndexArray

LONGEST_CYCLE_S = 1.0
"""Predictions farther apart, to the nearest step, are not combined (s); chosen: a pause, not a
cycle. To the nearest step, since 30 frames of a camera at 29.97 Hz take a little more than 1 s."""

LONGEST_MEMORY_S = 5.0
"""Largest tau (s); chosen: the horizon, beyond which news would never arrive."""

SHORTEST_GAP_S = 0.5
"""A gap of the observations that is longer leaves out all samples within this time (s): the
history bridges shorter ones. Fewer are missing where a delay was compensated."""

KEEP_FACTOR = 1.18
"""The calibrated weight of the mode that was the heaviest in the cycle before is multiplied by
this; chosen on left-out sites (docs/design.md, "Smooth paths")."""

NEWS_RADIUS = 2.146
"""Where the path of the cycle before ends outside the ellipse of this Mahalanobis radius, that of
90 %, around the new one's end, there is news, and the new path is taken as it is; chosen on
left-out sites (docs/design.md, "Smooth paths")."""


@dataclass(frozen=True)
class _Paths:
    """The paths of one cycle.

    Attributes:
        stamp_ns: when they start (ns).
        key: [m] ascending sort keys of the agents.
        mean: [m, M, H, 4] x, y, vx, vy in the fixed frame (m, m/s), modes in the network's order.
        heaviest: [m] which mode had the largest weight.
    """

    stamp_ns: int
    key: SortKeyArray
    mean: Float64Array
    heaviest: IndexArray


class PathSmoother:
    """Combines each path with the one that the cycle before predicted for the same agent and mode.

    The point k of H steps ahead becomes (1 - b) new + b old with b = e^(-T / tau) k / H, where T
    is the time since the last cycle and ``old`` is the last cycle's path at the same time. So the
    next moments are as the model predicts them now, and the farthest point has a memory of tau.
    The mode that was the heaviest counts a little more, so that it remains the heaviest until
    another one is clearly likelier. What stands at t, pedestrians, who change their ways faster
    than that, and agents that were not observed throughout T (before a delay that is compensated,
    of up to 0.4 s) keep the new path and weights. A mode
    that now ends far from where it ended (:data:`NEWS_RADIUS`) keeps its new path.

    Args:
        tau_s: tau (s), above 0, at most :data:`LONGEST_MEMORY_S`.
    """

    def __init__(self, tau_s: float) -> None:
        self.tau_s = tau_s
        self._last: _Paths | None = None
        self._before: _Paths | None = None

    def smooth(
        self,
        window: HistoryWindow,
        agent: IndexArray,
        mean: Float64Array,
        weight: Float64Array,
        covariance: Float64Array,
        usable: BoolArray,
        dt_s: float,
        temperature: Float64Array,
    ) -> tuple[Float64Array, Float64Array]:
        """Return the smoothed paths and their weights, and remember them for the next cycle.

        A window of the same time as the last one gives the same result again.

        Args:
            window: of the agents.
            agent: [p] rows of the window that the paths are of.
            mean: [p, M, H, 4] x, y, vx, vy in the fixed frame (m, m/s), modes in the network's
                order.
            weight: [p, M] of the modes, summing to 1.
            covariance: [p, M, H, 2, 2] of the position (m^2), as the model gives it.
            usable: [p] which paths are finite; others are returned as they are and forgotten.
            dt_s: step of the horizon and of the window (s).
            temperature: [p] with which the weights will be calibrated, so that what is published
                has the factor.
        """
        if self._last is not None and self._last.stamp_ns != window.stamp_ns:
            self._before = self._last
        key = sort_keys(window.key[agent])
        smoothed, weight = self._combined(
            self._before, window, agent, key, mean, weight, covariance, usable, dt_s, temperature
        )
        kept = np.flatnonzero(usable)
        kept = kept[np.argsort(key[kept])]
        heaviest = weight[kept].argmax(axis=1)
        self._last = _Paths(window.stamp_ns, key[kept], smoothed[kept], heaviest)
        return smoothed, weight

    def _combined(
        self,
        before: _Paths | None,
        window: HistoryWindow,
        agent: IndexArray,
        key: SortKeyArray,
        mean: Float64Array,
        weight: Float64Array,
        covariance: Float64Array,
        usable: BoolArray,
        dt_s: float,
        temperature: Float64Array,
    ) -> tuple[Float64Array, Float64Array]:
        """Return the new paths and weights combined with those of the cycle before."""
        elapsed_s = 0.0 if before is None else (window.stamp_ns - before.stamp_ns) * 1e-9
        steps = int(np.ceil(elapsed_s / dt_s - 1e-6))
        horizon = mean.shape[2]
        if before is None or not 0.0 < elapsed_s <= LONGEST_CYCLE_S + 0.5 * dt_s:
            return mean, weight
        if steps >= min(window.valid.shape[1], horizon):
            return mean, weight
        row = find_sort_keys(before.key, key)
        moving = moving_vehicles(window)[agent]
        observed = _observed(window.valid, steps, dt_s)[agent]
        chosen = np.flatnonzero(usable & (row >= 0) & moving & observed)
        if not len(chosen):
            return mean, weight
        old = _shifted(before.mean[row[chosen]], elapsed_s / dt_s, dt_s)
        new = mean[chosen]
        share_5s = np.exp(-elapsed_s / self.tau_s)
        share = (share_5s * np.arange(1, horizon + 1) / horizon)[:, None]
        combined = (1.0 - share) * new + share * old
        # The share grows along the path, which moves the point as well.
        combined[..., 2:] += share_5s / (horizon * dt_s) * (old[..., :2] - new[..., :2])
        agrees = _is_near(old[:, :, -1, :2] - new[:, :, -1, :2], covariance[chosen, :, -1])
        smoothed, weighted = mean.copy(), weight.copy()
        smoothed[chosen] = np.where(agrees[..., None, None], combined, new)
        weighted[chosen, before.heaviest[row[chosen]]] *= KEEP_FACTOR ** temperature[chosen]
        weighted[chosen] /= weighted[chosen].sum(axis=1, keepdims=True)
        return smoothed, weighted


def _observed(valid: BoolArray, steps: int, dt_s: float) -> BoolArray:
    """Return [n] whether agents were observed throughout the last steps.

    Under delay compensation the window is of a later time than the newest observation, and no
    agent has a sample between the two: these steps then end before them.

    Args:
        valid: [n, T] of the window.
        steps: 1 to T - 1.
        dt_s: time of a step (s).
    """
    seen = np.asarray(valid.any(axis=0))
    late = int(seen[-2::-1].argmax())
    if late >= int(SHORTEST_GAP_S / dt_s + 1e-6):
        late = 0
    last = valid.shape[1] - 1 - late
    if steps > last:
        return np.zeros(len(valid), dtype=np.bool_)
    return np.asarray(valid[:, -1] & valid[:, last - steps : last].all(axis=1))


def _is_near(difference: Float64Array, covariance: Float64Array) -> BoolArray:
    """Return [n, M] whether differences lie within the ellipses of :data:`NEWS_RADIUS`.

    Args:
        difference: [n, M, 2] (m).
        covariance: [n, M, 2, 2] (m^2), positive definite.
    """
    solved = np.linalg.solve(covariance, difference[..., None])[..., 0]
    squared = (difference * solved).sum(axis=-1)
    return np.asarray(squared <= NEWS_RADIUS**2)


def _shifted(mean: Float64Array, shift: float, dt_s: float) -> Float64Array:
    """Return paths [n, M, H, 4] at times ``shift`` steps later, uniform beyond their end.

    Args:
        mean: [n, M, H, 4] x, y, vx, vy (m, m/s).
        shift: 0 to H - 1.
        dt_s: time of a step (s).
    """
    horizon = mean.shape[2]
    place = np.arange(horizon) + shift
    low = np.minimum(np.floor(place).astype(np.intp), horizon - 1)
    high = np.minimum(low + 1, horizon - 1)
    part = (place - low)[:, None]
    inside = (1.0 - part) * mean[:, :, low] + part * mean[:, :, high]
    beyond = np.maximum(place - (horizon - 1), 0.0)
    if not beyond.any():
        return inside
    end = mean[:, :, -1:]
    uniform = np.concatenate(
        [
            end[..., :2] + beyond[:, None] * dt_s * end[..., 2:],
            np.broadcast_to(end[..., 2:], (*mean.shape[:3], 2)),
        ],
        axis=-1,
    )
    return np.where((beyond > 0.0)[:, None], uniform, inside)
