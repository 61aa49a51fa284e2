# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The command line of ``mtpgo benchmark``."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from mtpgo_core.errors import ConfigurationError


def _positive(text: str) -> int:
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError(f"{text} is given, expected at least 1")
    return number


def add_parser(subparsers: Any) -> None:
    """Register ``mtpgo benchmark``."""
    parser = subparsers.add_parser("benchmark", help="measure the speed of the model")
    kinds = parser.add_subparsers(dest="kind", metavar="KIND", required=True)
    latency = kinds.add_parser(
        "latency",
        help="one prediction against the number of agents",
        description="Time the exported model on one complete graph, in turns with a "
        "straightforward implementation of the same equations on the same weights.",
    )
    add = latency.add_argument
    add("--agents", nargs="+", type=_positive, default=[2, 8, 16, 32, 64, 128], metavar="N")
    add("--threads", nargs="+", type=_positive, default=[1], metavar="N")
    add("--seconds", type=float, default=12.0, help="time per row (12)")
    add("--json", type=Path, metavar="OUT", help="write the rows there")
    latency.set_defaults(run=run_latency)


def run_latency(args: argparse.Namespace) -> int:
    """Run ``mtpgo benchmark latency``.

    Raises:
        ConfigurationError: a duration that is not positive.
    """
    if not args.seconds > 0.0:
        raise ConfigurationError(f"--seconds is {args.seconds}, expected a positive number")
    # Only here: torch takes a second to load.
    from mtpgo_training.benchmark.latency import print_latency

    print_latency(args.agents, args.threads, args.seconds, args.json)
    return 0
