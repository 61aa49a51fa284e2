# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What has become known about earlier predictions with one observation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

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
        heaviest_mean: [m, 2] of the heaviest mode (m).
        heaviest_covariance: [m, 2, 2] of it (m^2), as it was published.
        cv_mean: [m, 2] constant velocity from the same state (m).
        cv_covariance: [m, 2, 2] of it (m^2).
        ade: [m] distance of the heaviest mode from the truth, averaged over the known steps up to
            this one (m), NaN where none is known.
        cv_ade: [m] the same of constant velocity (m).
        unknown: number of steps without a truth by cause, a name of :data:`UNKNOWN`.
    """

    now_ns: int
    track: NDArray[np.int64]
    stamp_ns: NDArray[np.int64]
    step: IndexArray
    time_s: Float64Array
    group: NDArray[np.uint8]
    source: NDArray[np.uint8]
    truth: Float64Array
    heaviest_mean: Float64Array
    heaviest_covariance: Float64Array
    cv_mean: Float64Array
    cv_covariance: Float64Array
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

    def mixture(self, rows: IndexArray) -> tuple[Float64Array, Float64Array, Float64Array]:
        """Return weights [r, M], means [r, M, 2] (m) and covariances [r, M, 2, 2] (m^2) of rows.

        They are taken from the memory of predictions, so call it before the next observation.
        """
        memory, c, a = self._memory, self._cycle[rows], self._agent[rows]
        place = (c, a, self.step[rows])
        return (
            memory.weight[c, a].astype(np.float64),
            memory.mean[place].astype(np.float64),
            symmetric(memory.covariance[place]),
        )


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
