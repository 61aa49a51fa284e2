# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""One step of learning, as Lightning sees it."""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any

import lightning
import torch
from torch import Tensor
from torch_geometric.data import Batch

from models.trajectory_predictor import TrajectoryPredictor
from mtpgo_training.training.batch_loss import batch_loss
from mtpgo_training.training.objective import Objective, learning_rate, objective
from mtpgo_training.training.trainer.data_module import SceneLoaders
from mtpgo_training.training.trainer.run_state import RunState
from mtpgo_training.training.training_config import TrainingConfig


class TrainingModule(lightning.LightningModule):
    """A network while it learns.

    Attributes:
        model: the network.
        average: the moving average of its weights, which is validated and exported.
        config: the configuration.
        state: how far the run is.
        asked_to_stop: set by whoever wants the run to end, in this process.
        received_signal: why, if it was a signal.
        stopping: all processes have agreed to end after the step that was done last.
    """

    def __init__(
        self, model: TrajectoryPredictor, config: TrainingConfig, state: RunState
    ) -> None:
        super().__init__()
        self.model = model
        self.average = copy.deepcopy(model).requires_grad_(False)
        self.config = config
        self.state = state
        self.asked_to_stop = False
        self.received_signal: int | None = None
        self.stopping = False
        self._loss = self._agents = 0.0

    @property
    def aim(self) -> Objective:
        """The objective of the epoch under way."""
        return objective(
            self.state.epoch, self.config.optimisation.epochs, self.model.config.modes
        )

    @property
    def loaders(self) -> SceneLoaders:
        """The data of this run."""
        loaders = self.trainer.datamodule  # type: ignore[attr-defined]
        assert isinstance(loaders, SceneLoaders)
        return loaders

    def configure_optimizers(self) -> torch.optim.Optimizer:
        """AdamW."""
        options = self.config.optimisation
        return torch.optim.AdamW(
            self.model.parameters(), lr=options.learning_rate, weight_decay=options.weight_decay
        )

    def on_train_batch_start(self, batch: Batch, batch_idx: int) -> int | None:
        """Set the learning rate; chance follows from seed, epoch and batch alone.

        Epochs differ a little in length, so the schedule runs on the share of them done. The rest
        of an epoch is left (-1) where all have agreed to stop.
        """
        if self.stopping:
            return -1
        options, state = self.config.optimisation, self.state
        rate = learning_rate(
            state.step,
            (state.epoch + state.batch / self.loaders.steps) / options.epochs,
            peak=options.learning_rate,
            schedule=options.learning_rate_schedule,
            warmup_steps=options.warmup_steps,
            floor=options.learning_rate_floor,
        )
        for group in self.trainer.optimizers[0].param_groups:
            group["lr"] = rate
        torch.manual_seed((self.config.seed * 7919 + state.epoch) * 1_000_003 + state.batch)
        self.model.train()
        return None

    def training_step(self, batch: Batch, batch_idx: int) -> Tensor:
        """The loss of this process's share of the batch, a scalar."""
        options = self.config.optimisation
        loss = batch_loss(
            self.model,
            batch,
            self.aim,
            huber_delta=options.huber_delta,
            mean_weight=options.mean_weight,
            teacher=bool(torch.rand(()) < self._teacher_forcing()),
        )
        return self._share(loss, batch)

    def _teacher_forcing(self) -> float:
        options = self.config.optimisation
        return options.teacher_forcing * max(0.0, 1.0 - 4.0 * self.state.epoch / options.epochs)

    def _share(self, loss: Tensor, batch: Batch) -> Tensor:
        """The loss such that its average over the processes is that of the whole batch.

        A loss is an average over agent-steps, of which the processes have different numbers. The
        same message tells each whether another wants to stop.
        """
        weight, agents = batch.weight.sum(), batch.valid[:, -1].sum()
        mine = torch.stack(
            [loss.detach() * weight, weight, agents, weight.new_tensor(self.asked_to_stop)]
        )
        if self.trainer.world_size == 1:
            self._loss, self._agents = float(loss.detach()), float(agents)
            self.stopping = self.asked_to_stop
            return loss
        total = self.trainer.strategy.reduce(mine, reduce_op="sum")
        self._loss = float(total[0] / total[1].clamp(min=1e-6))
        self._agents = float(total[2])
        self.stopping = bool(total[3] > 0)
        return loss * (self.trainer.world_size * weight / total[1].clamp(min=1e-6))

    def configure_gradient_clipping(
        self,
        optimizer: torch.optim.Optimizer,
        gradient_clip_val: float | None = None,
        gradient_clip_algorithm: str | None = None,
    ) -> None:
        """Clip; a step whose loss or gradient is not finite is left out."""
        norm = torch.nn.utils.clip_grad_norm_(
            self.model.parameters(), self.config.optimisation.clip_norm
        )
        if not bool(torch.isfinite(norm)):
            optimizer.zero_grad(set_to_none=True)  # a step without gradients moves nothing
            self._loss = float("nan")

    def optimizer_step(
        self,
        epoch: int,
        batch_idx: int,
        optimizer: Any,
        optimizer_closure: Callable[[], Any] | None = None,
    ) -> None:
        """Move the weights and their average."""
        super().optimizer_step(epoch, batch_idx, optimizer, optimizer_closure)
        self.state.count(self._loss, self._agents)
        step = self.state.step
        decay = min(self.config.optimisation.average_decay, step / (step + 10.0))
        with torch.no_grad():
            for kept, new in zip(self.average.parameters(), self.model.parameters(), strict=True):
                kept.lerp_(new, 1.0 - decay)
