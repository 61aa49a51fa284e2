# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Learning curves: the validation error of runs over the time of training."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.atomic_files import replacing
from mtpgo_training.reports.series import MODEL_COLOURS, draw_line
from mtpgo_training.run_files import LOG_FILE

LINES = (("all_ade", "ADE", "-"), ("all_min_ade", "minADE", "--"))
"""Column of the log, name and line style of each curve of a run."""

BASELINE_LINES = (
    ("cv_all_ade", "constant velocity", ":"),
    ("ca_all_ade", "constant acceleration", "-."),
)
"""Columns of the log that do not change from epoch to epoch."""


def read_log(folder: Path) -> list[dict[str, str]]:
    """Return the validated epochs in the log of a run.

    Raises:
        ConfigurationError: there is no log of `mtpgo train`, or it has no validated epoch.
    """
    path = folder / LOG_FILE
    try:
        with path.open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ConfigurationError(f"the log {path} cannot be read: {error}") from error
    wanted = ["total_seconds", "objective", *(column for column, _, _ in LINES + BASELINE_LINES)]
    for column in wanted:
        if not rows or column not in rows[0]:
            raise ConfigurationError(
                f"{path} has no epoch with the column {column}, expected the log of a run"
            )
    validated = [row for row in rows if row["all_ade"]]
    if not validated:
        raise ConfigurationError(f"{path} has no validated epoch yet, expected at least one")
    for row in validated:
        for column in wanted:
            if column != "objective":
                _number(path, column, row[column])
    return validated


def _number(path: Path, column: str, text: str | None) -> float:
    """Return a value of a log.

    Raises:
        ConfigurationError: it is none, as in a line that is cut off.
    """
    try:
        return float(text or "")
    except ValueError as error:
        raise ConfigurationError(
            f"{path} has {text!r} in the column {column}, expected a number"
        ) from error


def draw_learning_curves(folders: Sequence[Path], path: Path) -> None:
    """Draw the learning curves of runs into one PNG.

    The x axis is wall-clock time (min), the y axis the error on the validation recordings (m). The
    kinematic baselines of runs with the same validation recordings are drawn once, in grey. A dot
    marks the first epoch that is trained on the likelihood alone.

    Raises:
        ConfigurationError: see :func:`read_log`.
    """
    logs = [(folder.resolve().name, read_log(folder)) for folder in folders]
    figure = Figure(figsize=(7.0, 4.0), layout="constrained")
    axes = figure.add_subplot()
    highest = 0.0
    for i, (name, rows) in enumerate(logs):
        minutes = [float(row["total_seconds"]) / 60.0 for row in rows]
        colour = MODEL_COLOURS[i % len(MODEL_COLOURS)]
        for column, label, style in LINES:
            values = [float(row[column]) for row in rows]
            draw_line(axes, minutes, values, style, color=colour, label=f"{name}: {label}")
        ades = [float(row["all_ade"]) for row in rows]
        highest = max(highest, min(filter(math.isfinite, ades), default=0.0))
        _mark_likelihood(axes, rows, minutes, colour)
    highest = max(highest, _draw_baselines(axes, logs))
    axes.set(xlabel="training (min)", ylabel="validation, all agents (m)")
    axes.set_xlim(left=0.0)
    axes.set_ylim(0.0, 1.1 * highest)
    axes.grid(alpha=0.3)
    axes.legend(fontsize="small", ncols=2)
    with replacing(path) as temporary:
        figure.savefig(temporary, format="png", dpi=130)


def _draw_baselines(axes: Any, logs: Sequence[tuple[str, list[dict[str, str]]]]) -> float:
    """Draw the baselines of all runs, and return the largest error (m)."""
    columns = [column for column, _, _ in BASELINE_LINES]
    errors = [tuple(float(rows[0][column]) for column in columns) for _, rows in logs]
    common = len(set(errors)) == 1
    for i, (name, _) in enumerate(logs[:1] if common else logs):
        colour = "0.4" if common else MODEL_COLOURS[i % len(MODEL_COLOURS)]
        for error_m, (_, label, style) in zip(errors[i], BASELINE_LINES, strict=True):
            told = label if common else f"{name}: {label}"
            axes.axhline(error_m, linestyle=style, color=colour, label=told)
    return max(map(max, errors))


def _mark_likelihood(
    axes: Any, rows: Sequence[dict[str, str]], minutes: Sequence[float], colour: str
) -> None:
    for row, minute in zip(rows, minutes, strict=True):
        if row["objective"] == "NLL":
            axes.plot(minute, float(row["all_ade"]), "o", color=colour)
            return
