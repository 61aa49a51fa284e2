# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The training loop: epochs, the optimiser, validation, checkpoints, resumption.

An epoch's graphs, their order and the teacher's turns follow from the seed and the epoch's number
alone, and a checkpoint stands at the end of each epoch, so a run that is resumed goes on exactly
as it would have.
"""

from __future__ import annotations

import copy
import dataclasses
import math
import time
from collections.abc import Callable, Iterator
from typing import Any

import torch
from torch import Tensor
from torch_geometric.data import Data
from torch_geometric.loader import DataLoader
from tqdm import tqdm

from models.mtp_go import MTPGO
from mtpgo_training.config import TrainingConfig
from mtpgo_training.dataset import SceneDataset, dense
from mtpgo_training.learner import covariance_scale, training_loss, validation_scores
from mtpgo_training.run_folder import RunFolder
from mtpgo_training.schedule import learning_rate, objective
from mtpgo_training.scorebook import ScoreTable

VALIDATION_BATCH = 64


class Trainer:
    """Everything that changes while a model is trained."""

    def __init__(
        self,
        model: MTPGO,
        config: TrainingConfig,
        dataset: SceneDataset,
        validation: list[Data],
        folder: RunFolder,
        splits: list[dict[str, str]],
    ) -> None:
        """Prepare the optimiser.

        Args:
            model: the network, its statistics set.
            config: the configuration.
            dataset: training graphs.
            validation: graphs of :func:`mtpgo_training.dataset.validation_scenes`.
            folder: where checkpoints and the log go.
            splits: names and hashes of the recordings, kept in the checkpoints.
        """
        self.model = model
        self.config = config
        self.dataset = dataset
        self.validation = validation
        self.folder = folder
        self.splits = splits
        self.average = copy.deepcopy(model).requires_grad_(False)
        options = config.optimisation
        self.optimiser = torch.optim.AdamW(
            model.parameters(), lr=options.learning_rate, weight_decay=options.weight_decay
        )
        self.epoch = 0
        self.step = 0
        self.best = math.inf
        self.scale = 1.0
        self.metrics: dict[str, Any] = {}
        self.rows: list[dict[str, Any]] = []
        self.table: ScoreTable | None = None

    def fit(self, *, max_minutes: float | None = None, progress: bool = True) -> bool:
        """Train to the last epoch, or until the time is up.

        Args:
            max_minutes: stop at a step's end after this long; an epoch that is cut short is
                repeated when the run is resumed.
            progress: show a progress bar.

        Returns:
            Whether the last epoch was reached.
        """
        started = time.monotonic()

        def late() -> bool:
            return max_minutes is not None and time.monotonic() - started > 60.0 * max_minutes

        while self.epoch < self.config.optimisation.epochs:
            row = self._train_epoch(late, progress)
            if row is None:
                return False
            self.epoch += 1
            self._validate(row)
            if late():
                break
        return self.epoch == self.config.optimisation.epochs

    def _train_epoch(self, late: Callable[[], bool], progress: bool) -> dict[str, Any] | None:
        options, began = self.config.optimisation, time.monotonic()
        aim = objective(self.epoch, options.epochs, self.model.config.modes)
        loader = self._loader()
        total = agents = 0.0
        bar = tqdm(
            loader,
            desc=f"epoch {self.epoch + 1}/{options.epochs} {aim.name}",
            disable=not progress,
            leave=False,
        )
        generator = torch.Generator().manual_seed(self.config.seed * 7919 + self.epoch)
        teaching = self._teacher_forcing()
        self.model.train()
        for i, batch in enumerate(bar):
            fields = dense(batch)
            rate = self._set_learning_rate(i, len(loader))
            teacher = teaching > 0.0 and bool(torch.rand((), generator=generator) < teaching)
            loss = training_loss(
                self.model,
                fields,
                aim,
                huber_delta=options.huber_delta,
                mean_weight=options.mean_weight,
                teacher=teacher,
            )
            self._descend(loss)
            count = float(fields["valid"][..., -1].sum())
            total, agents = total + float(loss.detach()) * count, agents + count
            bar.set_postfix(loss=f"{total / agents:.3f}", lr=f"{rate:.1e}")
            if late():
                return None
        return {
            "epoch": self.epoch + 1,
            "objective": aim.name,
            "loss": total / max(agents, 1.0),
            "learning_rate": rate,
            "steps": self.step,
            "agents": int(agents),
            "seconds": round(time.monotonic() - began, 2),
        }

    def _loader(self) -> DataLoader:
        self.dataset.set_epoch(self.epoch)
        order = torch.Generator().manual_seed(self.config.seed * 1_000_003 + self.epoch)
        return DataLoader(
            self.dataset,
            batch_size=self.config.optimisation.batch_scenes,
            shuffle=True,
            generator=order,
        )

    def _set_learning_rate(self, i: int, steps: int) -> float:
        """Epochs differ a little in length, so the schedule runs on the share of them done."""
        options = self.config.optimisation
        rate = learning_rate(
            self.step,
            (self.epoch + i / steps) / options.epochs,
            peak=options.learning_rate,
            schedule=options.learning_rate_schedule,
            warmup_steps=options.warmup_steps,
            floor=options.learning_rate_floor,
        )
        for group in self.optimiser.param_groups:
            group["lr"] = rate
        return rate

    def _teacher_forcing(self) -> float:
        options = self.config.optimisation
        return options.teacher_forcing * max(0.0, 1.0 - 4.0 * self.epoch / options.epochs)

    def _descend(self, loss: Tensor) -> None:
        """One step; a batch whose loss or gradient is not finite is left out."""
        options = self.config.optimisation
        self.optimiser.zero_grad(set_to_none=True)
        loss.backward()
        norm = torch.nn.utils.clip_grad_norm_(self.model.parameters(), options.clip_norm)
        if bool(torch.isfinite(norm)):
            self.optimiser.step()
        self.step += 1
        decay = min(options.average_decay, self.step / (self.step + 10.0))
        for kept, new in zip(self.average.parameters(), self.model.parameters(), strict=True):
            kept.lerp_(new.detach(), 1.0 - decay)

    def _validate(self, row: dict[str, Any]) -> None:
        """Score the averaged weights, log, and save a checkpoint."""
        self.average.eval()
        book = validation_scores(self.average, self._validation_batches())
        self.table = book.table()
        scores = self.table.models["model"]
        for protocol in ("all", "centre"):
            for key in ("ade", "fde", "mr", "anll", "min_ade", "coverage_90"):
                row[f"{protocol}_{key}"] = round(scores[protocol][key], 4)
        for name in ("cv", "ca"):
            row[f"{name}_all_ade"] = round(self.table.models[name]["all"]["ade"], 4)
            row[f"{name}_centre_ade"] = round(self.table.models[name]["centre"]["ade"], 4)
        self.rows.append(row)
        merit = self._merit(scores["all"])
        better = merit < self.best
        self.best = min(merit, self.best)
        if better:
            self.scale = covariance_scale(self.average, self._validation_batches())
            book = validation_scores(self.average, self._validation_batches(), self.scale)
            self.metrics = book.table().to_dict()
        self.folder.save(self.state(), best=better)
        self.folder.write_log(self.rows)

    def _merit(self, scores: dict[str, float]) -> float:
        """What the best checkpoint has least of: ADE, once the likelihood is trained too.

        Before, no covariance has been learned, so such a checkpoint is better than none only.
        """
        aim = objective(self.epoch - 1, self.config.optimisation.epochs, self.model.config.modes)
        return scores["ade"] + (0.0 if aim.ewta_weight == 0.0 else 1e3)

    def _validation_batches(self) -> Iterator[dict[str, Tensor]]:
        loader = DataLoader(self.validation, batch_size=VALIDATION_BATCH)
        return (dense(batch) for batch in loader)

    def state(self) -> dict[str, Any]:
        """The checkpoint."""
        return {
            "config": dataclasses.asdict(self.config),
            "model_config": self.model.config.to_dict(),
            "model": self.model.state_dict(),
            "average": self.average.state_dict(),
            "optimiser": self.optimiser.state_dict(),
            "epoch": self.epoch,
            "step": self.step,
            "best": self.best,
            "covariance_scale": self.scale,
            "rows": self.rows,
            "metrics": self.metrics,
            "splits": self.splits,
        }

    def restore(self, checkpoint: dict[str, Any]) -> None:
        """Go on where ``checkpoint`` was saved."""
        self.model.load_state_dict(checkpoint["model"])
        self.average.load_state_dict(checkpoint["average"])
        self.optimiser.load_state_dict(checkpoint["optimiser"])
        self.epoch = checkpoint["epoch"]
        self.step = checkpoint["step"]
        self.best = checkpoint["best"]
        self.scale = checkpoint["covariance_scale"]
        self.metrics = checkpoint["metrics"]
        self.rows = checkpoint["rows"]
