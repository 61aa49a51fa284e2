# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Scores of the last minutes, by class group, motion and time ahead."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.quality.metrics import MISS_THRESHOLD_M, TIMES_S, is_inside, mahalanobis, nll
from mtpgo_core.quality.outcomes import Outcomes
from mtpgo_core.quality.quality_report import SCORES, WINDOWS_S, QualityReport
from mtpgo_core.schema import Float64Array, IndexArray, Source
from mtpgo_core.task.calibration import GROUPS

BUCKET_S = 5
"""Scores are summed over spans of this length, which enter and leave the windows as a whole (s);
chosen: a twelfth of the shortest window."""

_BUCKET_NS = BUCKET_S * 10**9
_LONGEST_NS = (WINDOWS_S[-1] + BUCKET_S) * 10**9
"""Most time that passes with one observation (ns): it empties all windows. More would add up
beyond 64 bits where a clock is set forward and back again and again."""

_SERIES = len(GROUPS) * len(TIMES_S)
"""Sums are kept for each group and time ahead: series g * T + t."""

_SLACK_S = 1e-6
"""Rounding of times in messages, which are float32 (s)."""


class RollingScores:
    """Sums of scores in spans of ``BUCKET_S``, for windows of 1, 5 and 30 minutes.

    A prediction counts at the time that it predicts: the window of one minute holds what was
    predicted for this minute. All times are those of the observations; if their clock is set back,
    the windows continue without a gap.

    Args:
        dt_s: horizon step (s). The step nearest to a time of ``TIMES_S`` counts as that time.
    """

    def __init__(self, dt_s: float) -> None:
        self._dt_s = dt_s
        self._buckets = WINDOWS_S[-1] // BUCKET_S
        columns = 2 * len(SCORES) + 2  # sums and numbers of the scores; predictions, by the model
        self._sums = np.zeros((self._buckets, _SERIES, columns))
        self._now_ns: int | None = None
        self._offset_ns = 0  # from the observations' clock to one that is never set
        self._bucket = 0
        # Road users by series: track number times the number of series, plus series; ascending.
        self._seen: NDArray[np.int64] = np.empty(0, dtype=np.int64)
        self._seen_bucket: NDArray[np.int64] = np.empty(0, dtype=np.int64)

    @property
    def bytes(self) -> int:
        """Size of all arrays (bytes)."""
        return self._sums.nbytes + self._seen.nbytes + self._seen_bucket.nbytes

    def update(self, outcomes: Outcomes) -> None:
        """Add outcomes."""
        self._advance(outcomes.now_ns)
        if not len(outcomes):
            return
        rows, time = self._at_times(outcomes.time_s)
        if not len(rows):
            return
        outcomes = outcomes.select(rows)
        values = _values(outcomes)
        known, observed = np.isfinite(values), outcomes.known
        by_model = observed & (outcomes.source == Source.MODEL)
        columns = np.concatenate(
            [np.where(known, values, 0.0), known, observed[:, None], by_model[:, None]], axis=1
        )
        series = outcomes.group.astype(np.int64) * len(TIMES_S) + time
        due_ns = outcomes.stamp_ns + np.rint(1e9 * outcomes.time_s).astype(np.int64)
        # A truth may be up to a microsecond early: its time may lie in the span that comes next.
        bucket = np.minimum((due_ns + self._offset_ns) // _BUCKET_NS, self._bucket)
        for one in np.unique(bucket).tolist():
            if one > self._bucket - self._buckets:
                mine = bucket == one
                member = series[mine] == np.arange(_SERIES)[:, None]
                self._sums[one % self._buckets] += member.astype(np.float64) @ columns[mine]
        self._see(outcomes.track[observed] * _SERIES + series[observed], bucket[observed])

    def report(self, unknown: Mapping[str, int]) -> QualityReport:
        """Return the scores of all windows.

        Args:
            unknown: number of steps without a truth by cause, since the start.
        """
        shape = (len(WINDOWS_S), len(GROUPS), len(TIMES_S))
        sums = np.empty((len(WINDOWS_S), *self._sums.shape[1:]))
        agents = np.empty((len(WINDOWS_S), _SERIES), dtype=np.int64)
        for w, window_s in enumerate(WINDOWS_S):
            recent = np.arange(self._bucket - window_s // BUCKET_S + 1, self._bucket + 1)
            sums[w] = self._sums[recent % self._buckets].sum(axis=0)
            present = self._seen[self._seen_bucket >= recent[0]]
            agents[w] = np.bincount(present % _SERIES, minlength=_SERIES)
        total, number = sums[..., : len(SCORES)], sums[..., len(SCORES) : -2]
        with np.errstate(invalid="ignore"):
            scores = np.where(number > 0, total / np.maximum(number, 1), np.nan)
        return QualityReport(
            now_ns=self._now_ns or 0,
            scores=scores.reshape(*shape, len(SCORES)),
            agents=agents.reshape(shape),
            predictions=sums[..., -2].astype(np.int64).reshape(shape),
            by_model=sums[..., -1].astype(np.int64).reshape(shape),
            unknown=dict(unknown),
        )

    def _advance(self, now_ns: int) -> None:
        """Go on to a time (ns): empty the spans since the last one."""
        if self._now_ns is not None:
            passed_ns = now_ns - self._now_ns
            self._offset_ns += min(max(passed_ns, 0), _LONGEST_NS) - passed_ns
        first = self._now_ns is None
        self._now_ns = now_ns
        bucket = (now_ns + self._offset_ns) // _BUCKET_NS
        passed = min(bucket - self._bucket, self._buckets)
        self._bucket = bucket
        if first or passed <= 0:
            return
        self._sums[np.arange(bucket - passed + 1, bucket + 1) % self._buckets] = 0.0
        kept = self._seen_bucket > bucket - self._buckets
        self._seen, self._seen_bucket = self._seen[kept], self._seen_bucket[kept]

    def _at_times(self, time_s: Float64Array) -> tuple[IndexArray, IndexArray]:
        """Return rows whose step is the one at a time of ``TIMES_S``, and the index of that."""
        after_s = time_s[:, None] - np.array(TIMES_S, dtype=np.float64)
        half_s = 0.5 * self._dt_s
        row, time = np.nonzero((after_s > _SLACK_S - half_s) & (after_s <= _SLACK_S + half_s))
        return row, time

    def _see(self, codes: NDArray[np.int64], bucket: NDArray[np.int64]) -> None:
        """Note road users in series, and the last span that each was seen in."""
        order = np.lexsort((-bucket, codes))
        codes, first = np.unique(codes[order], return_index=True)
        bucket = bucket[order][first]
        place = np.searchsorted(self._seen, codes)
        old = np.zeros(len(codes), dtype=np.bool_)
        inside = place < len(self._seen)
        old[inside] = self._seen[place[inside]] == codes[inside]
        self._seen_bucket[place[old]] = np.maximum(self._seen_bucket[place[old]], bucket[old])
        self._seen = np.insert(self._seen, place[~old], codes[~old])
        self._seen_bucket = np.insert(self._seen_bucket, place[~old], bucket[~old])


def _values(outcomes: Outcomes) -> Float64Array:
    """Return [m, scores] of outcomes, NaN where not defined."""
    known = outcomes.known
    apart = outcomes.truth - outcomes.heaviest_mean
    distance = np.hypot(apart[:, 0], apart[:, 1])
    squared, _ = mahalanobis(apart, outcomes.heaviest_covariance)
    factor = outcomes.sigma_factor_50
    weight, mean, covariance = outcomes.mixture()
    likelihood = nll(mean[:, :, None], weight, covariance[:, :, None], outcomes.truth[:, None])
    columns = {
        "ade": outcomes.ade,
        "fde": distance,
        "miss_rate": np.where(known, distance > MISS_THRESHOLD_M, np.nan),
        "nll": likelihood[:, 0],
        "coverage_50": np.where(known, is_inside(squared, 0.5, factor), np.nan),
        "coverage_90": np.where(known, is_inside(squared, 0.9, factor), np.nan),
        "cv_ade": outcomes.cv_ade,
    }
    return np.stack([columns[name] for name in SCORES], axis=1)
