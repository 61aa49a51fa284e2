# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What a calibration brings: coverage, sharpness, likelihood and mode weights, before and after.

Averages are over sites, each of which counts the same, and within a site over its predictions,
unless they are said to be of all road users.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.quality.metrics import (
    MOVING_COVERAGE_KEY,
    SITES_COVERAGE_KEY,
    Array,
    average,
    is_inside,
)
from mtpgo_core.schema import BoolArray
from mtpgo_core.task.calibration import GROUPS, is_moving
from mtpgo_training.calibration.calibration_fit import LEVEL, LEVEL_50, TIE_M, fit_calibration
from mtpgo_training.calibration.calibration_samples import CalibrationSamples, merge_samples
from mtpgo_training.calibration.calibration_text import is_moving_score
from mtpgo_training.evaluation.honesty.mode_weights import (
    brier_score,
    heaviest_is_nearest,
    nearest,
)
from mtpgo_training.evaluation.scores.score_table import none
from mtpgo_training.table_format import Row, Table


@dataclass(frozen=True)
class CalibrationScores:
    """Scores of some predictions; NaN where nothing is known.

    Attributes:
        agents: predictions of which at least one step is known.
        times_s: times ahead of the next four (s): those of ``TIMES_S`` at which there is a step,
            else the end of the horizon.
        known: predictions that are known at each time.
        coverage: share of the truths inside the heaviest mode's 90 % ellipse.
        coverage_of_all: the same, every prediction counting the same whatever its site.
        coverage_50: share of the truths inside the heaviest mode's 50 % ellipse.
        sigma_m: standard deviation of the heaviest mode, the fourth root of its determinant (m).
        nll: negative log-likelihood of the truth under the mixture (nats).
        brier: squared difference of weights and nearest mode, summed over the modes.
        cross_entropy: negative log weight of the nearest mode (nats).
        heaviest_nearest: share in which the heaviest mode is the nearest, ties shared.
    """

    agents: int
    times_s: tuple[float, ...]
    known: tuple[int, ...]
    coverage: tuple[float, ...]
    coverage_of_all: tuple[float, ...]
    coverage_50: tuple[float, ...]
    sigma_m: tuple[float, ...]
    nll: tuple[float, ...]
    brier: float
    cross_entropy: float
    heaviest_nearest: float


def score_samples(samples: CalibrationSamples) -> CalibrationScores:
    """Score predictions; calibrate the samples first to score what that brings."""
    known, coverage, of_all, coverage_50, sigma = [], [], [], [], []
    for step in samples.steps.values():
        there = np.isfinite(samples.distance[:, step])
        distance, site = samples.distance[there, step].astype(np.float64), samples.site[there]
        inside = is_inside(distance, LEVEL).astype(float)
        half = is_inside(distance, LEVEL_50, samples.sigma_factor_50[there, step]).astype(float)
        known.append(int(there.sum()))
        coverage.append(_mean(inside, site))
        of_all.append(average(inside))
        coverage_50.append(_mean(half, site))
        log_determinant = samples.log_determinant[there, step].astype(np.float64)
        sigma.append(_mean(np.exp(0.25 * log_determinant), site))
    whole = np.isfinite(samples.mode_error).all(axis=1)
    site, log_weight = samples.site[whole], samples.log_weight[whole].astype(np.float64)
    target = nearest(samples.mode_error[whole], TIE_M) if whole.any() else log_weight
    finite = np.maximum(log_weight, np.finfo(np.float32).min)  # a weight of 0 that is not nearest
    return CalibrationScores(
        agents=int(np.isfinite(samples.distance).any(axis=1).sum()),
        times_s=tuple(samples.steps),
        known=tuple(known),
        coverage=tuple(coverage),
        coverage_of_all=tuple(of_all),
        coverage_50=tuple(coverage_50),
        sigma_m=tuple(sigma),
        nll=tuple(_known_mean(values, samples.site) for values in samples.nll.T),
        brier=_mean(brier_score(np.exp(log_weight), target), site),
        cross_entropy=_mean(-(target * finite).sum(axis=1), site),
        heaviest_nearest=_mean(heaviest_is_nearest(log_weight, target), site),
    )


