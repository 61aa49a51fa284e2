# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""95 % confidence intervals: over recordings by the bootstrap, over seeds by Student's t.

Road users of one recording share its traffic, and instants 0.2 s apart are nearly the same scene,
so single predictions are far from independent. The recordings are what was drawn, and what the
bootstrap draws again.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Interval = tuple[float, float]

DRAWS = 2000
LEVEL = 0.95
SEED = 0

_T_975 = (
    12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228,
    2.201, 2.179, 2.160, 2.145, 2.131, 2.120, 2.110, 2.101, 2.093, 2.086,
)  # fmt: skip
"""0.975 quantile of Student's t with 1, 2, ... degrees of freedom."""


def draws(recordings: int, seed: int = SEED) -> Array | None:
    """[DRAWS, recordings] how often each recording was drawn, None where there is but one.

    The same number of recordings gives the same draws, so that the intervals of differences and
    ratios of models are those of pairs.
    """
    if recordings < 2:
        return None
    share = np.full(recordings, 1.0 / recordings)
    counts = np.random.default_rng(seed).multinomial(recordings, share, size=DRAWS)
    return counts.astype(np.float64)


def pooled(sums: Array, counts: Array) -> Array:
    """[...] averages over all recordings, from sums and counts [R, ...]; NaN where none counts."""
    return _ratio(sums.sum(axis=0), counts.sum(axis=0))


def bootstrap(sums: Array, counts: Array, drawn: Array | None) -> tuple[Array, Array]:
    """Lower and upper end [...] of the interval of :func:`pooled`.

    NaN where none can be given: with fewer than two recordings that count.

    Args:
        sums: [R, ...] of each recording.
        counts: [R, ...] over how many each sum is.
        drawn: from :func:`draws`.
    """
    possible = (counts > 0).sum(axis=0) >= 2
    if drawn is None or not possible.any():
        return np.full(sums.shape[1:], np.nan), np.full(sums.shape[1:], np.nan)
    values = _ratio(np.tensordot(drawn, sums, 1), np.tensordot(drawn, counts, 1))
    return _ends(values, possible)


def bootstrap_ratio(
    sums: Array, counts: Array, other_sums: Array, other_counts: Array, drawn: Array | None
) -> Interval:
    """Interval of the ratio of two averages over the same recordings; each argument [R]."""
    possible = np.asarray(((counts > 0) & (other_counts > 0)).sum() >= 2)
    if drawn is None or not possible:
        return float("nan"), float("nan")
    own = _ratio(drawn @ sums, drawn @ counts)
    other = _ratio(drawn @ other_sums, drawn @ other_counts)
    low, high = _ends(_ratio(own, other), possible)
    return float(low), float(high)


def over_seeds(values: Sequence[float]) -> tuple[float, float, float]:
    """Mean and ends of its interval over trainings that differ in their seed alone.

    NaN ends for a single one.
    """
    given = np.asarray(values, dtype=np.float64)
    mean, n = float(given.mean()), len(given)
    if n < 2:
        return mean, float("nan"), float("nan")
    quantile = _T_975[n - 2] if n - 2 < len(_T_975) else 1.96 + 2.4 / (n - 1)
    half = quantile * float(given.std(ddof=1)) / float(np.sqrt(n))
    return mean, mean - half, mean + half


def _ends(values: Array, possible: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Ends [...] of the middle of the draws [DRAWS, ...], of those that have a value."""
    tail = 50.0 * (1.0 - LEVEL)
    given = np.where(possible, values, 0.0)
    low, high = np.nanpercentile(given, [tail, 100.0 - tail], axis=0)
    return np.where(possible, low, np.nan), np.where(possible, high, np.nan)


def _ratio(top: Array, bottom: Array) -> Array:
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.where(bottom != 0.0, top / bottom, np.nan), dtype=np.float64)
