# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``mtpgo convert``: recordings of any layout into rosbag2 MCAP bags of tracked objects."""

from __future__ import annotations

import argparse
import dataclasses
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from tqdm import tqdm

from msg_adapters.registry import INPUTS
from mtpgo_core.errors import RecordingError
from mtpgo_training.bag import DEFAULT_KIND, create_bag, write_recording
from mtpgo_training.readers import LAYOUTS, iter_recordings
from mtpgo_training.recording import Recording

JOIN_GAP_S = 10.0
"""Pause between recordings in one bag (s): longer than any history, so they never mix."""


@dataclass(frozen=True)
class Converted:
    """One bag written.

    Attributes:
        path: the file or directory.
        recordings: names of the recordings in it.
        messages: number of messages.
        frames: number of frames.
        duration_s: time that its recordings last (s).
    """

    path: Path
    recordings: tuple[str, ...]
    messages: int
    frames: int
    duration_s: float


def convert(
    recordings: Iterable[Recording],
    output: Path,
    *,
    kind: str = DEFAULT_KIND,
    join: bool = False,
    progress: bool = False,
) -> list[Converted]:
    """Write recordings as bags.

    Several recordings become one bag each, ``output/NAME``, unless they are joined or ``output``
    is a file (ends in ``.mcap``). A single one becomes ``output`` itself.

    Args:
        recordings: taken one after the other, so only one needs to be in memory.
        output: a path that ends in ``.mcap`` for one self-contained file, else a directory.
        kind: short name of the tracked-object message.
        join: one bag for all, with pauses of ``JOIN_GAP_S``.
        progress: show a bar on stderr.

    Raises:
        RecordingError: nothing to write, or the output cannot be written.
        MessageError: the message kind cannot carry a recording.
    """
    if join or output.suffix == ".mcap":
        return [_write(recordings, output, kind, progress)]
    iterator = iter(recordings)
    first, second = next(iterator, None), next(iterator, None)
    if first is None or second is None:
        return [_write([first] if first else [], output, kind, progress)]
    return [
        _write([recording], output / recording.name, kind, progress)
        for recording in _chain(first, second, iterator)
    ]


def _chain(
    first: Recording, second: Recording, others: Iterator[Recording]
) -> Iterator[Recording]:
    yield first
    yield second
    yield from others


def _write(recordings: Iterable[Recording], path: Path, kind: str, progress: bool) -> Converted:
    """One bag of recordings, one after the other in time."""
    names: list[str] = []
    frames, duration_s, next_start_ns = 0, 0.0, None
    with create_bag(path) as bag:
        for recording in recordings:
            if not len(recording):
                continue
            first_ns = recording.stamp_ns(int(recording.frame[0]))
            shift_ns = 0 if next_start_ns is None else next_start_ns - first_ns
            written = write_recording(bag, recording, kind=kind, shift_ns=shift_ns)
            with tqdm(
                written,
                desc=f"{path.name}: {recording.name}",
                total=len(recording.frames),
                unit="frame",
                file=sys.stderr,
                disable=not progress,
                leave=False,
            ) as bar:
                frames += sum(1 for _ in bar)
            last_ns = recording.stamp_ns(int(recording.frame[-1])) + shift_ns
            next_start_ns = last_ns + round(JOIN_GAP_S * 1e9)
            names.append(recording.name)
            duration_s += recording.duration_s
        if not names:
            raise RecordingError(f"nothing was written to {path}: no recording has a road user")
    return Converted(path, tuple(names), bag.messages, frames, duration_s)


def selected(
    recordings: Iterable[Recording],
    *,
    start_s: float | None = None,
    end_s: float | None = None,
    ego_id: int | None = None,
    drop_parked: bool = False,
) -> Iterator[Recording]:
    """The part of each recording that is wanted.

    Args:
        recordings: taken one after the other.
        start_s: time from the recording's first frame (s).
        end_s: likewise.
        ego_id: track to be marked as ego.
        drop_parked: leave out road users that never move.

    Raises:
        RecordingError: the ego is in none of the recordings.
    """
    names, found = [], ego_id is None
    for recording in recordings:
        recording = recording.between(start_s, end_s)
        if drop_parked:
            recording = recording.without_parked()
        if ego_id is not None and ego_id in recording.track_id:
            recording = dataclasses.replace(recording, ego_id=ego_id)
            found = True
        names.append(recording.name)
        yield recording
    if not found:
        raise RecordingError(
            f"the ego {ego_id} is in none of the recordings {', '.join(names)} in the time chosen"
        )


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
