# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``mtpgo convert``: convert recordings into rosbag2 MCAP bags of tracked objects."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from msg_adapters.registry import INPUTS
from mtpgo_core.errors import ConfigurationError
from mtpgo_training.commands.arguments.data_arguments import add_data_arguments, data_sources
from mtpgo_training.commands.arguments.early_checks import (
    files_of_recordings,
    require_makeable,
    require_sources,
)
from mtpgo_training.data.bag_conversion import JOIN_GAP_S, convert, copy_bag, selected
from mtpgo_training.data.data_sources import named_recordings
from mtpgo_training.data.recording import require_span
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
    parser.add_argument(
        "--raw",
        action="store_true",
        help="copy every message of every topic of one bag as it was recorded: makes a whole bag "
        "of a damaged one",
    )
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run ``mtpgo convert``."""
    if args.raw:
        return _copy(args)
    require_span(args.start, args.end)
    sources = data_sources(args.data_options)
    require_makeable(args.output)
    jobs = require_sources(sources)
    files = files_of_recordings(jobs)
    named = named_recordings(sources)
    recordings = selected(
        (recording for _, recording in named),
        start_s=args.start,
        end_s=args.end,
        ego_id=args.ego,
        drop_parked=args.drop_parked,
    )
    progress = sys.stderr.isatty()
    bags = convert(
        recordings, args.output, kind=args.kind, join=args.join, sources=files, progress=progress
    )
    for bag in bags:
        print(
            f"{bag.path}: {len(bag.recordings)} recording(s) ({', '.join(bag.recordings)}), "
            f"{bag.duration_s:.1f} s, {bag.frames} frames, {bag.messages} messages"
        )
    return 0


def _copy(args: argparse.Namespace) -> int:
    """Copy a bag as it is."""
    (source,) = data_sources(args.data_options)
    require_makeable(args.output)
    given = {
        "--as": args.kind != DEFAULT_KIND,
        "--ego": args.ego is not None,
        "--start": args.start is not None,
        "--end": args.end is not None,
        "--join": args.join,
        "--drop-parked": args.drop_parked,
    }
    chosen = [name for name, value in given.items() if value]
    chosen += [f"--{name}" for name, _ in args.data_options if name not in ("layout", "data")]
    if chosen:
        raise ConfigurationError(
            f"{chosen[0]} is given with --raw, which copies everything as it is, expected one"
        )
    if source.layout != "bag":
        raise ConfigurationError(
            f"--raw is given with the layout {source.layout!r}, expected 'bag'"
        )
    copied = copy_bag(source.directory, args.output, progress=sys.stderr.isatty())
    for topic, reason in copied.skipped.items():
        what = "is copied in part" if topic in copied.topics else "is left out"
        print(f"mtpgo: topic {topic} {what}: {reason}", file=sys.stderr)
    print(
        f"{copied.path}: {len(copied.topics)} topic(s), {copied.duration_s:.1f} s, "
        f"{copied.messages} messages"
    )
    return 0
