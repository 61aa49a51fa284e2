# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``mtpgo data``: what is in recordings, and what may be wrong with them."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from pathlib import Path

from tqdm import tqdm

from mtpgo_core.errors import ConfigurationError, RecordingError
from mtpgo_training.atomic_files import require_writable, write_text
from mtpgo_training.commands.arguments.data_arguments import (
    add_cache_arguments,
    add_data_arguments,
    cache_from,
    data_sources,
)
from mtpgo_training.data.data_sources import DataSource
from mtpgo_training.data.readers import iter_recordings, recording_names
from mtpgo_training.data.recording import Recording
from mtpgo_training.data.recording_cache import RecordingCache
from mtpgo_training.data.summary.data_summary import DataSummary
from mtpgo_training.data.summary.recording_defects import Defect
from mtpgo_training.data.summary.recording_summary import summarise


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
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run ``mtpgo data``; the status is 1 if a recording cannot be read, 2 if none can."""
    sources = data_sources(args.data_options)
    if not sources:
        raise ConfigurationError("no directory is given, expected mtpgo data DIR --layout LAYOUT")
    for path in (args.picture, Path(args.json) if args.json not in (None, "-") else None):
        if path is not None:
            require_writable(path)
    cache = cache_from(args)
    picture = None
    if args.picture is not None:
        from mtpgo_training.reports.data_picture import PictureData

        picture = PictureData()
    summaries, unreadable = [], []
    for item in tqdm(
        _each(sources, cache), unit="recording", disable=not sys.stderr.isatty(), leave=False
    ):
        if isinstance(item, RecordingError):
            unreadable.append(Defect("unreadable", str(item)))
        elif len(item):
            summaries.append(summarise(item))
            if picture is not None:
                picture.add(item)
    if not summaries:
        reason = f": {unreadable[0].place}" if unreadable else ""
        raise RecordingError(f"no recording has a road user{reason}")
    summary = DataSummary(summaries, unreadable)
    text = json.dumps(summary.to_json(), indent=2, allow_nan=False)
    if args.json == "-":
        print(text)
    else:
        print(summary.to_text())
        if args.json is not None:
            write_text(Path(args.json), text + "\n")
    if args.picture is not None and picture is not None:
        from mtpgo_training.reports.data_picture import draw_data

        draw_data(summary, picture, args.picture)
    return 1 if unreadable else 0


def _each(
    sources: list[DataSource], cache: RecordingCache | None
) -> Iterator[Recording | RecordingError]:
    """Yield the recordings one after the other, or why one cannot be read."""
    for source in sources:
        for name in recording_names(*source):
            try:
                yield from iter_recordings(
                    source.directory, source.layout, [name], source.options, cache=cache
                )
            except RecordingError as error:
                yield error
