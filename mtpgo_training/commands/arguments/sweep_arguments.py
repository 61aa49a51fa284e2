# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``--sweep KEY=VALUE,VALUE ...`` and ``--jobs N`` of ``mtpgo train``."""

from __future__ import annotations

import argparse

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.commands.arguments.argument_types import positive_integer


def add_sweep_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments to a command."""
    parser.add_argument(
        "--sweep",
        nargs="+",
        action="extend",
        default=[],
        metavar="KEY=VALUES",
        help="train every combination, into folders below --out, and print one table with mean "
        "and spread over the seeds: model.hidden=32,48 seed=1..3; the same command continues",
    )
    parser.add_argument(
        "--jobs",
        type=positive_integer,
        metavar="N",
        help="with --sweep: trainings at the same time (1)",
    )


def is_sweep(args: argparse.Namespace) -> bool:
    """Return whether many trainings are wanted.

    Raises:
        ConfigurationError: an option is given that only they have.
    """
    if not args.sweep and args.jobs is not None:
        raise ConfigurationError(f"--jobs is {args.jobs} without --sweep, expected both")
    return bool(args.sweep)
