# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The schedule of a fold, as long as its budget allows."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import torch

from mtpgo_training.data.recording_cache import RecordingCache
from mtpgo_training.data.splits import NamedRecording, split, window_s
from mtpgo_training.training.data_loading import Scenes, prepare_scenes
from mtpgo_training.training.networks import build_network
from mtpgo_training.training.run_state import TrainingRun
from mtpgo_training.training.torch_process import prepare_process
from mtpgo_training.training.training_config import TrainingConfig
from mtpgo_training.training.trial.epoch_cost import EpochCost, measure_epoch
from mtpgo_training.training.trial.schedule_plan import Budget, SchedulePlan, fit_schedule

VALIDATION_COST = 0.5
"""Time of a validation scene in units of one of training, where it is not measured; chosen: a
forward pass, twice where the covariances are fitted."""

LIMIT = 4.0
"""A training ends after this multiple of its budget as shown by a clock, wherever its schedule is;
chosen: other programs make it last longer."""


def plan_fold(
    config: TrainingConfig,
    recordings: Sequence[NamedRecording],
    budget: Budget,
    cache: RecordingCache | None = None,
) -> SchedulePlan:
    """Return the schedule of a training that fits into a budget.

    Args:
        config: the configuration of the fold.
        recordings: its recordings.
        budget: how long it may train.
        cache: keeps what is expensive to compute.
    """
    options, trainer = config.optimisation, config.trainer
    if budget.minutes is None and budget.steps is None:
        epochs = budget.epochs or options.epochs
        return SchedulePlan(epochs, validate_every_epochs=trainer.validate_every_epochs)
    prepare_process(config.num_threads)
    torch.manual_seed(config.seed)
    model = build_network(config.network, config.model, config.history, config.scene)
    horizon = model.config.horizon_steps
    splits = split(recordings, config.data, config.seed, window_s(config.history, horizon))
    scenes = prepare_scenes(config, splits, horizon, cache=cache, progress=False)
    if budget.steps is not None:
        return fit_schedule(_steps(scenes, options.batch_scenes), budget.steps, config, budget)
    assert budget.minutes is not None
    cost = measure_epoch(TrainingRun(model, config), scenes)
    plan = fit_schedule(cost, 60.0 * budget.minutes, config, budget)
    return dataclasses.replace(plan, limit_minutes=LIMIT * budget.minutes)


def _steps(scenes: Scenes, batch_scenes: int) -> EpochCost:
    """Return the cost of an epoch in steps."""
    steps = max(1, round(len(scenes.training) / batch_scenes))
    validation = VALIDATION_COST * len(scenes.validation) / batch_scenes
    return EpochCost(steps, steps, validation, len(scenes.training))
