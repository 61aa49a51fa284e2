# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A time limit leaves time for a validation, and the schedule is made to fit into it."""

import dataclasses

import pytest
from tiny_run import CONFIG, new_run
from traffic import braking_cars

from mtpgo_training.data.data_config import DataConfig
from mtpgo_training.data.splits import NamedRecording, split, window_s
from mtpgo_training.training.data_loading import prepare_scenes, reweighted
from mtpgo_training.training.trial import time_limit
from mtpgo_training.training.trial.epoch_cost import EpochCost
from mtpgo_training.training.trial.schedule_plan import SchedulePlan
from mtpgo_training.training.trial.time_limit import (
    CHECKPOINT_S,
    PLANNED_SHARE,
    TimeLimit,
    plan_for_time,
    plan_text,
)


@pytest.fixture
def now(monkeypatch):
    """A clock that stands still at 1000 s until it is set."""
    clock = [1000.0]
    monkeypatch.setattr("time.monotonic", lambda: clock[0])
    return clock


def unexpected() -> float:
    raise AssertionError("a validation was timed")


def test_without_a_limit_the_time_is_never_up(now):
    limit = TimeLimit(None)
    now[0] += 1e9
    assert not limit.is_set
    assert not limit.is_up(unexpected)


def test_a_validation_is_timed_after_a_quarter_of_the_time(now):
    limit = TimeLimit(1.0, started_s=990.0)
    now[0] = 1004.9
    assert not limit.is_up(unexpected)
    now[0] = 1005.1
    assert not limit.is_up(lambda: 20.0)
    now[0] = 1050.0 - 20.0 - CHECKPOINT_S - 0.1
    assert not limit.is_up(unexpected)
    now[0] += 0.2
    assert limit.is_up(unexpected)


def test_the_longest_counted_validation_is_reserved(now):
    limit = TimeLimit(1.0)
    limit.count_validation(10.0)
    limit.count_validation(5.0)
    now[0] += 49.0
    assert not limit.is_up(unexpected)
    now[0] += 1.0
    assert limit.is_up(unexpected)


def test_a_time_that_is_over_is_up_without_a_measurement(now):
    limit = TimeLimit(0.0)
    assert limit.is_up(unexpected)


@pytest.fixture(scope="module")
def data():
    config = dataclasses.replace(CONFIG, data=DataConfig(stride_s=0.2, validation=("00",)))
    recordings = [
        NamedRecording("cars", braking_cars(f"0{n}", tracks=4, seconds=6.0, seed=n))
        for n in range(2)
    ]
    horizon = int(config.model["horizon_steps"])
    splits = split(recordings, config.data, config.seed, window_s(config.history, horizon))
    return config, splits, prepare_scenes(config, splits, horizon, progress=False)


def test_the_schedule_fits_into_what_is_left(monkeypatch, data, now):
    """An epoch takes 100 s, a validation 4 s, and so do they with two processes in half of it."""
    config, _, scenes = data

    def measured(run, scenes, clock, trial_s):
        now[0] += 10.0
        return EpochCost(100.0, 100.0, 4.0, 10_000)

    monkeypatch.setattr(time_limit, "measure_epoch", measured)
    run = new_run(config)
    total_s = PLANNED_SHARE * (410.0 - 10.0)
    plan = plan_for_time(run, scenes, 410.0)
    assert plan == SchedulePlan(8, round((total_s - 8 * 4.0) / 800.0, 4))
    twice = plan_for_time(run, scenes, 410.0, processes=2)
    assert twice.share == pytest.approx((total_s - 8 * 2.0) / 400.0, abs=1e-4)


def test_a_limit_shorter_than_a_validation_is_a_warning(monkeypatch, caplog, data, now):
    config, _, scenes = data
    cost = EpochCost(100.0, 100.0, 45.0, 10_000)
    monkeypatch.setattr(time_limit, "measure_epoch", lambda *_, **__: cost)
    plan_for_time(new_run(config), scenes, 60.0)
    assert not caplog.records
    plan_for_time(new_run(config), scenes, 30.0)
    assert "a validation takes about 45 s, and --minutes leaves 27 s" in caplog.text


def test_a_real_measurement_leaves_the_weights_alone(data):
    config, _, scenes = data
    run = new_run(config)
    before = {name: value.clone() for name, value in run.model.state_dict().items()}
    plan = plan_for_time(run, scenes, 3600.0)
    assert dataclasses.replace(plan, validate_every_epochs=1) == SchedulePlan(8)
    assert all((run.model.state_dict()[name] == value).all() for name, value in before.items())
    assert run.state.best == float("inf")


def test_scenes_get_the_weights_that_a_new_preparation_gives_them(data):
    config, splits, scenes = data
    applied = SchedulePlan(8, 0.25).applied(config, splits.train)
    again = prepare_scenes(applied, splits, int(config.model["horizon_steps"]), progress=False)
    changed = reweighted(scenes, splits, applied)
    assert changed.training.items == again.training.items
    assert 0 < len(changed.training) < len(scenes.training)


def test_a_plan_is_told_in_one_line():
    assert plan_text(SchedulePlan(12, 0.345, 2), 40, 5.0) == (
        "plan       12 of 40 epochs, each with 34% of the windows, validated every 2, "
        "for 5 min in all"
    )
    assert plan_text(SchedulePlan(8), 8, 0.5) == "plan       all 8 epochs, for 0.5 min in all"
