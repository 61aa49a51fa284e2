# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The outcomes of earlier predictions that one observation reveals."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.quality.prediction_memory import PredictionMemory
from mtpgo_core.schema import BoolArray, Float64Array, IndexArray


@dataclass(frozen=True)
class Outcomes:
    """Steps of predictions whose time has passed: m rows, each an agent, a prediction and a step.

    A step of a prediction occurs once, either with the truth or, when it is certain that there
    will be none, with NaN. The steps of a prediction of an agent come in the order of time.

    Attributes:
        now_ns: time of the newest observation (ns).
        track: [m] number of the agent's track; a road user who gets an identity that was used
            before, or a track that starts again, has another number.
        stamp_ns: [m] time of the observation that the prediction starts from (ns).
        step: [m] horizon step, from 0.
        time_s: [m] seconds after ``stamp_ns``.
        group: [m] position in :data:`mtpgo_core.task.calibration.GROUPS`, at ``stamp_ns``.
        source: [m] :class:`~mtpgo_core.schema.Source` values.
        truth: [m, 2] observed position (m), NaN where it is not known.
        ade: [m] distance of the heaviest mode from the truth, averaged over the known steps up to
            this one (m), NaN where none is known.
        cv_ade: [m] the same of constant velocity (m).
        unknown: number of steps without a truth by cause, a name of :data:`UNKNOWN`.

    What was predicted is taken from the memory of predictions when it is asked for, so ask before
    the next observation.
    """

    now_ns: int
    track: NDArray[np.int64]
    stamp_ns: NDArray[np.int64]
    step: IndexArray
    time_s: Float64Array
    group: NDArray[np.uint8]
    source: NDArray[np.uint8]
    truth: Float64Array
    ade: Float64Array
    cv_ade: Float64Array
    unknown: Mapping[str, int]
    _memory: PredictionMemory = field(repr=False)
    _cycle: IndexArray = field(repr=False)
    _agent: IndexArray = field(repr=False)

    def __len__(self) -> int:
        return self.track.shape[0]

    @property
    def known(self) -> BoolArray:
        """[m] whether there is a truth."""
        return np.asarray(np.isfinite(self.truth[:, 0]))

    @property
    def row(self) -> IndexArray:
        """[m] position of the agent in the published prediction."""
        return self._memory.row[self._cycle, self._agent]

    @cached_property
    def heaviest_mean(self) -> Float64Array:
        """[m, 2] position in the heaviest mode (m)."""
        return self._memory.mean(*self._heaviest)

    @cached_property
    def heaviest_covariance(self) -> Float64Array:
        """[m, 2, 2] its covariance as it was published (m^2)."""
        return symmetric(self._memory.covariance[self._heaviest])

    @cached_property
    def sigma_factor_50(self) -> Float64Array:
        """[m] of the 50 % ellipse, see :class:`~mtpgo_core.schema.Prediction`."""
        factors = self._memory.sigma_factor_50[self._cycle, self._agent, self.step]
        return factors.astype(np.float64)

    @cached_property
    def cv_mean(self) -> Float64Array:
        """[m, 2] position at constant velocity from the same state (m)."""
        return self._memory.cv_mean[self._cycle, self._agent, self.step]

    @cached_property
    def cv_covariance(self) -> Float64Array:
        """[m, 2, 2] covariance of it (m^2)."""
        return symmetric(self._memory.cv_covariance[self._cycle, self._agent, self.step])

    @property
    def _heaviest(self) -> tuple[IndexArray, IndexArray, IndexArray, IndexArray]:
        """Where the heaviest mode is in the memory."""
        c, a = self._cycle, self._agent
        return c, a, self._memory.heaviest[c, a], self.step

    def mixture(self) -> tuple[Float64Array, Float64Array, Float64Array]:
        """Return weights [m, M], means [m, M, 2] (m) and covariances [m, M, 2, 2] (m^2)."""
        memory, c, a = self._memory, self._cycle, self._agent
        return (
            memory.weight[c, a].astype(np.float64),
            memory.means(c, a, self.step),
            symmetric(memory.covariance[c, a, :, self.step]),
        )

    def select(self, rows: IndexArray | BoolArray) -> Outcomes:
        """Return some of the rows."""
        columns = {f.name: getattr(self, f.name) for f in fields(self)}
        whole = {"now_ns", "unknown", "_memory"}
        return Outcomes(**{k: v if k in whole else v[rows] for k, v in columns.items()})


UNKNOWN = {
    "gap": "the road user was not observed closely before and after that time",
    "left": "the track had ended",
    "restarted": "the track had moved impossibly and started again",
    "clock_reset": "the clock was set back",
    "frame_changed": "the objects came in another frame",
    "no_track": "the track had ended when its prediction was published",
}
"""Why a predicted step gets no truth, by the verdicts of the history."""


def symmetric(triangle: NDArray[np.floating]) -> Float64Array:
    """Return [..., 2, 2] matrices of their xx, xy and yy [..., 3]."""
    xx, xy, yy = (triangle[..., i].astype(np.float64) for i in range(3))
    return np.stack([np.stack([xx, xy], -1), np.stack([xy, yy], -1)], -2)
