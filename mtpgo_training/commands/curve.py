# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``mtpgo curve``: draw the learning curves of runs."""

from __future__ import annotations

import argparse
from pathlib import Path

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.atomic_files import require_writable
from mtpgo_training.commands.arguments.early_checks import files_of_run, require_apart


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add ``mtpgo curve`` to the command line."""
    parser = subparsers.add_parser("curve", help="draw the learning curves of runs")
    parser.add_argument("runs", type=Path, nargs="+", metavar="RUN", help="run folder")
    parser.add_argument("-o", "--output", type=Path, required=True, help="PNG to write")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run ``mtpgo curve``."""
    for folder in args.runs:
        if not folder.is_dir():
            raise ConfigurationError(f"{folder} is no folder, expected one of 'mtpgo train'")
    # Imported here, because matplotlib takes a second and a parser does not need it.
    from mtpgo_training.reports.learning_curve import draw_learning_curves

    require_apart([("-o", args.output)], [file for run in args.runs for file in files_of_run(run)])
    require_writable(args.output)
    draw_learning_curves(args.runs, args.output)
    print(f"written to {args.output}")
    return 0
