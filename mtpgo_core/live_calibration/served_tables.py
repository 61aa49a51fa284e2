# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The factors that were applied to each served prediction, and how they are applied."""

from __future__ import annotations

import dataclasses
from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.schema import BoolArray, CalibrationStage, Float64Array, Prediction, Source
from mtpgo_core.task.calibration import GROUPS, SIGMA_FACTOR_50_LIMITS, GroupArray

_KEPT = 64
"""Tables kept: more predictions than the memory of outcomes holds."""

LIGHT_SHARE = 0.5
"""Share of the logarithm of a factor by which the other modes are widened or narrowed: what misses
and hits is the heaviest mode, which tells less of them. docs/design.md ("Live calibration") has
the figures."""

_SHORTEST_SPAN_S = 0.35
"""Predictions that come sooner are not learned from (s); chosen below two cycles of 5 Hz: an error
lasts for seconds, so with half of the predictions the factors were the same (measured), at half
the cost."""

_LARGEST_RATIO_50 = SIGMA_FACTOR_50_LIMITS[1]

_LONGEST_SPAN_S = 1.0
"""Most time that one prediction stands for (s); chosen: after a pause of the input, no more."""


@dataclass(frozen=True)
class ServedTable:
    """The factors that were in force when a prediction was served.

    Attributes:
        stamp_ns: of the prediction (ns).
        span_s: time since the previous prediction, for which this one counts (s).
        log_sigma: [SOURCES, LEVELS, groups, H], see
            :class:`~mtpgo_core.live_calibration.sigma_tracker.SigmaTracker`.
        log_shipped_50: [groups, H] logarithms of the factors for the 50 % ellipses of the model's
            file, on which those of the tracker come.
    """

    stamp_ns: int
    span_s: float
    log_sigma: Float64Array
    log_shipped_50: Float64Array


class ServedTables:
    """The latest tables, by the stamps of their predictions."""

    def __init__(self) -> None:
        self._tables: deque[ServedTable] = deque(maxlen=_KEPT)

    def clear(self) -> None:
        """Forget all."""
        self._tables.clear()

    def add(
        self,
        stamp_ns: int,
        log_sigma: Float64Array,
        log_shipped_50: Float64Array,
        spacing_s: float = 0.0,
    ) -> float:
        """Keep the table of a prediction; return for how long it counts (s).

        That is 0 for one whose outcome shall not be learned from.

        Args:
            stamp_ns: of the prediction (ns).
            log_sigma: see :class:`ServedTable`.
            log_shipped_50: see there.
            spacing_s: the memory of outcomes keeps no prediction that comes sooner after the last
                one (s): long horizons. One that is not learned from must not stand for any time.
        """
        last = self._tables[-1] if self._tables else None
        longest_s = max(_LONGEST_SPAN_S, 2.0 * spacing_s)
        span_s = longest_s if last is None else (stamp_ns - last.stamp_ns) * 1e-9
        if span_s < 0.0:
            self.clear()
            span_s = longest_s
        if span_s < max(_SHORTEST_SPAN_S, spacing_s):
            return 0.0
        span_s = min(span_s, longest_s)
        self._tables.append(ServedTable(stamp_ns, span_s, log_sigma, log_shipped_50))
        return span_s

    def find(self, stamp_ns: NDArray[np.int64]) -> tuple[NDArray[np.intp], list[ServedTable]]:
        """Return the tables of predictions.

        Args:
            stamp_ns: [m] of predictions (ns).

        Returns:
            [m] position in the list of tables that follows, -1 where it is not kept any more.
        """
        tables = {table.stamp_ns: index for index, table in enumerate(self._tables)}
        stamps, inverse = np.unique(stamp_ns, return_inverse=True)
        index = np.array([tables.get(int(stamp), -1) for stamp in stamps], dtype=np.intp)
        return index[inverse], list(self._tables)


def apply_factors(
    prediction: Prediction, group: GroupArray, log_sigma: Float64Array
) -> Prediction:
    """Return a prediction with its covariances and 50 % ellipses corrected.

    The ellipses of no mode shrink along the horizon: where factors fall faster than covariances
    grow, the size of the step before is kept.

    Args:
        prediction: with the shipped calibration.
        group: [n] positions in :data:`~mtpgo_core.task.calibration.GROUPS`.
        log_sigma: [SOURCES, LEVELS, groups, H].
    """
    if not len(prediction):
        return prediction
    source = np.minimum(prediction.source, Source.CONSTANT_VELOCITY)
    half, most = np.moveaxis(log_sigma[source, :, group], 1, 0)
    factor = np.repeat(most[:, None], prediction.weight.shape[1], axis=1)  # [n, M, H]
    factor[:, 1:] *= LIGHT_SHARE
    size = _log_size(prediction.covariance)
    grown = np.maximum.accumulate(factor + size, axis=2) - size
    grown = np.where(np.isfinite(grown), grown, factor)
    ratio = np.minimum(prediction.sigma_factor_50 * np.exp(half - most), _LARGEST_RATIO_50)
    return dataclasses.replace(
        prediction,
        covariance=prediction.covariance * np.exp(2.0 * grown)[..., None, None],
        sigma_factor_50=ratio,
        calibration=np.maximum(prediction.calibration, CalibrationStage.ONLINE),
    )


def log_shipped_50(prediction: Prediction, group: GroupArray) -> Float64Array:
    """Return [groups, H] logarithms of the factors for the 50 % ellipses of the model's file.

    They are those of the model's predictions, and 0 for groups of which it predicts no road user.

    Args:
        prediction: with the shipped calibration.
        group: [n] positions in :data:`~mtpgo_core.task.calibration.GROUPS`.
    """
    logs = np.zeros((len(GROUPS), len(prediction.time_s)))
    rows = prediction.source == Source.MODEL
    logs[group[rows]] = np.log(prediction.sigma_factor_50[rows])
    return logs


def as_preferred(prediction: Prediction, rows: BoolArray) -> Prediction:
    """Mark rows as served by constant velocity because it has been better than the model."""
    source = prediction.source.copy()
    source[rows] = Source.PREFERRED_CONSTANT_VELOCITY
    return dataclasses.replace(prediction, source=source)


def _log_size(covariance: Float64Array) -> Float64Array:
    """Return [...] logarithms of the mean standard deviations (m) of covariances [..., 2, 2]."""
    xx, xy, yy = covariance[..., 0, 0], covariance[..., 0, 1], covariance[..., 1, 1]
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(0.25 * np.log(xx * yy - xy * xy))
