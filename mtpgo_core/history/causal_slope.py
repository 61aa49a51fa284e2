# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Causal derivatives of irregularly sampled signals, for all tracks at once.

See docs/design.md, decision 13.

The slope of a signal is the slope of the straight line fitted to its past by least squares, in
which a sample of age ``a`` has the weight ``exp(-2 a / tau)``. Such a fit needs no equidistant
samples, averages noise over more samples the faster they arrive, is exact on a straight line, and
lags behind a steadily changing slope by ``tau``. All sums of the fit are kept relative to the
newest sample, so they neither grow nor cancel, and the cost of a step does not depend on the past.

The same class is used when a recording is read for training and when the node receives a message.
"""

from __future__ import annotations

import numpy as np

from mtpgo_core.schema import Float64Array, IndexArray

_MIN_AGE_S = 0.03
"""Without a prior, a slope is returned once the samples span this time (s): the difference of two
samples closer together would be noise divided by almost zero. Chosen: less than one period at
25 Hz."""


class CausalSlope:
    """Slopes of many two-dimensional signals, each sampled at its own times.

    Args:
        capacity: number of signals.
        tau_s: lag of the estimate (s); 0 takes the difference of the last two samples.
        prior_s2: strength of the prior "slope zero" (s^2): the spread of sample times that carries
            as much evidence, (noise of the signal / expected slope)^2. With 0 there is no prior,
            and the slope is NaN until the samples span about 0.03 s.
    """

    def __init__(self, capacity: int, tau_s: float, prior_s2: float = 0.0) -> None:
        self._tau_s = tau_s
        self._prior_s2 = prior_s2
        self._sums = np.zeros((capacity, 7))  # w, w t, w t^2, w x (2), w t x (2)
        self._age_s = np.zeros(capacity)  # since the first sample
        self._reference = np.zeros((capacity, 2))

    def grow(self, capacity: int) -> None:
        """Make room for ``capacity`` signals, keeping the existing ones."""
        extra = capacity - self._sums.shape[0]
        self._sums = np.concatenate([self._sums, np.zeros((extra, 7))])
        self._age_s = np.concatenate([self._age_s, np.zeros(extra)])
        self._reference = np.concatenate([self._reference, np.zeros((extra, 2))])

    def reset(self, slot: IndexArray) -> None:
        """Forget the past of the signals ``slot``."""
        self._sums[slot] = 0.0

    def step(self, slot: IndexArray, dt_s: Float64Array, value: Float64Array) -> Float64Array:
        """Add one sample to each signal ``slot`` and return the current slopes.

        Args:
            slot: [n] which signals, each at most once.
            dt_s: [n] time since the signal's last step (s); ignored after a reset.
            value: [n, 2] the samples, NaN where there is none.

        Returns:
            [n, 2] slopes (unit of the value per second), NaN where not yet known.
        """
        sums = self._sums[slot]
        age_s = np.where(sums[:, 0] > 0.0, self._age_s[slot] + dt_s, 0.0)
        self._age_s[slot] = age_s
        if self._tau_s > 0.0:
            sums = np.exp(-2.0 / self._tau_s * dt_s)[:, None] * sums
        else:
            # Of two samples the newest stays, at age 0; a single one keeps its age.
            sums = np.where(sums[:, :1] > 1.0, (np.arange(7) == 0).astype(np.float64), sums)
        # The newest sample moves from age 0 to age dt: t -> t - dt in every sum.
        sums[:, 2] += dt_s * (dt_s * sums[:, 0] - 2.0 * sums[:, 1])
        sums[:, 1] -= dt_s * sums[:, 0]
        sums[:, 5:7] -= dt_s[:, None] * sums[:, 3:5]
        # Values count from the newest one, so the newest adds to the sum of weights only.
        known = np.asarray(np.isfinite(value).all(axis=1))
        reference = self._reference[slot]
        change = np.where(known[:, None], value - reference, 0.0)
        sums[:, 3:5] -= change * sums[:, 0:1]
        sums[:, 5:7] -= change * sums[:, 1:2]
        sums[:, 0] += known
        self._sums[slot] = sums
        self._reference[slot] = np.where(known[:, None], value, reference)

        weight = np.maximum(sums[:, 0], 1e-12)
        spread = np.maximum(sums[:, 2] - sums[:, 1] ** 2 / weight, 0.0)
        evidence = sums[:, 5:7] - (sums[:, 1] / weight)[:, None] * sums[:, 3:5]
        if self._prior_s2 > 0.0:
            usable = sums[:, 0] > 0.0
        else:
            usable = (age_s >= _MIN_AGE_S) & (spread > 0.0)
        scale = np.where(usable, np.maximum(spread + self._prior_s2, 1e-300), np.nan)
        return evidence / scale[:, None]
