# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The schedule of a fold: what is measured, and what is not."""

import dataclasses

import pytest
from tiny_run import CONFIG, with_options
from traffic import braking_cars

from mtpgo_training.crossval.fold_plan import LIMIT, plan_fold
from mtpgo_training.data.data_config import DataConfig
from mtpgo_training.data.splits import NamedRecording
from mtpgo_training.training.trial.schedule_plan import LEAST_EPOCHS, Budget, SchedulePlan

LONG = with_options(epochs=36)


@pytest.fixture(scope="module")
def recordings():
    return [
        NamedRecording("cars", braking_cars(f"0{n}", tracks=4, seconds=6.0, seed=n))
        for n in range(2)
    ]


def test_without_a_budget_nothing_is_measured():
    assert plan_fold(CONFIG, [], Budget()) == SchedulePlan(8)
    assert plan_fold(CONFIG, [], Budget(epochs=3)) == SchedulePlan(3)


def test_steps_need_no_measurement_and_are_kept(recordings):
    config = dataclasses.replace(LONG, data=DataConfig(stride_s=0.2, validation=("00",)))
    plan = plan_fold(config, recordings, Budget(steps=60))
    again = plan_fold(config, recordings, Budget(steps=60))
    assert plan == again
    assert plan.epochs == LEAST_EPOCHS
    assert 0.0 < plan.share < 1.0
    assert plan.limit_minutes is None


def test_a_few_steps_are_measured(recordings, monkeypatch):
    monkeypatch.setattr("mtpgo_training.training.trial.epoch_cost.TRIAL_S", 0.0)
    config = dataclasses.replace(CONFIG, data=DataConfig(stride_s=0.4, validation=("00",)))
    plan = plan_fold(config, recordings, Budget(minutes=1000.0))
    assert dataclasses.replace(plan, validate_every_epochs=1) == SchedulePlan(
        8, limit_minutes=LIMIT * 1000.0
    )
