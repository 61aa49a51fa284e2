# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Keeps a run: its log, its checkpoints, and where it goes on."""

from __future__ import annotations

import dataclasses
import time
from pathlib import Path
from typing import Any

import lightning
from torch_geometric.data import Batch

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.options import from_dict
from mtpgo_training.evaluation.scorebook import ScoreTable
from mtpgo_training.training.networks import MTP_GO
from mtpgo_training.training.run_folder import Checkpoint, RunFolder
from mtpgo_training.training.trainer.epoch_validation import epochs_without_better, judge
from mtpgo_training.training.trainer.run_state import Row, RunState
from mtpgo_training.training.trainer.training_module import TrainingModule
from mtpgo_training.training.training_config import TrainingConfig

LOGGED = ("ade", "fde", "mr", "anll", "min_ade", "coverage_90")
"""Validation scores in the log."""

TENSORBOARD_STEPS = 10
"""Steps between two points of the loss in TensorBoard."""


class Keeper(lightning.Callback):
    """Counts the time, validates, logs and saves.

    The state and the weights are the same in all processes; the first one writes.
    """

    def __init__(
        self, folder: RunFolder, splits: list[dict[str, str]], checkpoint: Checkpoint | None
    ) -> None:
        """Remember where to write.

        Args:
            folder: the run's folder.
            splits: names and hashes of the recordings, kept in the checkpoints.
            checkpoint: where to go on, if anywhere.
        """
        self.folder = folder
        self.splits = splits
        self.checkpoint = checkpoint
        self.table: ScoreTable | None = None
        self._clock = self._saved = 0.0

    def on_train_start(self, trainer: lightning.Trainer, pl_module: Any) -> None:
        """Give optimiser and precision their state back, start the clock."""
        if self.checkpoint is not None:
            trainer.optimizers[0].load_state_dict(self.checkpoint["optimiser"])
            trainer.precision_plugin.load_state_dict(self.checkpoint["precision"])
        self._clock = self._saved = time.monotonic()

    def on_train_batch_end(
        self,
        trainer: lightning.Trainer,
        pl_module: Any,
        outputs: Any,
        batch: Batch,
        batch_idx: int,
    ) -> None:
        """Save within the epoch when it is time, or when the run is to end here."""
        state = pl_module.state
        self._count_time(state)
        if state.step % TENSORBOARD_STEPS == 0 and trainer.logger is not None:
            rate = trainer.optimizers[0].param_groups[0]["lr"]
            facts = {"loss": state.mean_loss(), "learning_rate": rate}
            trainer.logger.log_metrics(facts, step=state.step)
        due = self._clock - self._saved > 60.0 * pl_module.config.trainer.checkpoint_minutes
        if (due or pl_module.stopping) and state.batch < pl_module.loaders.steps:
            self._save(trainer, pl_module, best=False)

    def on_train_epoch_end(self, trainer: lightning.Trainer, pl_module: Any) -> None:
        """Validate, log and save; an epoch that was cut short goes on another time."""
        state, options = pl_module.state, pl_module.config
        if state.batch < pl_module.loaders.steps:
            trainer.should_stop = True
            return
        row = self._row(trainer, pl_module)
        last = state.epoch + 1 == options.optimisation.epochs
        better = False
        if last or (state.epoch + 1) % options.trainer.validate_every_epochs == 0:
            self.table, better = judge(pl_module)
            row.update(_scores(self.table))
        self._count_time(state)
        state.finish_epoch()
        row["total_seconds"] = round(state.seconds, 2)
        state.rows.append(row)
        self._save(trainer, pl_module, best=better)
        patience = options.trainer.patience_epochs
        if pl_module.stopping or 0 < patience <= epochs_without_better(pl_module):
            trainer.should_stop = True

    def _row(self, trainer: lightning.Trainer, module: TrainingModule) -> Row:
        state = module.state
        return {
            "epoch": state.epoch + 1,
            "objective": module.aim.name,
            "loss": state.mean_loss(),
            "learning_rate": trainer.optimizers[0].param_groups[0]["lr"],
            "steps": state.step,
            "skipped": state.skipped,
            "agents": int(state.agents),
            "seconds": round(state.epoch_seconds, 2),
        }

    def _count_time(self, state: RunState) -> None:
        now = time.monotonic()
        state.epoch_seconds += now - self._clock
        self._clock = now

    def _save(self, trainer: lightning.Trainer, module: TrainingModule, *, best: bool) -> None:
        self._saved = time.monotonic()
        if not trainer.is_global_zero:
            return
        state = module.state
        exported = {
            "config": dataclasses.asdict(module.config),
            "network": module.config.network,
            "model_config": module.model.config.to_dict(),
            "average": module.average.state_dict(),
            "epoch": state.epoch,
            "step": state.step,
            "covariance_scale": state.scale,
            "metrics": state.metrics,
            "splits": self.splits,
        }
        resumed = {
            "model": module.model.state_dict(),
            "optimiser": trainer.optimizers[0].state_dict(),
            "precision": trainer.precision_plugin.state_dict(),
            "state": state.to_dict(),
        }
        self.folder.save(exported, resumed, best=best)
        if state.rows:
            self.folder.write_log(state.rows)
        if trainer.logger is not None and state.batch == 0:
            row = {k: v for k, v in state.rows[-1].items() if isinstance(v, int | float)}
            trainer.logger.log_metrics({f"epoch/{k}": v for k, v in row.items()}, step=state.step)
            trainer.logger.save()


