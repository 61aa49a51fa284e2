# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What a run says at the terminal."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import lightning
import torch
from lightning.pytorch.accelerators import CUDAAccelerator
from torch_geometric.data import Batch
from tqdm import tqdm

from mtpgo_training.data.splits import NamedRecording, Splits
from mtpgo_training.evaluation.scorebook import ScoreTable
from mtpgo_training.training.run_folder import RunFolder
from mtpgo_training.training.trainer.data_module import Scenes
from mtpgo_training.training.trainer.run_state import Row
from mtpgo_training.training.trainer.training_module import TrainingModule

COLUMNS = (
    ("epoch", "epoch", "{:d}"),
    ("objective", "objective", "{:s}"),
    ("loss", "loss", "{:.3f}"),
    ("ADE m", "all_ade", "{:.3f}"),
    ("minADE m", "all_min_ade", "{:.3f}"),
    ("cv", "cv_all_ade", "{:.3f}"),
    ("ca", "ca_all_ade", "{:.3f}"),
    ("in 90%", "all_coverage_90", "{:.3f}"),
    ("seconds", "seconds", "{:.1f}"),
)
"""Title, column of the log and format of a line an epoch."""

WIDTHS = {"epoch": 7, "objective": 26}


class Narrator(lightning.Callback):
    """Says what a run is, shows a bar within an epoch, and prints a line at its end."""

    def __init__(self, *, talk: bool, progress: bool) -> None:
        """Choose how much is said.

        Args:
            talk: print lines.
            progress: show bars.
        """
        self.talk = talk
        self.progress = progress
        self._bar: tqdm[Any] | None = None

    def introduce(
        self,
        trainer: lightning.Trainer,
        module: TrainingModule,
        scenes: Scenes,
        splits: Splits,
        folder: RunFolder,
    ) -> None:
        """Say which data, which network, which device."""
        if not (self.talk and trainer.is_global_zero):
            return
        config, state = module.config, module.state
        parameters = sum(p.numel() for p in module.model.parameters())
        agents = sum(int(scene.primary.sum()) for scene in scenes.validation)
        lines = (
            f"teach      {_names(splits.train)}: {len(scenes.training)} scenes an epoch",
            f"validate   {_names(splits.validation)}: {len(scenes.validation)} scenes, "
            f"{agents} agents",
            f"test       {_names(splits.test) or 'none'}",
            f"network    {config.network}, {parameters} parameters",
            f"device     {_device(trainer)}, precision {trainer.precision}",
            f"run        {folder.path}, seed {config.seed}, epochs {state.epoch + 1} to "
            f"{config.optimisation.epochs}"
            + (f", from batch {state.batch + 1}" if state.batch else ""),
        )
        print("\n".join(lines), flush=True)

    def on_train_start(self, trainer: lightning.Trainer, pl_module: Any) -> None:
        """Print the titles of the lines to come."""
        if self.talk and trainer.is_global_zero:
            print(_line([title for title, _, _ in COLUMNS]), flush=True)

    def on_train_epoch_start(self, trainer: lightning.Trainer, pl_module: Any) -> None:
        """Begin a bar."""
        if self.progress and trainer.is_global_zero:
            state, epochs = pl_module.state, pl_module.config.optimisation.epochs
            self._bar = tqdm(
                total=pl_module.loaders.steps,
                initial=state.batch,
                desc=f"epoch {state.epoch + 1}/{epochs} {pl_module.aim.name}",
                leave=False,
            )

    def on_train_batch_end(
        self,
        trainer: lightning.Trainer,
        pl_module: Any,
        outputs: Any,
        batch: Batch,
        batch_idx: int,
    ) -> None:
        """Move the bar."""
        if self._bar is not None:
            self._bar.set_postfix(loss=f"{pl_module.state.mean_loss():.3f}", refresh=False)
            self._bar.update()

    def on_train_epoch_end(self, trainer: lightning.Trainer, pl_module: Any) -> None:
        """End the bar, print the epoch's line."""
        if self._bar is not None:
            self._bar.close()
            self._bar = None
        state = pl_module.state
        if not (self.talk and trainer.is_global_zero) or state.batch:
            return
        row = state.rows[-1]
        print(_line([_cell(row, key, form) for _, key, form in COLUMNS]), flush=True)
        if row["skipped"]:
            print(f"  {row['skipped']} steps were left out: loss or gradient was not finite")


def farewell(module: TrainingModule, folder: Path) -> str:
    """The best epoch's table, and what to do next."""
    state, epochs = module.state, module.config.optimisation.epochs
    lines = []
    if state.metrics:
        table = ScoreTable(
            {
                model: {
                    protocol: {k: math.nan if v is None else v for k, v in scores.items()}
                    for protocol, scores in protocols.items()
                }
                for model, protocols in state.metrics.items()
            }
        )
        lines += [
            f"{module.config.optimisation.keep} epoch {state.best_epoch}, validation, all agents, "
            f"covariances scaled by {state.scale:.2f}:",
            table.text("all"),
        ]
    minutes = (state.seconds + state.epoch_seconds) / 60.0
    lines.append(f"{state.epoch} of {epochs} epochs done in {minutes:.1f} min, see {folder}")
    if module.stopping and state.epoch < epochs:
        lines.append("to go on: the same command with --resume")
    if state.metrics:
        lines.append(f"next: mtpgo export {folder} -o {module.config.name}.pt")
    return "\n".join(lines)


def _cell(row: Row, key: str, form: str) -> str:
    return form.format(row[key]) if key in row else "-"


def _line(cells: Sequence[str]) -> str:
    widths = (WIDTHS.get(title, 9) for title, _, _ in COLUMNS)
    pairs = zip(cells, widths, strict=True)
    return "".join(c.ljust(w) if w in WIDTHS.values() else c.rjust(w) for c, w in pairs)


def _names(recordings: Sequence[NamedRecording]) -> str:
    """How many recordings of which directory."""
    counts = Counter(item.source for item in recordings)
    return ", ".join(f"{count} of {source}" for source, count in counts.items())


def _device(trainer: lightning.Trainer) -> str:
    if isinstance(trainer.accelerator, CUDAAccelerator):
        name = torch.cuda.get_device_name(trainer.strategy.root_device)
        return f"{trainer.world_size} x {name}"
    kind = trainer.strategy.root_device.type
    threads = f"{torch.get_num_threads()} thread(s)" if kind == "cpu" else ""
    several = f"{trainer.world_size} processes of " if trainer.world_size > 1 else ""
    return f"{kind}, {several}{threads}" if threads else kind
