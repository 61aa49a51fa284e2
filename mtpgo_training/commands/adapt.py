# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``mtpgo adapt``: adapt a model to recordings of a site and write it as a model file."""

from __future__ import annotations

import argparse
import dataclasses
import os
import signal
import sys
import time
from pathlib import Path

from mtpgo_core.completion import completed_by
from mtpgo_core.task.model_file import CHECKPOINT_SUFFIX, find_checkpoint, shipped_models
from mtpgo_training.atomic_files import require_writable
from mtpgo_training.commands.arguments.data_arguments import (
    add_cache_arguments,
    add_data_arguments,
    cache_from,
    data_sources,
)
from mtpgo_training.commands.arguments.early_checks import (
    files_of_recordings,
    files_of_run,
    require_apart,
    require_different,
    require_sources,
    require_training_modules,
)


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add ``mtpgo adapt`` to the command line."""
    parser = subparsers.add_parser(
        "adapt",
        help="adapt a model to recordings of your site",
        description="Fine-tune and recalibrate a model on recordings of your site. The end of the "
        "recordings is for validation; a model that is worse there than the one it began with is "
        "not written. docs/training.md explains it.",
    )
    completed_by(
        parser.add_argument(
            "model",
            help="shipped model, model file with its checkpoint beside it, checkpoint or run "
            "folder",
        ),
        lambda: shipped_models(CHECKPOINT_SUFFIX),
    )
    add_data_arguments(parser, required=True)
    parser.add_argument("-o", "--output", type=Path, required=True, help="model file to write")
    parser.add_argument(
        "--checkpoint",
        type=Path,
        metavar="FILE",
        help="also write a checkpoint, from which one can adapt again; beside the model file with "
        f"the suffix {CHECKPOINT_SUFFIX} it is found by the model's name",
    )
    parser.add_argument("--name", help="name of the model, by default that of its file")
    parser.add_argument(
        "--minutes", type=float, help="time limit of everything, in minutes (default: 10)"
    )
    parser.add_argument("--epochs", type=int, help="most epochs (default: 8)")
    parser.add_argument("--seed", type=int, help="seed of the training (default: 1)")
    parser.add_argument("--threads", type=int, help="threads of torch (default: 2)")
    parser.add_argument(
        "--force", action="store_true", help="write the model even if it has become worse"
    )
    add_cache_arguments(parser)
    parser.add_argument("--quiet", action="store_true", help="print nothing but errors")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run ``mtpgo adapt``."""
    started_s = time.monotonic()
    # Set before torch is loaded: DDP would warn that parameters are unused, which is intended.
    os.environ.setdefault("TORCH_CPP_LOG_LEVEL", "ERROR")
    base_path = find_checkpoint(args.model)
    sources = data_sources(args.data_options)
    cache = cache_from(args)
    jobs = require_sources(sources)
    require_training_modules()
    outputs = (("-o", args.output), ("--checkpoint", args.checkpoint))
    require_different(outputs)
    read = [*files_of_run(base_path), *files_of_recordings(jobs)]
    if base_path.suffix == CHECKPOINT_SUFFIX:
        read.append(base_path.with_suffix(".pt"))  # its model file
    require_apart(outputs, read)
    for _, path in outputs:
        if path is not None:
            require_writable(path)
    # Imported here: torch and Fabric take seconds to load, and the parser does not need them.
    from mtpgo_training.adapt.adapt_options import AdaptOptions
    from mtpgo_training.adapt.adapt_report import coverage_warning, report_text, require_better
    from mtpgo_training.adapt.adaptation import adapt
    from mtpgo_training.data.data_sources import read_all
    from mtpgo_training.export.exporter import describe, export_model, load_model
    from mtpgo_training.export.model_calibration import check_coverage, own_calibration
    from mtpgo_training.export.shipped_checkpoint import (
        foreign_checkpoint,
        require_pair,
        write_shipped_checkpoint,
    )
    from mtpgo_training.training.run_folder import load_checkpoint

    load_checkpoint(base_path)  # its errors, before the recordings are read
    require_pair(args.model, base_path)
    given = {
        "minutes": args.minutes,
        "epochs": args.epochs,
        "seed": args.seed,
        "num_threads": args.threads,
    }
    options = AdaptOptions(**{name: value for name, value in given.items() if value is not None})

    def say(text: str) -> None:
        if not args.quiet:
            print(text, flush=True)

    adaptation = adapt(
        base_path,
        read_all(sources, cache),
        options,
        name=args.name or args.output.stem,
        started_s=started_s,
        cache=cache,
        report=say,
        progress=not args.quiet and sys.stderr.isatty(),
    )
    received = adaptation.received_signal
    if received is not None:
        name = signal.Signals(received).name
        say(f"{name} ended the training, the best weights so far are kept")
    if not args.force:
        require_better(adaptation)
    checkpoint = adaptation.checkpoint
    for warning in (
        check_coverage(checkpoint["metrics"], force=args.force),
        coverage_warning(adaptation),
    ):
        if warning:
            print(f"mtpgo: warning: {warning}", file=sys.stderr)
    task = dataclasses.replace(describe(checkpoint), calibration=own_calibration(checkpoint))
    task = export_model(load_model(checkpoint), task, args.output)
    if args.checkpoint is not None:
        write_shipped_checkpoint(checkpoint, task, args.checkpoint)
    foreign = foreign_checkpoint(args.output, task)
    if foreign:
        print(f"mtpgo: warning: {foreign}", file=sys.stderr)
    say(report_text(adaptation, (time.monotonic() - started_s) / 60.0))
    written = [str(path) for path in (args.output, args.checkpoint) if path is not None]
    say(f"written    {', '.join(written)}")
    return 0 if received is None else 128 + received