def _inputs(config: TrainingConfig) -> str:
    """What each number in a network's input means."""
    scene, history = config.scene, config.history
    return (
        f"frame {scene.frame}, context {scene.context}, classes {', '.join(scene.classes)}, "
        f"{history.steps} steps of {history.dt_s:g} s"
    )


def _scores(table: ScoreTable) -> Row:
    """The validation's columns of the log."""
    row: Row = {}
    for protocol in ("all", "centre"):
        for key in LOGGED:
            row[f"{protocol}_{key}"] = round(table.models["model"][protocol][key], 4)
    for name in ("cv", "ca"):
        row[f"{name}_all_ade"] = round(table.models[name]["all"]["ade"], 4)
        row[f"{name}_centre_ade"] = round(table.models[name]["centre"]["ade"], 4)
    return row


def restore(module: TrainingModule, checkpoint: Checkpoint, path: Path) -> None:
    """Give weights and state back that ``last.pt`` holds.

    Args:
        module: as the configuration makes it.
        checkpoint: what ``path`` holds.
        path: for the error.

    Raises:
        ConfigurationError: the checkpoint is no ``last.pt``, or of another architecture.
    """
    try:
        module.model.load_state_dict(checkpoint["model"])
        module.average.load_state_dict(checkpoint["average"])
        stored = RunState(**checkpoint["state"])
    except (KeyError, TypeError, RuntimeError) as error:
        reason = " ".join(str(error).split())[:200]
        raise ConfigurationError(
            f"{path} does not fit the configured network or this version's trainer: {reason}"
        ) from error
    for field in dataclasses.fields(RunState):
        setattr(module.state, field.name, getattr(stored, field.name))


def start_from(module: TrainingModule, checkpoint: Checkpoint, path: Path) -> None:
    """Begin with the averaged weights of another run.

    Args:
        module: as the configuration makes it.
        checkpoint: what ``path`` holds.
        path: for the error.

    Raises:
        ConfigurationError: they belong to another architecture.
    """
    network = checkpoint.get("network", MTP_GO)
    if network != module.config.network:
        raise ConfigurationError(
            f"the weights of {path} are of {network!r}, but the configured network is "
            f"{module.config.network!r}, expected the same"
        )
    try:
        stored = from_dict(TrainingConfig, checkpoint["config"], f"the configuration in {path}")
        if _inputs(stored) != _inputs(module.config):
            raise ConfigurationError(
                f"the weights of {path} were trained on other inputs ({_inputs(stored)}), "
                f"expected those of the configuration ({_inputs(module.config)})"
            )
        weights = checkpoint["average"]
        module.model.load_state_dict(weights)
        module.average.load_state_dict(weights)
    except (KeyError, RuntimeError) as error:
        reason = " ".join(str(error).split())[:200]
        raise ConfigurationError(
            f"the weights of {path} do not fit the configured network: {reason}"
        ) from error
