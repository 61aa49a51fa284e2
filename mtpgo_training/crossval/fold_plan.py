# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""How long a fold trains: epochs, and the share of the scenes in each, that fit into its budget.

The schedules of losses and learning rate follow the epochs, so a training that is cut off by a
time limit has not come to their end. Instead, the cost of an epoch is measured on a few steps, and
the number of epochs is chosen such that the whole schedule fits. Where fewer than ``LEAST_EPOCHS``
would fit, there are that many, each with a random share of the windows.
"""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import torch

from mtpgo_training.atomic_files import write_text
from mtpgo_training.data.recording_cache import RecordingCache
from mtpgo_training.data.splits import NamedRecording, split, window_s
from mtpgo_training.training.data_loading import Scenes, prepare_scenes
from mtpgo_training.training.networks import build_network
from mtpgo_training.training.run_state import TrainingRun
from mtpgo_training.training.torch_process import prepare_process
from mtpgo_training.training.training_config import TrainingConfig
from mtpgo_training.training.trial.epoch_cost import EpochCost, measure_epoch

LEAST_EPOCHS = 12
"""Fewest epochs of a shortened schedule; chosen: three of them are the warm-up of Algorithm 1, and
one is the smallest step of its winners."""

VALIDATION_SHARE = 0.15
"""Share of the time that validation may take before it is done less often; chosen."""

VALIDATION_COST = 0.5
"""Time of a validation scene in units of one of training, where it is not measured; chosen: a
forward pass, twice where the covariances are fitted."""

LIMIT = 4.0
"""A training ends after this multiple of its budget as shown by a clock, wherever its schedule is;
chosen: other programs make it last longer."""


@dataclass(frozen=True)
class Budget:
    """How long a fold may train.

    Attributes:
        minutes: processor time of the training (min), without reading and scoring. On a GPU it is
            time as shown by a clock. None for any.
        epochs: number of epochs; None for the configuration's, or as many as fit.
        steps: optimisation steps, instead of minutes: the same on any machine. None for any.
    """

    minutes: float | None = None
    epochs: int | None = None
    steps: int | None = None


@dataclass(frozen=True)
class FoldPlan:
    """The shortened schedule of a fold.

    Attributes:
        epochs: length of the schedule.
        share: share of the windows in an epoch.
        validate_every_epochs: epochs between validations.
        limit_minutes: the training ends here in any case (min); None for never.
    """

    epochs: int
    share: float = 1.0
    validate_every_epochs: int = 1
    limit_minutes: float | None = None

    def applied(
        self, config: TrainingConfig, recordings: Sequence[NamedRecording]
    ) -> TrainingConfig:
        """Return the configuration with this schedule."""
        data = config.data
        if self.share < 1.0:
            weights = dict.fromkeys((item.source for item in recordings), 1.0)
            weights = {k: self.share * w for k, w in (weights | data.source_weight).items()}
            data = dataclasses.replace(data, source_weight=weights)
        return dataclasses.replace(
            config,
            data=data,
            optimisation=dataclasses.replace(config.optimisation, epochs=self.epochs),
            trainer=dataclasses.replace(
                config.trainer, validate_every_epochs=self.validate_every_epochs
            ),
        )

    def save(self, path: Path) -> None:
        """Write it to a JSON file."""
        write_text(path, json.dumps(dataclasses.asdict(self), indent=2) + "\n")

    @classmethod
    def load(cls, path: Path) -> FoldPlan:
        """Read what :meth:`save` wrote."""
        return cls(**json.loads(path.read_text(encoding="utf-8")))


def plan_fold(
    config: TrainingConfig,
    recordings: Sequence[NamedRecording],
    budget: Budget,
    cache: RecordingCache | None = None,
) -> FoldPlan:
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
        return FoldPlan(epochs, validate_every_epochs=trainer.validate_every_epochs)
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


def fit_schedule(
    cost: EpochCost, total: float, config: TrainingConfig, budget: Budget
) -> FoldPlan:
    """Return the schedule that costs ``total``.

    Args:
        cost: of a whole epoch.
        total: of the training, in the unit of ``cost``; validations are a part of it if they are
            measured.
        config: the configuration of the fold.
        budget: its number of epochs is taken, if there is one.
    """
    options, every = config.optimisation, config.trainer.validate_every_epochs

    def validations(epochs: int) -> float:
        return math.ceil(epochs / every) * cost.validation

    if budget.epochs is not None:
        epochs = budget.epochs
    else:
        fitting = int(total / (cost.training + cost.validation / every))
        epochs = max(min(options.epochs, LEAST_EPOCHS), min(options.epochs, fitting))
    while validations(epochs) > VALIDATION_SHARE * total and every < epochs:
        every += 1
    left = total
    if budget.steps is None:
        left = max(total - validations(epochs), 0.2 * total)
    # The shortest epochs that still have a few steps each.
    least = min(1.0, 4.0 * options.batch_scenes / max(cost.scenes, 1))
    share = min(1.0, max(least, left / (epochs * cost.training)))
    return FoldPlan(epochs, round(share, 4), every)


def _steps(scenes: Scenes, batch_scenes: int) -> EpochCost:
    """Return the cost of an epoch in steps."""
    steps = max(1, round(len(scenes.training) / batch_scenes))
    validation = VALIDATION_COST * len(scenes.validation) / batch_scenes
    return EpochCost(steps, steps, validation, len(scenes.training))
