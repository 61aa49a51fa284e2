# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``mtpgo export``: export a checkpoint as a model file."""

from __future__ import annotations

import argparse
from pathlib import Path

from mtpgo_training.atomic_files import require_writable
from mtpgo_training.export.exporter import export_runs
from mtpgo_training.export.model_info import model_text


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add ``mtpgo export`` to the command line."""
    export = subparsers.add_parser("export", help="export a checkpoint as a model file")
    export.add_argument(
        "checkpoint",
        type=Path,
        nargs="+",
        help="checkpoint, or run folder for its best one; of several, such as trainings that "
        "differ in the seed, the one with the smallest ADE on the validation recordings is "
        "exported",
    )
    export.add_argument("-o", "--output", type=Path, required=True, help="model file to write")
    export.add_argument("--name", help="name of the model, the configuration's by default")
    export.add_argument(
        "--uncalibrated", action="store_true", help="leave the covariances as they were trained"
    )
    export.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run ``mtpgo export``."""
    require_writable(args.output)
    task, best, candidates = export_runs(
        args.checkpoint, args.output, name=args.name, calibrated=not args.uncalibrated
    )
    print(model_text(task))
    for candidate in candidates if len(candidates) > 1 else ():
        mark = ", chosen" if candidate is best else ""
        print(f"candidate  {candidate.path}: validation ADE {candidate.ade_m:.3f} m{mark}")
    print(f"written    {args.output}, {args.output.stat().st_size / 1e6:.2f} MB")
    return 0
