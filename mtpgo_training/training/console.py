# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The text that a training run prints: its setting, a line per epoch, a summary."""

from __future__ import annotations

import math
import shlex
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import torch

from mtpgo_core.quality.metrics import MOVING_COVERAGE_KEY
from mtpgo_training.calibration.calibration_text import moving_text
from mtpgo_training.data.splits import NamedRecording, Splits
from mtpgo_training.evaluation.scores.score_summary import MOVING_TITLE, averages_table
from mtpgo_training.table_format import to_text
from mtpgo_training.training.data_loading import Scenes
from mtpgo_training.training.networks import parameter_count
from mtpgo_training.training.run_state import Row, TrainingRun

COLUMNS = (
    ("epoch", "epoch", "{:d}"),
    ("objective", "objective", "{:s}"),
    ("loss", "loss", "{:.3f}"),
    ("ADE m", "all_ade", "{:.3f}"),
    ("minADE m", "all_min_ade", "{:.3f}"),
    ("cv", "cv_all_ade", "{:.3f}"),
    ("ca", "ca_all_ade", "{:.3f}"),
    (MOVING_TITLE, f"all_{MOVING_COVERAGE_KEY}", "{:.3f}"),
    ("seconds", "seconds", "{:.1f}"),
)
"""Title, column of the log and format, of the line printed for each epoch; the coverage is that
of moving road users at the time (s) that is filled in."""

LEFT_ALIGNED = {"epoch": 7, "objective": 26}
"""Width of the left-aligned columns (characters)."""

WIDTH = 9
"""Width of the other columns, wider under a long title (characters)."""


def setting_text(
    run: TrainingRun,
    scenes: Scenes,
    splits: Splits,
    folder: Path,
    device: torch.device,
    processes: int,
) -> str:
    """Return the data, the network and the device of a run."""
    config, state = run.config, run.state
    parameters = parameter_count(run.model)
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
    return "\n".join(lines)


def title_line(time_s: float) -> str:
    """Return the titles above the lines of the epochs.

    Args:
        time_s: time of the coverage, see
            :func:`~mtpgo_core.quality.metrics.headline_time_s` (s).
    """
    return _line(_titles(time_s), time_s)


def epoch_line(row: Row, time_s: float) -> str:
    """Return the line of a completed epoch, and a second one if steps were skipped.

    Args:
        row: of the log.
        time_s: see :func:`title_line`.
    """
    values = [row.get(key.format(time_s), math.nan) for _, key, _ in COLUMNS]
    cells = [
        "-" if value != value else form.format(value)  # NaN is not known
        for value, (_, _, form) in zip(values, COLUMNS, strict=True)
    ]
    skipped = f"\n  {row['skipped']} steps were skipped: loss or gradient was not finite"
    return _line(cells, time_s) + (skipped if row["skipped"] else "")


def summary(run: TrainingRun, folder: Path, again: str) -> str:
    """Return the scores of the best epoch, and the next commands, quoted for a shell.

    Args:
        run: at its end.
        folder: its folder.
        again: the command that continues it.
    """
    state, options = run.state, run.config.optimisation
    lines = []
    calibrated = ", calibrated" if options.calibrated else ""
    if state.metrics:
        lines += [
            f"{options.keep} epoch {state.best_epoch}, validation, all agents{calibrated}:",
            to_text(averages_table(state.metrics, "all")),
            moving_text(state.metrics["model"]["all"]),
        ]
    minutes = state.total_seconds / 60.0
    lines.append(
        f"{state.epoch} of {options.epochs} epochs done in {minutes:.1f} min, see {folder}"
    )
    if run.stopping and state.epoch < options.epochs:
        lines.append(f"to continue: {again}")
    if state.metrics:
        export = ["mtpgo", "export", str(folder), "-o", f"{run.config.name}.pt"]
        lines.append(f"next: {shlex.join(export)}")
    return "\n".join(lines)


def _titles(time_s: float) -> list[str]:
    return [title.format(time_s) for title, _, _ in COLUMNS]


def _line(cells: Sequence[str], time_s: float) -> str:
    text = ""
    for cell, title in zip(cells, _titles(time_s), strict=True):
        left, width = LEFT_ALIGNED.get(title), WIDTH if len(title) < WIDTH else len(title) + 2
        text += cell.rjust(width) if left is None else cell.ljust(left)
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
