# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The state of a training run: its progress, its weights and their moving average."""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass, field
from typing import Any

import torch

from models.trajectory_predictor import TrajectoryPredictor
from mtpgo_training.calibration.calibration_samples import CalibrationSamples
from mtpgo_training.training.losses.schedules import LossWeights, loss_weights
from mtpgo_training.training.networks import OwnObjective, family
from mtpgo_training.training.training_config import TrainingConfig

Row = dict[str, Any]
"""One line of the log."""


@dataclass
class RunState:
    """Progress of a run: everything that changes apart from the weights and the optimiser.

    Attributes:
        epoch: number of completed epochs.
        batch: completed batches of the current epoch.
        step: completed optimisation steps.
        loss: sum of the loss over the agents of the current epoch.
        agents: number of these agents.
        skipped: steps of the current epoch that were skipped because they were not finite.
        epoch_seconds: time spent on the current epoch so far (s).
        seconds: time spent on all completed epochs, validation included (s).
        best: smallest validation criterion so far, see
            :func:`mtpgo_training.training.validation.validate_epoch`.
        best_epoch: epoch that reached it, counted from 1.
        calibration: fitted at the best epoch, as plain data.
        metrics: validation scores of the best epoch, as plain data.
        rows: the log.
    """

    epoch: int = 0
    batch: int = 0
    step: int = 0
    loss: float = 0.0
    agents: float = 0.0
    skipped: int = 0
    epoch_seconds: float = 0.0
    seconds: float = 0.0
    best: float = math.inf
    best_epoch: int = 0
    calibration: dict[str, Any] = field(default_factory=dict)
    metrics: dict[str, Any] = field(default_factory=dict)
    rows: list[Row] = field(default_factory=list)

    def count_step(self, loss: float, agents: float) -> None:
        """Count a completed step with its loss, an average over ``agents`` agents."""
        self.step += 1
        self.batch += 1
        if math.isfinite(loss):
            self.loss += loss * agents
            self.agents += agents
        else:
            self.skipped += 1

    def mean_loss(self) -> float:
        """Return the average loss of the current epoch so far."""
        return self.loss / max(self.agents, 1.0)

    @property
    def total_seconds(self) -> float:
        """Time spent on all epochs, that of the current one included (s)."""
        return self.seconds + self.epoch_seconds

    def finish_epoch(self, row: Row) -> None:
        """Add the completed epoch's row to the log and reset what is counted per epoch."""
        self.seconds = self.total_seconds
        self.epoch += 1
        self.batch = self.skipped = 0
        self.loss = self.agents = self.epoch_seconds = 0.0
        self.rows.append({**row, "total_seconds": round(self.seconds, 2)})


class TrainingRun:
    """A network in training.

    Attributes:
        config: the configuration.
        model: the network.
        average: exponential moving average of its weights, which is validated and exported.
        state: the progress.
        is_global_zero: whether this is the first process, which prints and writes.
        stopping: whether all processes have agreed to end after the last completed step.
        received_signal: the signal that asked for it, if there was one.
        out_of_time: whether the time limit asked for it.
        samples: of the validation of the best epoch, for a calibration; None after a resumption.
    """

    def __init__(self, model: TrajectoryPredictor, config: TrainingConfig) -> None:
        self.config = config
        self.model = model
        self.average = copy.deepcopy(model).requires_grad_(False)
        self.state = RunState()
        self.is_global_zero = True
        self.stopping = False
        self.received_signal: int | None = None
        self.out_of_time = False
        self.samples: CalibrationSamples | None = None

    @property
    def finished(self) -> bool:
        """Whether all epochs are completed, or ``patience_epochs`` without a better validation."""
        patience = self.config.trainer.patience_epochs
        return self.state.epoch >= self.config.optimisation.epochs or (
            0 < patience <= self._epochs_since_best()
        )

    def _epochs_since_best(self) -> int:
        """Return the number of epochs on the likelihood alone from the best to the last validated.

        What an epoch after that is worth is not known.
        """
        epoch = self.state.epoch
        validated = epoch - epoch % self.config.trainer.validate_every_epochs
        return sum(
            self.loss_weights(epoch).ewta == 0.0
            for epoch in range(self.state.best_epoch, validated)
        )

    def loss_weights(self, epoch: int | None = None) -> LossWeights:
        """Return the weights of the losses in an epoch, by default the current one."""
        epoch = self.state.epoch if epoch is None else epoch
        options = self.config.optimisation
        own = self.objective(epoch)
        if own is not None:
            return LossWeights(winners=1, ewta=0.0, nll=1.0, objective=own.name)
        total, modes = options.main_epochs, self.model.config.modes
        return loss_weights(epoch, total, modes, options.warm_up_share)

    def objective(self, epoch: int | None = None) -> OwnObjective | None:
        """Return the network's own objective in an epoch, None where the common losses are used.

        Args:
            epoch: by default the current one.
        """
        epoch = self.state.epoch if epoch is None else epoch
        main = epoch < self.config.optimisation.main_epochs
        return family(self.config.network).objective if main else None

    @property
    def compares_windows(self) -> bool:
        """Whether the loss of the current epoch has the consistency loss, which needs pairs."""
        common = self.objective() is None and not self.calibrates
        wanted = self.config.optimisation.consistency_weight > 0.0
        return wanted and common and self.loss_weights().nll > 0.0

    @property
    def averages_agents(self) -> bool:
        """Whether the loss of the current epoch is an average over agents, not agent-steps."""
        return self.config.optimisation.reduction == "sum" and self.objective() is None

    def teacher_forcing_probability(self) -> float:
        """Return the probability of teacher forcing in the current epoch.

        It falls linearly to zero within the warm-up of Algorithm 1, or is constant.
        """
        options = self.config.optimisation
        if options.teacher_forcing_schedule == "constant":
            return options.teacher_forcing
        warm_up_epochs = options.warm_up_share * options.main_epochs
        if self.state.epoch >= warm_up_epochs:
            return 0.0
        return options.teacher_forcing * (1.0 - self.state.epoch / warm_up_epochs)

    @property
    def calibrates(self) -> bool:
        """Whether the current epoch trains the covariances alone."""
        return self.state.epoch >= self.config.optimisation.main_epochs

    @torch.no_grad()
    def update_average(self) -> None:
        """Update the moving average of the weights; in the first steps it follows them faster."""
        step = self.state.step
        decay = min(self.config.optimisation.average_decay, step / (step + 10.0))
        pairs = zip(self.average.parameters(), self.model.parameters(), strict=True)
        for average, parameter in pairs:
            average.lerp_(parameter, 1.0 - decay)
