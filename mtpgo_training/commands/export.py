# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``mtpgo export``: turn a checkpoint into a model file."""

from __future__ import annotations

import argparse
import dataclasses
from pathlib import Path

from mtpgo_training.atomic_files import require_writable
from mtpgo_training.export.exporter import describe, export_model, load_model
from mtpgo_training.export.model_info import card
from mtpgo_training.export.run_selection import choose


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add ``mtpgo export`` to the command line."""
    export = subparsers.add_parser("export", help="turn a checkpoint into a model file")
    export.add_argument(
        "checkpoint",
        type=Path,
        nargs="+",
        help="checkpoint, or run folder for its best; of several, such as one training with "
        "several seeds, the one with the smallest ADE on the validation recordings",
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
    chosen, candidates = choose(args.checkpoint)
    checkpoint = chosen.checkpoint
    model = load_model(checkpoint, calibrated=not args.uncalibrated)
    task = describe(checkpoint, args.name)
    if len(candidates) > 1:
        rivals = [{"seed": rival.seed, "validation_ade_m": rival.ade_m} for rival in candidates]
        task = dataclasses.replace(task, training={**task.training, "chosen_from": rivals})
    task = export_model(model, task, args.output)
    print(card(task))
    for candidate in candidates if len(candidates) > 1 else ():
        mark = ", chosen" if candidate is chosen else ""
        print(f"candidate  {candidate.path}: validation ADE {candidate.ade_m:.3f} m{mark}")
    print(f"written    {args.output}, {args.output.stat().st_size / 1e6:.2f} MB")
    return 0
