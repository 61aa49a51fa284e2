# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The evaluation of a left-out site, which also keeps the samples for a calibration."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field

import numpy as np

from mtpgo_core.history.track_index import find_sort_keys, sort_keys
from mtpgo_core.schema import Float64Array, HistoryWindow, KeyArray, Prediction, Source
from mtpgo_core.task.calibration import Calibration, calibration_groups
from mtpgo_training.calibration.calibration_samples import (
    CalibrationSamples,
    SampledRecording,
    merge_samples,
)
from mtpgo_training.evaluation.evaluator import Evaluation
from mtpgo_training.evaluation.scorer import ScoredPrediction, Scorer


@dataclass
class SampledEvaluation(Evaluation):
    """Scores of one model, and what a calibration needs of its predictions.

    Attributes:
        keeps_samples: predictions are samples; false while recordings for the test are scored.
        sampled: recordings that the samples are of.
    """

    keeps_samples: bool = True
    sampled: list[SampledRecording] = field(default_factory=list)
    _samples: list[CalibrationSamples] = field(default_factory=list)

    def add(
        self,
        model: str,
        protocol: str,
        scorer: Scorer,
        prediction: Prediction,
        window: HistoryWindow | None = None,
        *,
        baselines: bool = False,
    ) -> ScoredPrediction:
        """Score a prediction and keep its samples, see :meth:`Evaluation.add`."""
        found = super().add(model, protocol, scorer, prediction, window, baselines=baselines)
        by_model = prediction.source[found.rows] == Source.MODEL
        if not self.keeps_samples or window is None or not by_model.any():
            return found
        rows = np.flatnonzero(found.rows)[by_model]
        truth = found.truth.select(by_model)
        velocity = _last_velocity(window, prediction.key[rows])
        self._samples.append(
            CalibrationSamples.of(
                prediction.mean[rows][..., :2],
                prediction.weight[rows],
                prediction.covariance[rows],
                truth.position,
                truth.mask,
                group=calibration_groups(prediction.agent_class[rows], velocity),
                step_s=truth.agents.step_s,
                sites=(truth.agents.site,),
            )
        )
        return found

    def samples(self, calibration: Calibration) -> CalibrationSamples | None:
        """Return the samples as they are without the model's calibration, None if there are none.

        Args:
            calibration: of the model.
        """
        if not self._samples:
            return None
        merged = merge_samples(self._samples).uncalibrated(calibration)
        return dataclasses.replace(merged, recordings=tuple(self.sampled))


def _last_velocity(window: HistoryWindow, key: KeyArray) -> Float64Array:
    """Return [n, 2] the velocity at the time of the window of agents in it (m/s)."""
    names = sort_keys(window.key)
    order = np.argsort(names, kind="stable")
    return window.velocity[order[find_sort_keys(names[order], sort_keys(key))], -1]
