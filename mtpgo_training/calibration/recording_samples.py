# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Samples for a calibration from a model on recordings, by the predictor that the node runs."""

from __future__ import annotations

import numpy as np

from mtpgo_core.prediction.model_runner import ModelRunner
from mtpgo_core.schema import BoolArray, Float64Array, Prediction, Source
from mtpgo_core.task.calibration import Calibration, calibration_groups
from mtpgo_training.calibration.calibration_samples import CalibrationSamples, merge_samples
from mtpgo_training.data.recording import Recording
from mtpgo_training.evaluation.evaluator import make_predictor
from mtpgo_training.evaluation.scorer import GroundTruth, Scorer
from mtpgo_training.scenes.history_replay import replay
from mtpgo_training.scenes.windows import frames_every


def prediction_samples(
    prediction: Prediction,
    rows: BoolArray,
    truth: GroundTruth,
    *,
    velocity: Float64Array,
    site: str,
    calibration: Calibration = Calibration(),  # noqa: B008  frozen
) -> CalibrationSamples:
    """Compare the predictions that are the model's with the truth.

    Args:
        prediction: of n agents.
        rows: [n] the agents whose truth is known, as of :meth:`Scorer.score`.
        truth: of those.
        velocity: [n, 2] at t (m/s), NaN where it was never known.
        site: where it was recorded.
        calibration: that the prediction has, which is taken back.
    """
    own = prediction.source[rows] == Source.MODEL
    index = np.flatnonzero(rows)[own]
    samples = CalibrationSamples.of(
        prediction.mean[index][..., :2],
        prediction.weight[index],
        prediction.covariance[index],
        truth.position[own],
        truth.mask[own],
        group=calibration_groups(prediction.agent_class[index], velocity[index]),
        step_s=float(prediction.time_s[0]),
        sites=(site,),
    )
    return samples.uncalibrated(calibration)


def recording_samples(
    runner: ModelRunner, recording: Recording, site: str, *, stride_s: float = 1.0
) -> CalibrationSamples:
    """Return the samples of a model on a recording, without the calibration in its file.

    Args:
        runner: the model.
        recording: which the training of the model should not have seen.
        site: where it was recorded.
        stride_s: time between two instants (s).

    Raises:
        ConfigurationError: no agent of the recording is predicted by the model.
    """
    history, calibration = runner.task.history, runner.task.calibration
    scorer, predictor = (
        Scorer(recording, max_gap_s=history.max_gap_s),
        make_predictor(runner, recording),
    )
    times = map(recording.stamp_ns, frames_every(recording, stride_s).tolist())
    parts = []
    for window in replay(recording, history, times):
        prediction = predictor.predict(window)
        if not len(prediction):
            continue
        horizon, dt_s = len(prediction.time_s), float(prediction.time_s[0])
        truth = scorer.ground_truth(prediction.key, prediction.stamp_ns, horizon, dt_s)
        rows = np.asarray(truth.mask.any(axis=1))
        parts.append(
            prediction_samples(
                prediction,
                rows,
                truth.select(rows),
                velocity=window.velocity[window.valid[:, -1], -1],
                site=site,
                calibration=calibration,
            )
        )
    return merge_samples(parts)