def moving_scores(samples: CalibrationSamples) -> dict[str, float | int | None]:
    """Return the coverage of moving road users as it is stored with a model.

    Returns:
        ``moving_n``, the number of predictions that are known at the last of the times,
        ``coverage_90_moving_1s`` and so on, the share of all of them inside the 90 % ellipse after
        1 s, and ``sites_coverage_90_moving_1s`` and so on, the mean of the shares of the sites.
    """
    scores = score_samples(samples.select(is_moving(samples.group)))
    named = {
        key.format(time_s): none(share)
        for key, shares in (
            (MOVING_COVERAGE_KEY, scores.coverage_of_all),
            (SITES_COVERAGE_KEY, scores.coverage),
        )
        for time_s, share in zip(scores.times_s, shares, strict=True)
    }
    return {"moving_n": scores.known[-1], **named}


def with_moving_scores(scores: Mapping[str, Any], samples: CalibrationSamples) -> dict[str, Any]:
    """Return the scores of a model with :func:`moving_scores` in place of any that they have."""
    others = {key: value for key, value in scores.items() if not is_moving_score(key)}
    return others | moving_scores(samples)


def leave_one_site_out(samples: CalibrationSamples) -> CalibrationSamples:
    """Return the same samples, those of each site calibrated by a fit to all other sites.

    Raises:
        ConfigurationError: all samples are of one site.
    """
    present = [name for i, name in enumerate(samples.sites) if (samples.site == i).any()]
    if len(present) < 2:
        raise ConfigurationError(
            f"the samples are of {len(present)} site(s), expected at least two to leave one out"
        )
    parts, rows = [], []
    for name in present:
        fitted = fit_calibration(samples.without_site(name))
        parts.append(samples.of_site(name).calibrated(fitted))
        rows.append(np.flatnonzero(samples.site == samples.sites.index(name)))
    return merge_samples(parts).select(np.argsort(np.concatenate(rows)))


def calibration_table(before: CalibrationSamples, after: CalibrationSamples) -> Table:
    """Return a row for each group, and for the moving road users of each site, in both.

    Args:
        before: without the calibration.
        after: the same predictions in the same order, calibrated.
    """
    rows = []
    for name, chosen in _parts(before):
        if chosen.any():
            scores = (score_samples(samples.select(chosen)) for samples in (before, after))
            rows.append(Row(name, _cells(*scores)))
    times = [f"{time_s:g} s" for time_s in score_samples(before).times_s]
    heads = [
        *(f"in 90% at {time}" for time in times),
        *(f"in 50% at {time}" for time in times),
        f"sigma m {times[-1]}",
        *(f"NLL {time}" for time in times),
    ]
    return Table(["before > after", "agents", *heads, "Brier"], rows)


def _parts(samples: CalibrationSamples) -> Iterable[tuple[str, BoolArray]]:
    """Yield the name and the agents of each row of the table."""
    moves = is_moving(samples.group)
    yield "moving", moves
    yield "standing", ~moves
    for index, name in enumerate(GROUPS):
        yield name, samples.group == index
    for index, name in enumerate(samples.sites):
        yield f"moving, {name}", moves & (samples.site == index)


def _cells(before: CalibrationScores, after: CalibrationScores) -> list[str]:
    pairs = [
        *zip(before.coverage, after.coverage, strict=True),
        *zip(before.coverage_50, after.coverage_50, strict=True),
        (before.sigma_m[-1], after.sigma_m[-1]),
        *zip(before.nll, after.nll, strict=True),
        (before.brier, after.brier),
    ]
    return [str(before.agents), *(f"{_text(one)} > {_text(other)}" for one, other in pairs)]


def _text(value: float) -> str:
    return "-" if np.isnan(value) else f"{value:.3f}"


def _known_mean(values: Array, site: np.ndarray) -> float:
    """Return the mean over the sites of what is known of each."""
    known = np.isfinite(values)
    return _mean(values[known], site[known])


def _mean(values: Array, site: np.ndarray) -> float:
    """Return the mean over the sites of the mean of each, NaN without agents."""
    if not len(values):
        return float("nan")
    counts = np.bincount(site)
    there = counts > 0
    return float((np.bincount(site, weights=values)[there] / counts[there]).mean())
