# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``mtpgo convert``: recordings of any layout into rosbag2 MCAP bags of tracked objects."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from msg_adapters.registry import INPUTS
from mtpgo_training.data.bag_conversion import JOIN_GAP_S, convert, selected
from mtpgo_training.data.readers import LAYOUTS, iter_recordings
from mtpgo_training.data.recording_bag import DEFAULT_KIND


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add ``mtpgo convert``."""
    parser = subparsers.add_parser(
        "convert",
        help="recordings into rosbag2 MCAP bags",
        description="Convert recordings into rosbag2 MCAP bags of tracked objects.",
    )
    parser.add_argument("layout", help=f"layout of the recordings: {', '.join(LAYOUTS)}")
    parser.add_argument("directory", type=Path, help="directory with the recordings")
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        required=True,
        help="NAME.mcap: one file with all recordings; else a directory, one bag per recording",
    )
    parser.add_argument(
        "--recordings", nargs="+", metavar="NAME", help="names of the recordings (default: all)"
    )
    parser.add_argument(
        "--as",
        dest="kind",
        default=DEFAULT_KIND,
        choices=list(INPUTS),
        help="message of the tracked objects (default: %(default)s)",
    )
    parser.add_argument("--ego", type=int, metavar="ID", help="track to be marked as the ego")
    parser.add_argument("--start", type=float, metavar="S", help="from this time on (s)")
    parser.add_argument("--end", type=float, metavar="S", help="up to this time (s)")
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
    """Do what the command line asks for."""
    names: Sequence[str] | None = args.recordings
    recordings = selected(
        iter_recordings(args.directory, args.layout, names),
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
