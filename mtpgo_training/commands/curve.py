# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``mtpgo curve``: how good a model was after how many minutes of training."""

from __future__ import annotations

import argparse
import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.atomic_files import replacing, require_writable

LINES = (("all_ade", "ADE", "-"), ("all_min_ade", "minADE", "--"))
"""Column of the log, name and style of what is drawn for a run."""

YARDSTICKS = (
    ("cv_all_ade", "constant velocity", ":"),
    ("ca_all_ade", "constant acceleration", "-."),
)
"""Likewise for what does not change from epoch to epoch."""


def read_log(folder: Path) -> list[dict[str, str]]:
    """The validated epochs in the log of a run.

    Raises:
        ConfigurationError: there is no log, it is none of `mtpgo train`, or no epoch is in it.
    """
    path = folder / "log.csv"
    try:
        with path.open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ConfigurationError(f"the log {path} cannot be read: {error}") from error
    wanted = ["total_seconds", "objective", *(column for column, _, _ in LINES + YARDSTICKS)]
    for column in wanted:
        if not rows or column not in rows[0]:
            raise ConfigurationError(
                f"{path} has no epoch with the column {column}, expected the log of a run"
            )
    validated = [row for row in rows if row["all_ade"]]
    if not validated:
        raise ConfigurationError(f"{path} has no validated epoch yet, expected at least one")
    return validated


def draw(folders: Sequence[Path], path: Path) -> None:
    """Draw the learning curves of runs into one PNG.

    Wall-clock minutes to the right, metres upwards. The yardsticks are those of the first run; a
    dot marks where a run's likelihood began to count alone.

    Raises:
        ConfigurationError: see :func:`read_log`.
    """
    logs = [(folder.resolve().name, read_log(folder)) for folder in folders]
    from matplotlib.figure import Figure

    from mtpgo_training.reports.series import MODEL_COLOURS

    figure = Figure(figsize=(7.0, 4.0), layout="constrained")
    axes = figure.add_subplot()
    highest = 0.0
    for i, (name, rows) in enumerate(logs):
        minutes = [float(row["total_seconds"]) / 60.0 for row in rows]
        colour = MODEL_COLOURS[i % len(MODEL_COLOURS)]
        for column, label, style in LINES:
            values = [float(row[column]) for row in rows]
            axes.plot(minutes, values, style, color=colour, label=f"{name}: {label}")
        _mark_likelihood(axes, rows, minutes, colour)
    first = logs[0][1][0]
    for column, label, style in YARDSTICKS:
        highest = max(highest, float(first[column]))
        axes.axhline(float(first[column]), linestyle=style, color="0.4", label=label)
    axes.set(xlabel="training (min)", ylabel="validation, all agents (m)")
    axes.set_xlim(left=0.0)
    axes.set_ylim(0.0, 1.1 * highest)
    axes.grid(alpha=0.3)
    axes.legend(fontsize="small", ncols=2)
    with replacing(path) as temporary:
        figure.savefig(temporary, format="png", dpi=130)


def _mark_likelihood(
    axes: Any, rows: Sequence[dict[str, str]], minutes: Sequence[float], colour: str
) -> None:
    for row, minute in zip(rows, minutes, strict=True):
        if row["objective"] == "NLL":
            axes.plot(minute, float(row["all_ade"]), "o", color=colour)
            return


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add ``mtpgo curve`` to the command line."""
    parser = subparsers.add_parser("curve", help="draw the learning curves of runs")
    parser.add_argument("runs", type=Path, nargs="+", metavar="RUN", help="run folder")
    parser.add_argument("-o", "--output", type=Path, required=True, help="PNG to write")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run ``mtpgo curve``."""
    require_writable(args.output)
    draw(args.runs, args.output)
    print(f"written to {args.output}")
    return 0
