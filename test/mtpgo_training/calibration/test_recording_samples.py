# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Samples from a model file on a recording: those of its output before the calibration."""

import dataclasses

import numpy as np
import pytest
import torch
from traffic import braking_cars

from mtpgo_core.prediction.model_runner import ModelRunner
from mtpgo_core.task.calibration import GROUPS, Calibration, GroupCalibration
from mtpgo_core.task.task_description import HistoryConfig, SceneConfig, TaskDescription
from mtpgo_training.calibration.calibration_report import score_samples
from mtpgo_training.calibration.recording_samples import recording_samples
from mtpgo_training.evaluation.evaluator import evaluate
from mtpgo_training.export.exporter import export_model
from mtpgo_training.training.networks import build_network

OPTIONS = {"hidden": 8, "modes": 2, "horizon_steps": 5, "ode_hidden": 4}


@pytest.fixture(scope="module")
def runners(tmp_path_factory):
    """Of one network, without and with a calibration in the file."""
    torch.manual_seed(0)
    scene = SceneConfig(max_neighbours=3)
    network = build_network("mtp-go", OPTIONS, HistoryConfig(), scene)
    groups = (GroupCalibration(name=n, factors=(3.0,) * 5, temperature=2.0) for n in GROUPS)
    folder, loaded = tmp_path_factory.mktemp("models"), []
    for name, calibration in (("plain", Calibration()), ("scaled", Calibration(tuple(groups)))):
        task = TaskDescription(scene=scene, calibration=calibration)
        export_model(network, task, folder / f"{name}.pt")
        loaded.append(ModelRunner.load(folder / f"{name}.pt"))
    return loaded


def test_the_coverage_of_the_samples_is_that_of_the_evaluation(runners):
    recording = braking_cars(tracks=8, seconds=5.0)
    samples = recording_samples(runners[0], recording, "road", stride_s=1.0)
    scores = evaluate({"m": runners[0]}, [recording], stride_s=1.0, centre=False)["m"]["all"]
    assert samples.sites == ("road",)
    assert len(samples) == scores["n"]
    assert score_samples(samples).agents == scores["n"]


def test_the_calibration_of_the_file_is_taken_back(runners):
    recording = braking_cars(tracks=8, seconds=4.0)
    plain, scaled = (recording_samples(runner, recording, "road") for runner in runners)
    for name in (f.name for f in dataclasses.fields(plain)):
        one, other = getattr(plain, name), getattr(scaled, name)
        if isinstance(one, np.ndarray):
            np.testing.assert_allclose(one, other, rtol=1e-4, atol=1e-4)
