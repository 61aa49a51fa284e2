# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``--jobs N``, ``--cluster ADDRESS`` and ``--resume DIR`` of commands on many recordings."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from mtpgo_core.errors import ConfigurationError
from mtpgo_training.commands.arguments.argument_types import make_folder
from mtpgo_training.parallel.pool_options import PoolOptions
from mtpgo_training.parallel.work_item import Failure

MOST_NAMED = 20
"""Failures that are listed at the end, in whole sentences; chosen, further ones are counted."""


def add_pool_arguments(parser: argparse.ArgumentParser, *, resume: bool = True) -> None:
    """Add the arguments to a command.

    Args:
        parser: the command's.
        resume: with ``--resume``.
    """
    parser.add_argument(
        "--jobs",
        type=int,
        default=1,
        metavar="N",
        help="processes on this machine, each with a recording (1); more need the extra 'fleet'",
    )
    parser.add_argument(
        "--cluster",
        default="",
        metavar="ADDRESS",
        help="work on the Dask cluster with the scheduler at this address, such as "
        "tcp://host:8786, whose workers see the same paths",
    )
    if resume:
        parser.add_argument(
            "--resume",
            type=Path,
            metavar="DIR",
            help="keep the result of each recording in this folder, and take from it what an "
            "earlier run with the same settings had finished",
        )


def pool_from(args: argparse.Namespace) -> PoolOptions:
    """Return where the command line wants the work to be done.

    Raises:
        ConfigurationError: an argument is not allowed, or the folder of ``--resume`` cannot be
            made.
    """
    if args.jobs < 1:
        raise ConfigurationError(f"--jobs is {args.jobs}, expected at least 1")
    if args.cluster and args.jobs > 1:
        raise ConfigurationError(
            f"--jobs is {args.jobs} and --cluster is given, expected one: a cluster has its own "
            "number of processes"
        )
    folder = getattr(args, "resume", None)
    if isinstance(folder, Path):
        make_folder("--resume", folder)
        args.resume = folder.resolve()
    return PoolOptions(args.jobs, args.cluster)


def failures_text(failures: Sequence[Failure], items: int) -> str:
    """Return which of the items failed and why, one in a line.

    Args:
        failures: the items.
        items: number of all items.
    """
    lines = [f"{len(failures)} of {items} could not be read or scored:"]
    lines += [f"  {failure}" for failure in failures[:MOST_NAMED]]
    if len(failures) > MOST_NAMED:
        lines.append(f"  ... and {len(failures) - MOST_NAMED} more")
    return "\n".join(lines)
