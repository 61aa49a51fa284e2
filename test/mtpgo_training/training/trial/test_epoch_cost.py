# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The time of an epoch, from a few of its steps."""

import dataclasses
import itertools

import pytest
from tiny_run import CONFIG
from traffic import braking_cars

from mtpgo_training.data.data_config import DataConfig
from mtpgo_training.data.splits import NamedRecording, split, window_s
from mtpgo_training.training.data_loading import prepare_scenes
from mtpgo_training.training.networks import build_network
from mtpgo_training.training.run_state import TrainingRun
from mtpgo_training.training.trial.epoch_cost import EpochCost, measure_epoch


def test_an_eighth_of_the_epochs_is_on_ewta_alone():
    assert EpochCost(8.0, 16.0, 0.0, 1).training == 15.0


@pytest.mark.parametrize("trial_s", [0.0, 1e6])
def test_a_few_steps_stand_for_the_epoch(monkeypatch, trial_s):
    """Every look at this clock takes a second: a step takes one, and so does a validation."""
    monkeypatch.setattr("mtpgo_training.training.trial.epoch_cost.TRIAL_S", trial_s)
    config = dataclasses.replace(CONFIG, data=DataConfig(stride_s=0.4, validation=("00",)))
    recordings = [
        NamedRecording("cars", braking_cars(f"0{n}", tracks=4, seconds=6.0, seed=n))
        for n in range(2)
    ]
    network = build_network(config.network, config.model, config.history, config.scene)
    horizon = network.config.horizon_steps
    splits = split(recordings, config.data, config.seed, window_s(config.history, horizon))
    scenes = prepare_scenes(config, splits, horizon, progress=False)
    ticks = itertools.count()
    cost = measure_epoch(TrainingRun(network, config), scenes, lambda: float(next(ticks)))
    steps = -(-len(scenes.training) // config.optimisation.batch_scenes)
    assert cost == EpochCost(steps, steps, 1.0, len(scenes.training))
