# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``mtpgo convert``: convert recordings into rosbag2 MCAP bags of tracked objects."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from msg_adapters.registry import INPUTS
from mtpgo_training.commands.arguments.data_arguments import add_data_arguments, data_sources
from mtpgo_training.data.bag_conversion import JOIN_GAP_S, convert, selected
from mtpgo_training.data.data_sources import named_recordings
from mtpgo_training.data.recording_bag import DEFAULT_KIND


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add ``mtpgo convert`` to the command line."""
    parser = subparsers.add_parser(
        "convert",
        help="convert recordings into rosbag2 MCAP bags",
        description="Convert recordings into rosbag2 MCAP bags of tracked objects.",
    )
    add_data_arguments(parser, "LAYOUT DIRECTORY")
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        required=True,
        help="NAME.mcap: one file with all recordings; else a directory, one bag per recording",
    )
    parser.add_argument(
        "--as",
        dest="kind",
        default=DEFAULT_KIND,
        choices=list(INPUTS),
        help="message of the tracked objects (default: %(default)s)",
    )
    parser.add_argument("--ego", type=int, metavar="ID", help="track to be marked as the ego")
    parser.add_argument(
        "--start",
        type=float,
        metavar="S",
        help="begin of the part converted (s)",
    )
    parser.add_argument(
        "--end",
        type=float,
        metavar="S",
        help="end of the part converted (s)",
    )
    parser.add_argument(
        "--join",
        action="store_true",
        help=f"one bag for all recordings, with pauses of {JOIN_GAP_S:g} s",
    )
    parser.add_argument(
        "--drop-parked", action="store_true", help="leave out road users that never move"
    )
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run ``mtpgo convert``."""
    named = named_recordings(data_sources(args.data_options))
    recordings = selected(
        (recording for _, recording in named),
        start_s=args.start,
        end_s=args.end,
        ego_id=args.ego,
        drop_parked=args.drop_parked,
    )
    progress = sys.stderr.isatty()
    for bag in convert(recordings, args.output, kind=args.kind, join=args.join, progress=progress):
        print(
            f"{bag.path}: {len(bag.recordings)} recording(s) ({', '.join(bag.recordings)}), "
            f"{bag.duration_s:.1f} s, {bag.frames} frames, {bag.messages} messages"
        )
    return 0
