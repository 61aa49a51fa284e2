# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What a training run prints: its setting, a progress bar, a line per epoch, a summary."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import torch
from tqdm import tqdm

from mtpgo_training.data.splits import NamedRecording, Splits
from mtpgo_training.training.data_loading import Scenes
from mtpgo_training.training.run_state import Row, TrainingRun
from mtpgo_training.training.validation import scores_text

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
"""Title, column of the log and format, of the line printed for each epoch."""

LEFT_ALIGNED = {"epoch": 7, "objective": 26}
"""Width of the left-aligned columns (characters)."""

WIDTH = 9
"""Width of the other columns (characters)."""


class Console:
    """Prints the progress of a run."""

    def __init__(self, *, verbose: bool, progress: bool) -> None:
        """Choose what is shown.

        Args:
            verbose: print lines.
            progress: show a bar within each epoch.
        """
        self.verbose = verbose
        self.progress = progress
        self._bar: tqdm[Any] | None = None

    def print_setting(
        self,
        run: TrainingRun,
        scenes: Scenes,
        splits: Splits,
        folder: Path,
        device: torch.device,
        processes: int,
    ) -> None:
        """Print the data, the network and the device of a run."""
        if not self.verbose:
            return
        config, state = run.config, run.state
        parameters = sum(p.numel() for p in run.model.parameters())
        agents = sum(int(scene.primary.sum()) for scene in scenes.validation)
        resumed = f", from batch {state.batch + 1}" if state.batch else ""
        lines = (
            f"train      {_count(splits.train)}: {len(scenes.training)} scenes an epoch",
            f"validate   {_count(splits.validation)}: {len(scenes.validation)} scenes, "
            f"{agents} agents",
            f"test       {_count(splits.test) or 'none'}",
            f"network    {config.network}, {parameters} parameters",
            f"device     {_device(device, processes)}, precision {config.trainer.precision}",
            f"run        {folder}, seed {config.seed}, epochs {state.epoch + 1} to "
            f"{config.optimisation.epochs}{resumed}",
        )
        print("\n".join(lines), flush=True)

    def print_titles(self) -> None:
        """Print the titles of the lines of the epochs."""
        if self.verbose:
            print(_line([title for title, _, _ in COLUMNS]), flush=True)

    def start_epoch(self, run: TrainingRun, batches: int) -> None:
        """Show a bar of all batches of the epoch."""
        if self.progress:
            epochs = run.config.optimisation.epochs
            self._bar = tqdm(
                total=batches,
                initial=run.state.batch,
                desc=f"epoch {run.state.epoch + 1}/{epochs} {run.loss_weights().name}",
                leave=False,
            )

    def finish_step(self, run: TrainingRun) -> None:
        """Advance the bar."""
        if self._bar is not None:
            self._bar.set_postfix(loss=f"{run.state.mean_loss():.3f}", refresh=False)
            self._bar.update()

    def close_bar(self) -> None:
        """Remove the bar."""
        if self._bar is not None:
            self._bar.close()
            self._bar = None

    def print_epoch(self, row: Row) -> None:
        """Print the line of a completed epoch."""
        self.close_bar()
        if self.verbose:
            print(_line([_cell(row, key, form) for _, key, form in COLUMNS]), flush=True)
            if row["skipped"]:
                print(f"  {row['skipped']} steps were skipped: loss or gradient was not finite")


def summary(run: TrainingRun, folder: Path) -> str:
    """Return the scores of the best epoch, and the next command."""
    state, options = run.state, run.config.optimisation
    lines = []
    if state.metrics:
        lines += [
            f"{options.keep} epoch {state.best_epoch}, validation, all agents, "
            f"covariances scaled by {state.scale:.2f}:",
            scores_text(state.metrics),
        ]
    minutes = (state.seconds + state.epoch_seconds) / 60.0
    lines.append(
        f"{state.epoch} of {options.epochs} epochs done in {minutes:.1f} min, see {folder}"
    )
    if run.stopping and state.epoch < options.epochs:
        lines.append("to continue: the same command with --resume")
    if state.metrics:
        lines.append(f"next: mtpgo export {folder} -o {run.config.name}.pt")
    return "\n".join(lines)


def _cell(row: Row, key: str, form: str) -> str:
    return form.format(row[key]) if key in row else "-"


def _line(cells: Sequence[str]) -> str:
    text = ""
    for cell, (title, _, _) in zip(cells, COLUMNS, strict=True):
        left = LEFT_ALIGNED.get(title)
        text += cell.rjust(WIDTH) if left is None else cell.ljust(left)
    return text


def _count(recordings: Sequence[NamedRecording]) -> str:
    """Return the number of recordings from each directory."""
    counts = Counter(item.source for item in recordings)
    return ", ".join(f"{count} of {source}" for source, count in counts.items())


def _device(device: torch.device, processes: int) -> str:
    if device.type == "cuda":
        return f"{processes} x {torch.cuda.get_device_name(device)}"
    if device.type != "cpu":
        return device.type
    several = f"{processes} processes of " if processes > 1 else ""
    return f"cpu, {several}{torch.get_num_threads()} thread(s)"
