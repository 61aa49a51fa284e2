# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""95 % confidence intervals: over recordings by the bootstrap, over seeds by Student's t.

Road users of one recording share its traffic, and instants 0.2 s apart are nearly the same scene,
so single predictions are far from independent. The recordings are the sample, and the bootstrap
resamples them.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mtpgo_training.evaluation.scores.agent_scores import KEYS
from mtpgo_training.evaluation.scores.score_table import HEADLINE_TIMES_S, Averages, none

Array = NDArray[np.float64]
Interval = tuple[float, float]

DRAWS = 2000
"""Bootstrap samples; chosen: with another seed, the ends of an interval of a normal
distribution then move by 1.5 % of its width (standard deviation)."""

LEVEL = 0.95
"""Probability of the intervals."""

SEED = 0
"""Seed of the bootstrap samples: the same results give the same intervals."""

_SEED = re.compile(r"(?P<recipe>.+?)[-_.]?seed[-_]?(?P<seed>\d+)$")


def resampling_counts(recordings: int, seed: int = SEED) -> Array | None:
    """[DRAWS, recordings] how often each sample has each recording, None if there is only one.

    The same number of recordings gives the same draws, so that the intervals of differences and
    ratios of models are those of pairs.
    """
    if recordings < 2:
        return None
    share = np.full(recordings, 1.0 / recordings)
    counts = np.random.default_rng(seed).multinomial(recordings, share, size=DRAWS)
    return counts.astype(np.float64)


def pooled(sums: Array, counts: Array) -> Array:
    """[...] averages over all recordings, from sums and counts [R, ...]; NaN without agents."""
    return _ratio(sums.sum(axis=0), counts.sum(axis=0))


def bootstrap(sums: Array, counts: Array, drawn: Array | None) -> tuple[Array, Array]:
    """Return lower and upper end [...] of the interval of :func:`pooled`.

    NaN where none can be given: with fewer than two recordings that count.

    Args:
        sums: [R, ...] of each recording.
        counts: [R, ...] over how many each sum is.
        drawn: from :func:`resampling_counts`.
    """
    possible = (counts > 0).sum(axis=0) >= 2
    if drawn is None or not possible.any():
        return np.full(sums.shape[1:], np.nan), np.full(sums.shape[1:], np.nan)
    values = _ratio(np.tensordot(drawn, sums, 1), np.tensordot(drawn, counts, 1))
    return _ends(values, possible)


def bootstrap_ratio(
    sums: Array, counts: Array, other_sums: Array, other_counts: Array, drawn: Array | None
) -> Interval:
    """Return the interval of the ratio of averages over the same recordings; arguments [R]."""
    possible = np.asarray(((counts > 0) & (other_counts > 0)).sum() >= 2)
    if drawn is None or not possible:
        return float("nan"), float("nan")
    own = _ratio(drawn @ sums, drawn @ counts)
    other = _ratio(drawn @ other_sums, drawn @ other_counts)
    low, high = _ends(_ratio(own, other), possible)
    return float(low), float(high)


def over_seeds(values: Sequence[float]) -> tuple[float, float, float]:
    """Return mean and ends of its interval over trainings that differ only in their seed.

    The ends are NaN for a single one.
    """
    given = np.asarray(values, dtype=np.float64)
    mean, n = float(given.mean()), len(given)
    if n < 2:
        return mean, float("nan"), float("nan")
    from scipy import stats  # only here: it takes more than a second to load

    quantile = float(stats.t.ppf(0.5 + 0.5 * LEVEL, n - 1))
    half = quantile * float(given.std(ddof=1)) / float(np.sqrt(n))
    return mean, mean - half, mean + half


def over_groups(models: Averages, groups: Mapping[str, Sequence[str]]) -> dict[str, Any]:
    """Return by group its ``models``, and by protocol each value's ``mean``, ``low``, ``high``."""
    content: dict[str, Any] = {}
    for group, names in groups.items():
        content[group] = {"models": list(names)}
        for protocol in models[names[0]]:
            row: dict[str, Any] = {}
            for key in (*KEYS, *HEADLINE_TIMES_S):
                values = [models[name][protocol].get(key) for name in names]
                given = [value for value in values if value is not None]
                if len(given) == len(values):
                    mean, low, high = over_seeds(given)
                    row[key] = {"mean": mean, "low": none(low), "high": none(high)}
            content[group][protocol] = row
    return content


def seed_groups(models: Sequence[str], all_together: bool = False) -> dict[str, list[str]]:
    """Return models of one recipe that differ in their seed: ``x-seed1``, ``x-seed2`` make ``x``.

    Args:
        models: names.
        all_together: all of them are of one recipe, whatever their names.
    """
    if all_together:
        return {"seeds": list(models)}
    groups: dict[str, list[str]] = {}
    for name in models:
        found = _SEED.match(name)
        if found:
            groups.setdefault(found["recipe"], []).append(name)
    return {recipe: names for recipe, names in groups.items() if len(names) > 1}


def _ends(values: Array, possible: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Ends [...] of the middle of the draws [DRAWS, ...], of those that have a value."""
    tail = 50.0 * (1.0 - LEVEL)
    given = np.where(possible, values, 0.0)
    low, high = np.nanpercentile(given, [tail, 100.0 - tail], axis=0)
    return np.where(possible, low, np.nan), np.where(possible, high, np.nan)


def _ratio(top: Array, bottom: Array) -> Array:
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.where(bottom != 0.0, top / bottom, np.nan), dtype=np.float64)
