# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The time of an epoch, from a few of its steps."""

import dataclasses
import itertools

import pytest
from tiny_run import CONFIG, new_run, with_options
from traffic import braking_cars

from mtpgo_training.data.data_config import DataConfig
from mtpgo_training.data.splits import NamedRecording, split, window_s
from mtpgo_training.study.study_costs import OperationCount
from mtpgo_training.training.data_loading import prepare_scenes
from mtpgo_training.training.trial.epoch_cost import EpochCost, measure_epoch


def test_an_eighth_of_the_epochs_is_on_ewta_alone():
    assert EpochCost(8.0, 16.0, 0.0, 1).training == 15.0


def prepared(config):
    """The scenes of a training with a configuration."""
    config = dataclasses.replace(config, data=DataConfig(stride_s=0.4, validation=("00",)))
    recordings = [
        NamedRecording("cars", braking_cars(f"0{n}", tracks=4, seconds=6.0, seed=n))
        for n in range(2)
    ]
    horizon = int(config.model["horizon_steps"])
    splits = split(recordings, config.data, config.seed, window_s(config.history, horizon))
    return prepare_scenes(config, splits, horizon, progress=False)


@pytest.fixture(scope="module")
def scenes():
    return prepared(CONFIG)


@pytest.mark.parametrize("trial_s", [0.0, 1e6])
@pytest.mark.parametrize(("warm_up_share", "trials"), [(0.25, 2), (0.0, 1)])
def test_a_few_steps_stand_for_the_epoch(monkeypatch, scenes, trial_s, warm_up_share, trials):
    """Every look at this clock takes a second: a step takes one, and so does a validation."""
    monkeypatch.setattr("mtpgo_training.training.trial.epoch_cost.TRIAL_S", trial_s)
    ticks = itertools.count()
    run = new_run(with_options(warm_up_share=warm_up_share))
    cost = measure_epoch(run, scenes, lambda: float(next(ticks)))
    steps = -(-len(scenes.training) // CONFIG.optimisation.batch_scenes)
    assert cost == EpochCost(steps, steps, 1.0, len(scenes.training))
    # Losses that are the same throughout are measured once.
    measured = min(steps, 3) if trial_s == 0.0 else steps
    assert next(ticks) == trials * (1 + measured) + 2


def test_epochs_for_the_covariances_alone_do_not_stand_for_the_others():
    """They are without the consistency loss, which nearly doubles the operations of a step."""

    def operations(weight):
        options = with_options(warm_up_share=0.0, calibration_epochs=1, consistency_weight=weight)
        config = dataclasses.replace(options, data=DataConfig(stride_s=0.4))
        run, scenes = new_run(config), prepared(config)
        with OperationCount() as counted:
            cost = measure_epoch(run, scenes, lambda: float(counted.operations), trial_s=0.0)
        return cost.training

    assert operations(1.0) > 1.3 * operations(0.0)
