# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Which predictor has been better for a group of road users, with hysteresis."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.live_calibration.live_options import LiveOptions
from mtpgo_core.schema import BoolArray, Float64Array, IndexArray
from mtpgo_core.task.calibration import GROUPS

MARGIN = 0.02
"""By which share the other predictor's displacement error must be smaller before it takes over;
chosen: below the difference that a few road users make."""

LEAST_M = 0.01
"""By how much it must be smaller (m); chosen: less than a tracker knows, as of road users that
stand or whom both predict alike."""


class ModelPreference:
    """Compares the displacement errors of model and constant velocity, group by group.

    Both are averaged over all steps of the horizon that have become known, with exponential
    forgetting over ``prefer_time_s``. Constant velocity is preferred once it has been better by
    :data:`MARGIN` and :data:`LEAST_M` for ``prefer_time_s`` without a break, with at least
    ``prefer_agents`` road users in that time, and until the model has been better for as long.

    Args:
        options: time and number; may be replaced.

    Attributes:
        error_m: [groups, 2] average error of model and constant velocity (m), NaN where nothing
            is known.
        constant_velocity: [groups] whether constant velocity is preferred.
    """

    def __init__(self, options: LiveOptions) -> None:
        self.options = options
        groups = len(GROUPS)
        self._sum = np.zeros((groups, 2))
        self._weight = np.zeros(groups)
        self._better_s = np.zeros(groups)
        self._seen_s: list[dict[int, float]] = [{} for _ in range(groups)]
        self._now_s = 0.0
        self.constant_velocity: BoolArray = np.zeros(groups, dtype=np.bool_)

    @property
    def error_m(self) -> Float64Array:
        """[groups, 2], see the class."""
        weight = self._weight[:, None]
        return np.divide(self._sum, weight, out=np.full_like(self._sum, np.nan), where=weight > 0)

    @property
    def agents(self) -> NDArray[np.int64]:
        """[groups] road users of which something became known within ``prefer_time_s``."""
        return np.array([len(seen) for seen in self._seen_s])

    def update(
        self,
        seconds: float,
        track: NDArray[np.int64],
        group: IndexArray,
        error_m: Float64Array,
    ) -> None:
        """Add what became known.

        Args:
            seconds: time since the last call (s).
            track: [m] numbers of tracks.
            group: [m] positions in :data:`~mtpgo_core.task.calibration.GROUPS`.
            error_m: [m, 2] distance of model and constant velocity from the truth (m); rows of
                which one is not known do not count.
        """
        self._now_s += seconds
        decay = math.exp(-seconds / self.options.prefer_time_s)
        self._sum *= decay
        self._weight *= decay
        both = np.isfinite(error_m).all(axis=1)
        group, track, error_m = group[both], track[both], error_m[both]
        np.add.at(self._sum, group, error_m)
        self._weight += np.bincount(group, minlength=len(GROUPS))
        for one, number in set(zip(group.tolist(), track.tolist(), strict=True)):
            self._seen_s[one][number] = self._now_s
        oldest_s = self._now_s - self.options.prefer_time_s
        for index, seen in enumerate(self._seen_s):
            if seen and min(seen.values()) < oldest_s:
                self._seen_s[index] = {k: v for k, v in seen.items() if v >= oldest_s}
        self._decide(seconds)

    def _decide(self, seconds: float) -> None:
        """Change the preference where the other predictor has been better for long enough."""
        served = self.constant_velocity.astype(np.intp)
        rows = np.arange(len(GROUPS))
        present = self._sum[rows, served]
        margin = np.maximum(MARGIN * present, LEAST_M * self._weight)
        other_better = self._sum[rows, 1 - served] < present - margin
        other_better &= self.agents >= self.options.prefer_agents
        self._better_s = np.where(other_better, self._better_s + seconds, 0.0)
        change = self._better_s >= self.options.prefer_time_s
        self.constant_velocity = self.constant_velocity ^ change
        self._better_s[change] = 0.0
