# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``mtpgo data``: what is in recordings, and what may be wrong with them."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from tqdm import tqdm

from mtpgo_core.errors import ConfigurationError, RecordingError
from mtpgo_training.atomic_files import require_writable, write_text
from mtpgo_training.commands.arguments.data_arguments import (
    add_cache_arguments,
    add_data_arguments,
    cache_from,
    data_sources,
)
from mtpgo_training.commands.arguments.early_checks import (
    files_of_recordings,
    require_apart,
    require_different,
    require_modules,
    require_sources,
)
from mtpgo_training.commands.arguments.pool_arguments import (
    add_pool_arguments,
    failures_text,
    pool_from,
)
from mtpgo_training.data.data_sources import KnownContents
from mtpgo_training.data.summary.data_summary import DataSummary
from mtpgo_training.data.summary.recording_defects import Defect
from mtpgo_training.data.summary.recording_summary import RecordingSummary
from mtpgo_training.parallel.fork_server import start_fork_server
from mtpgo_training.parallel.work_item import Failure
from mtpgo_training.parallel.work_pool import work_through
from mtpgo_training.reports.recordings.description import Describing


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add ``mtpgo data`` to the command line."""
    parser = subparsers.add_parser(
        "data",
        help="describe recordings and their defects",
        description="Describe recordings: duration, rate, road users by class and over time, "
        "speeds, manoeuvres, and defects by kind with their places.",
    )
    add_data_arguments(parser, "[DIR]")
    parser.add_argument(
        "--json",
        nargs="?",
        const="-",
        metavar="FILE",
        help="write all numbers as JSON to this file, or in place of the text if none is named",
    )
    parser.add_argument(
        "--picture", type=Path, metavar="FILE", help="also draw a PNG: tracks, speeds, numbers"
    )
    add_cache_arguments(parser)
    add_pool_arguments(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run ``mtpgo data``; the status is 1 if a recording cannot be read, 2 if none can."""
    sources = data_sources(args.data_options)
    if not sources:
        raise ConfigurationError("no directory is given, expected mtpgo data DIR --layout LAYOUT")
    pool = pool_from(args)
    if args.picture is not None:
        require_modules("matplotlib")
    items = require_sources(sources)
    json_file = Path(args.json) if args.json not in (None, "-") else None
    outputs = (("--json", json_file), ("--picture", args.picture))
    require_different(outputs)
    require_apart(outputs, files_of_recordings(items))
    for _, path in outputs:
        if path is not None:
            require_writable(path)
    start_fork_server(pool, Describing.__module__)
    describing = Describing(cache_from(args), args.resume, args.picture is not None)
    picture: Any = None
    summaries: list[RecordingSummary] = []
    copies: list[Defect] = []
    failures: list[Failure] = []
    known = KnownContents()
    bar = tqdm(total=len(items), unit="file", disable=not sys.stderr.isatty(), leave=False)
    with bar:
        for found in work_through(describing, items, pool):
            bar.update()
            if isinstance(found, Failure):
                failures.append(found)
                continue
            summaries += found.summaries
            for name, sha256 in found.contents:
                original = known.original_of(name, sha256)
                if original is not None:
                    copies.append(Defect("copy", f"recording {name}", f"that of {original}"))
            if picture is None:
                picture = found.picture
            elif found.picture is not None:
                picture.merge(found.picture)
    unreadable = [Defect("unreadable", failure.reason) for failure in failures]
    if not summaries:
        reason = f": {unreadable[0].place}" if unreadable else ""
        places = ", ".join(str(source.directory) for source in sources)
        where = "" if unreadable else f" of {places}"
        raise RecordingError(f"no recording{where} has a road user{reason}")
    summary = DataSummary(summaries, unreadable, copies)
    if args.json != "-":
        print(summary.to_text())
    if args.json is not None:
        text = json.dumps(summary.to_json(), indent=2, allow_nan=False)
        if args.json == "-":
            print(text)
        else:
            write_text(Path(args.json), text + "\n")
    if args.picture is not None and picture is not None:
        from mtpgo_training.reports.recordings.data_picture import draw_data

        draw_data(summary, picture, args.picture)
    if failures:
        print(f"mtpgo: {failures_text(failures, len(items))}", file=sys.stderr)
    return 1 if failures else 0
