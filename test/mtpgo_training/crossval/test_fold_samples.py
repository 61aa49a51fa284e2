# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Samples for a calibration from the evaluation of a site."""

import dataclasses

import numpy as np
import pytest
from traffic import braking_cars, cut_windows

from mtpgo_core.prediction.constant_velocity import predict_constant_velocity
from mtpgo_core.prediction.model_runner import ModelRunner
from mtpgo_core.schema import Source
from mtpgo_core.task.calibration import GROUPS, Calibration, GroupCalibration
from mtpgo_core.task.model_file import find_model
from mtpgo_core.task.task_description import HistoryConfig
from mtpgo_training.crossval.fold import score_site
from mtpgo_training.crossval.fold_samples import SampledEvaluation
from mtpgo_training.crossval.site_scores import MODEL
from mtpgo_training.data.splits import NamedRecording
from mtpgo_training.evaluation.evaluator import Settings
from mtpgo_training.evaluation.scorer import Scorer

H, DT = 10, 0.2


def evaluated(source):
    """The evaluation of constant velocity under the name of a model, and the number of agents."""
    recording = dataclasses.replace(braking_cars(tracks=6), location="here")
    scorer, result = Scorer(recording), SampledEvaluation()
    for tracked in cut_windows(recording, HistoryConfig(), 1.0):
        present = tracked.window.select(tracked.window.valid[:, -1])
        given = predict_constant_velocity(present, horizon_steps=H, dt_s=DT)
        given = dataclasses.replace(given, source=np.full_like(given.source, source))
        result.add("model", "all", scorer, given, tracked.window, baselines=True)
    return result


def test_every_scored_prediction_of_the_model_is_a_sample():
    result = evaluated(Source.MODEL)
    samples = result.samples(Calibration())
    assert len(samples) == result.scores.averages()["model"]["all"]["n"] > 30
    assert samples.sites == ("here",)
    assert samples.distance.shape == (len(samples), H)
    assert {GROUPS[i] for i in samples.group} == {"vehicle_moving"}


def test_fallback_predictions_are_no_samples():
    assert evaluated(Source.CONSTANT_VELOCITY).samples(Calibration()) is None


def test_recordings_for_the_test_are_scored_and_give_no_samples():
    recordings = [
        NamedRecording("here", dataclasses.replace(braking_cars(tracks=6), name=name))
        for name in ("01", "02")
    ]
    runner = ModelRunner.load(find_model("default"))
    settings = Settings(stride_s=1.0, centre=False)
    whole = score_site(runner, "here", recordings, settings)
    part = score_site(runner, "here", recordings, settings, ("here/02",))
    scored = [one.scores.averages()[MODEL]["all"]["n"] for one in (whole, part)]
    sampled = [len(one.samples(Calibration())) for one in (whole, part)]
    assert scored[0] == scored[1] == sampled[0] == 2 * sampled[1]
    assert [one.name for one in part.samples(Calibration()).recordings] == ["01"]


def test_the_calibration_of_the_model_is_taken_back():
    result = evaluated(Source.MODEL)
    groups = tuple(GroupCalibration(name, (4.0,) * H, 2.0) for name in GROUPS)
    plain = result.samples(Calibration())
    found = result.samples(Calibration(groups))
    known = np.isfinite(plain.distance)
    assert found.distance[known] == pytest.approx(4.0 * plain.distance[known], rel=1e-5)
