# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``mtpgo demo``: play recordings through the real node and score its predictions."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from mtpgo_core.completion import completed_by
from mtpgo_core.errors import ConfigurationError
from mtpgo_core.task.model_file import shipped_models
from mtpgo_training.commands.arguments.argument_types import positive_number
from mtpgo_training.commands.arguments.data_arguments import add_data_arguments, data_sources
from mtpgo_training.commands.arguments.early_checks import require_folder

DESCRIPTION = (
    "Play recordings at real time through the predictor, started as its own process, score its "
    "predictions against what the recordings then show, and draw a picture. Without arguments "
    "the simulated roundabout that ships with the package is played."
)


def add_parser(subparsers: Any) -> None:
    """Add ``mtpgo demo`` to the command line."""
    parser = subparsers.add_parser("demo", help=DESCRIPTION.split(",")[0], description=DESCRIPTION)
    add = parser.add_argument
    add_data_arguments(parser, "[DIR]")
    add("--all", action="store_true", help="also play recordings that the model was trained on")
    completed_by(
        add("--model", default="default", help="name or file of the model (default)"),
        shipped_models,
    )
    add(
        "--parameter",
        "-p",
        action="append",
        default=[],
        metavar="NAME:=VALUE",
        help="set a parameter of the node; may be given again",
    )
    add(
        "--output",
        "-o",
        type=Path,
        default=Path("demo_output"),
        metavar="DIR",
        help="where summary.json, pictures, pages, bags and logs go (demo_output)",
    )
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run ``mtpgo demo``."""
    require_folder(args.output)
    given = dict(_parameter(text) for text in args.parameter)
    if "model" in given:
        raise ConfigurationError(
            f"--parameter is 'model:={given['model']}', expected --model, which is scored as well"
        )
    # Imported late: matplotlib and torch take seconds, which ``--help`` does not need.
    from mtpgo_training.demo.demo_pipeline import DemoOptions, run_demo, shipped_source

    run_demo(
        DemoOptions(
            sources=tuple(data_sources(args.data_options, shipped_source())),
            play_all=args.all,
            model=args.model,
            parameters=tuple(args.parameter),
            output=args.output,
            **({"rate_hz": _rate_hz(given["rate"])} if "rate" in given else {}),
        )
    )
    return 0


def _parameter(text: str) -> tuple[str, str]:
    """Return name and value of a parameter of the node.

    Raises:
        ConfigurationError: the text is not both.
    """
    name, mark, value = text.partition(":=")
    if not (name and mark and value):
        raise ConfigurationError(f"--parameter is {text!r}, expected NAME:=VALUE")
    return name, value


def _rate_hz(text: str) -> float:
    """Return the rate of the node (Hz), which says when predictions are due.

    Raises:
        ConfigurationError: it is not one.
    """
    try:
        return positive_number(text)
    except argparse.ArgumentTypeError as error:
        raise ConfigurationError(
            f"--parameter is 'rate:={text}', expected a rate above 0 Hz"
        ) from error
