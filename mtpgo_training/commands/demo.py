# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``mtpgo demo``: a recording through the real node, and what its predictions were worth."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

DESCRIPTION = (
    "Play recordings at real time through the predictor, started as its own process, score its "
    "predictions against what the recordings then show, and draw a picture. Without arguments "
    "the recording that ships with the package is played."
)

RATE_HZ = 5.0


def add_parser(subparsers: Any) -> None:
    """Register ``mtpgo demo``."""
    parser = subparsers.add_parser("demo", help=DESCRIPTION.split(",")[0], description=DESCRIPTION)
    add = parser.add_argument
    add("data", nargs="?", type=Path, metavar="DIR", help="folder of recordings")
    add("--layout", help="layout of the recordings in DIR, for instance highd, ind, round, exid")
    add("--recordings", nargs="+", metavar="NAME", help="play only these")
    add("--all", action="store_true", help="play those too that the model was trained on")
    add("--model", default="default", help="name or file of the model (default)")
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
        help="where summary.json, prediction.png, bags and logs go (demo_output)",
    )
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run the demo.

    Returns:
        0; bad input raises :class:`~mtpgo_core.errors.MtpgoError`.
    """
    # Only here: the other commands need neither matplotlib nor torch.
    from mtpgo_training.demo.demo_chain import Options, run_demo

    run_demo(
        Options(
            data=args.data,
            layout=args.layout,
            recordings=args.recordings,
            play_all=args.all,
            model=args.model,
            parameters=tuple(args.parameter),
            output=args.output,
            rate_hz=RATE_HZ,
        )
    )
    return 0
