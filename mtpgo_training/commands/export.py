# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``mtpgo export``: export a checkpoint as a model file."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.atomic_files import require_suffix, require_writable
from mtpgo_training.commands.arguments.early_checks import (
    files_of_run,
    require_apart,
    require_different,
)


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
    export.add_argument(
        "--site",
        metavar="LOCATION",
        help="serve the model at this site: its origin of scene.site_origins becomes the model's",
    )
    export.add_argument("--name", help="name of the model, the configuration's by default")
    calibration = export.add_mutually_exclusive_group()
    calibration.add_argument(
        "--uncalibrated",
        action="store_true",
        help="leave covariances and mode weights as they were trained",
    )
    calibration.add_argument(
        "--calibration",
        type=Path,
        action="extend",
        nargs="+",
        metavar="PATH",
        help="calibrate on the sites that `mtpgo crossval` left out (its folder, or "
        "calibration.npz of its folds) instead of the validation recordings",
    )
    export.add_argument(
        "--force",
        action="store_true",
        help="export a model whose 90 %% ellipses hold less than 80 %% or more than 98 %% of the "
        "moving validation road users 5 s ahead",
    )
    export.add_argument(
        "--checkpoint",
        dest="shipped_checkpoint",
        type=Path,
        metavar="FILE",
        help="also write the weights as a checkpoint for `mtpgo adapt` and `train --init-from`; "
        "beside the model file with the suffix .ckpt it is found by the model's name",
    )
    export.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run ``mtpgo export``."""
    # Imported here: the parser needs neither torch nor the extra `training`.
    from mtpgo_training.calibration.calibration_samples import load_samples
    from mtpgo_training.export.exporter import export_runs
    from mtpgo_training.export.model_info import model_text
    from mtpgo_training.export.shipped_checkpoint import (
        foreign_checkpoint,
        write_shipped_checkpoint,
    )
    from mtpgo_training.table_format import to_text

    given = (*args.checkpoint, *(args.calibration or ()))
    for path in given:
        if not path.exists():
            raise ConfigurationError(f"{path} does not exist, expected the result of a training")
    outputs = (("-o", args.output), ("--checkpoint", args.shipped_checkpoint))
    require_suffix("-o", args.output, (".pt",))
    require_different(outputs)
    require_apart(outputs, [file for path in given for file in files_of_run(path)])
    for _, path in outputs:
        if path is not None:
            require_writable(path)
    exported = export_runs(
        args.checkpoint,
        args.output,
        name=args.name,
        calibrated=not args.uncalibrated,
        samples=load_samples(args.calibration) if args.calibration else None,
        force=args.force,
        site=args.site,
    )
    for sentence in exported.warnings:
        print(f"mtpgo: warning: {sentence}", file=sys.stderr)
    print(model_text(exported.task))
    if exported.left_out is not None:
        print("\neach site without and with the calibration fitted to the other sites:")
        print(to_text(exported.left_out) + "\n")
    for candidate in exported.candidates if len(exported.candidates) > 1 else ():
        mark = ", chosen" if candidate is exported.run else ""
        print(f"candidate  {candidate.path}: validation ADE {candidate.ade_m:.3f} m{mark}")
    written = [args.output]
    if args.shipped_checkpoint is not None:
        write_shipped_checkpoint(exported.run.checkpoint, exported.task, args.shipped_checkpoint)
        written.append(args.shipped_checkpoint)
    foreign = foreign_checkpoint(args.output, exported.task)
    if foreign:
        print(f"mtpgo: warning: {foreign}", file=sys.stderr)
    for path in written:
        print(f"written    {path}, {path.stat().st_size / 1e6:.2f} MB")
    return 0
