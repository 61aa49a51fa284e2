# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A schedule that fits: what is kept, and how it changes the configuration."""

import dataclasses

import pytest
from tiny_run import CONFIG, with_options
from traffic import braking_cars

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.data.data_config import DataConfig
from mtpgo_training.data.splits import NamedRecording
from mtpgo_training.training.trial.epoch_cost import EpochCost
from mtpgo_training.training.trial.schedule_plan import (
    LEAST_EPOCHS,
    Budget,
    SchedulePlan,
    fit_schedule,
)

LONG = with_options(epochs=36)


def cost(training, validation=0.0, scenes=10_000):
    return EpochCost(training, training, validation, scenes)


def test_the_configured_epochs_are_kept_where_they_fit():
    assert fit_schedule(cost(10.0), 400.0, LONG, Budget(minutes=1.0)) == SchedulePlan(36)


def test_fewer_epochs_where_enough_fit():
    assert fit_schedule(cost(10.0), 205.0, LONG, Budget(minutes=1.0)) == SchedulePlan(20)


def test_a_share_of_each_epoch_where_too_few_fit():
    plan = fit_schedule(cost(100.0), 300.0, LONG, Budget(minutes=1.0))
    assert plan == SchedulePlan(LEAST_EPOCHS, share=0.25)


def test_a_short_schedule_is_not_made_longer():
    plan = fit_schedule(cost(100.0), 400.0, with_options(epochs=8), Budget(minutes=1.0))
    assert plan == SchedulePlan(8, share=0.5)


def test_the_epochs_for_the_covariances_alone_are_not_all():
    config = with_options(epochs=36, calibration_epochs=15)
    plan = fit_schedule(cost(100.0), 300.0, config, Budget(minutes=1.0))
    assert plan.epochs == 16
    assert plan.applied(config, []).optimisation.main_epochs == 1


def test_a_given_number_of_epochs_is_kept():
    plan = fit_schedule(cost(100.0), 300.0, LONG, Budget(minutes=1.0, epochs=6))
    assert plan == SchedulePlan(6, share=0.5)


def test_validation_takes_a_small_part_of_the_time():
    plan = fit_schedule(cost(100.0, validation=20.0), 400.0, LONG, Budget(minutes=1.0))
    assert plan.validate_every_epochs == 4  # three times 20 s are 15 % of 400 s
    assert plan.share == pytest.approx((400.0 - 60.0) / 1200.0, abs=1e-4)


def test_an_epoch_keeps_some_steps():
    plan = fit_schedule(cost(1e6, scenes=160), 1.0, LONG, Budget(minutes=1.0))
    assert plan.share == 0.1  # four batches of four scenes


def test_a_plan_changes_epochs_and_the_weights_of_all_sources():
    recordings = [NamedRecording(s, braking_cars(tracks=1, seconds=1.0)) for s in ("a", "b")]
    data = DataConfig(source_weight={"b": 0.5, "b/01": 2.0})
    config = dataclasses.replace(CONFIG, data=data)
    applied = SchedulePlan(5, 0.1, 3).applied(config, recordings)
    assert applied.data.source_weight == pytest.approx({"a": 0.1, "b": 0.05, "b/01": 0.2})
    assert applied.optimisation.epochs == 5
    assert applied.trainer.validate_every_epochs == 3
    assert SchedulePlan(5).applied(config, recordings).data == data


def test_a_plan_is_read_as_it_was_written(tmp_path):
    plan = SchedulePlan(5, 0.25, 3, 7.5)
    plan.save(tmp_path / "plan.json")
    assert SchedulePlan.load(tmp_path / "plan.json") == plan


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "is damaged, expected the schedule of a training"),
        ("{}", "it has no 'epochs'"),
        ('{"epochs": 0}', "is damaged, expected the schedule of a training"),
        ('{"epochs": "x"}', "epochs is 'x', expected int"),
        ('{"epochs": 3, "hours": 1}', "has the unknown field 'hours'"),
    ],
)
def test_a_damaged_plan_is_named(tmp_path, text, sentence):
    (tmp_path / "plan.json").write_text(text)
    with pytest.raises(ConfigurationError, match=sentence):
        SchedulePlan.load(tmp_path / "plan.json")
