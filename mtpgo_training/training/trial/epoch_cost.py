# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""How long an epoch takes, measured on a few of its steps before a training."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor
from torch_geometric.data import Batch

from mtpgo_training.training.data_loading import Scenes, epoch_loader
from mtpgo_training.training.run_loss import BatchLoss
from mtpgo_training.training.run_state import TrainingRun
from mtpgo_training.training.training_config import TrainingConfig
from mtpgo_training.training.validation import validate_epoch

TRIAL_S = 6.0
"""Longest measurement of the steps of one loss (s); chosen: a few per cent of six minutes."""

LEAST_STEPS = 3
"""Fewest steps that are measured, the first one not counted; chosen."""

VALIDATION_SCENES = 128
"""Validation scenes that are measured, evenly drawn; chosen: two batches."""


@dataclass(frozen=True)
class EpochCost:
    """Cost of a whole epoch, in seconds or in steps.

    Attributes:
        ewta: of its steps while the loss is EWTA.
        likelihood: of its steps on the likelihood, or on the network's own objective.
        validation: of a validation.
        scenes: number of training scenes.
    """

    ewta: float
    likelihood: float
    validation: float
    scenes: int

    @property
    def training(self) -> float:
        """Mean cost of an epoch's steps over the schedule: an eighth is EWTA alone."""
        return self.ewta / 8.0 + self.likelihood * 7.0 / 8.0


def measure_epoch(
    run: TrainingRun,
    scenes: Scenes,
    clock: Callable[[], float] | None = None,
    trial_s: float | None = None,
) -> EpochCost:
    """Return the cost of an epoch in seconds, from a few of its steps and validation scenes.

    The steps change the weights of the run, which is not to be trained afterwards.

    Args:
        run: with the network and its configuration.
        scenes: of the training.
        clock: gives seconds; by default processor time, on a GPU time as shown by a clock.
        trial_s: longest measurement of the steps of one loss (s), by default ``TRIAL_S``.
    """
    trial_s = TRIAL_S if trial_s is None else trial_s
    device = training_device(run.config)
    if clock is None:
        clock = time.process_time if device.type == "cpu" else time.monotonic
    run.model.to(device)
    run.average.to(device)
    # Not one that trains the covariances alone: it is cheaper than the others.
    last = run.config.optimisation.main_epochs - 1
    ewta_s = likelihood_s = _epoch_s(run, scenes, 0, device, clock, trial_s)
    if run.loss_weights(last) != run.loss_weights(0):
        likelihood_s = _epoch_s(run, scenes, last, device, clock, trial_s)
    validation_s = measure_validation(run, scenes, clock)
    return EpochCost(ewta_s, likelihood_s, validation_s, len(scenes.training))


def measure_validation(run: TrainingRun, scenes: Scenes, clock: Callable[[], float]) -> float:
    """Return how long a validation takes (s), from a few of its scenes.

    It changes the state of the run, which is not to be trained afterwards.

    Args:
        run: with the network and its configuration.
        scenes: of the training.
        clock: gives seconds.
    """
    some = scenes.validation[:: max(1, len(scenes.validation) // VALIDATION_SCENES)]
    start = clock()
    validate_epoch(run, some, 0, 1)
    return (clock() - start) * len(scenes.validation) / len(some)


def _epoch_s(
    run: TrainingRun,
    scenes: Scenes,
    epoch: int,
    device: torch.device,
    clock: Callable[[], float],
    trial_s: float,
) -> float:
    """Return the time of all steps of an epoch from a few of them (s)."""
    run.state.epoch = epoch
    loader, steps = epoch_loader(scenes.training, run, 0, 1)
    module = BatchLoss(run).train()
    optimiser = torch.optim.AdamW(run.model.parameters(), lr=run.config.optimisation.learning_rate)
    durations: list[float] = []
    begin = start = clock()
    for batch in loader:
        loss = take_step(module, optimiser, batch.to(device))
        run.update_average()
        loss.item()  # waits for the device
        now = clock()
        durations.append(now - start)
        start = now
        if len(durations) >= LEAST_STEPS and now - begin > trial_s:
            break
    return steps * statistics.mean(durations[1:] or durations)


def take_step(module: BatchLoss, optimiser: torch.optim.Optimizer, batch: Batch) -> Tensor:
    """Train on a batch and return its loss, for whose value a GPU has to be waited for."""
    loss = module(batch, teacher_forcing=False)
    optimiser.zero_grad()
    loss.backward()
    optimiser.step()
    return loss


def training_device(config: TrainingConfig) -> torch.device:
    """Return the device that the trainer would use."""
    wanted = config.trainer.accelerator
    if wanted in ("auto", "gpu") and torch.cuda.is_available():
        return torch.device("cuda")
    return torch.device("mps" if wanted == "mps" else "cpu")
