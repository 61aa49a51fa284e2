# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Conversion of recordings into rosbag2 MCAP bags of tracked objects, and copies of whole bags."""

from __future__ import annotations

import dataclasses
import functools
import sys
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from tqdm import tqdm

from mtpgo_core.errors import MessageError, RecordingError
from mtpgo_training.data.readers.checks.reading_remarks import remark
from mtpgo_training.data.recording import Recording
from mtpgo_training.data.recording_bag import DEFAULT_KIND, write_recording

if TYPE_CHECKING:
    from rosbags.interfaces import Connection

    from msg_adapters.bags.bag_reader import BagReader
    from msg_adapters.bags.mcap_writer import McapWriter

JOIN_GAP_S = 10.0
"""Pause between recordings in one bag (s); chosen longer than any history, so they never mix."""


@dataclass(frozen=True)
class Converted:
    """A bag that was written.

    Attributes:
        path: the file or directory.
        recordings: names of the recordings in it.
        messages: number of messages.
        frames: number of frames.
        duration_s: total duration of its recordings (s).
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
    sources: Collection[Path] = (),
    progress: bool = False,
) -> list[Converted]:
    """Write recordings as bags and return what was written.

    Several recordings become one bag each, ``output/NAME``, unless they are joined or ``output``
    is a file (ends in ``.mcap``). A single recording becomes ``output`` itself. Of several, those
    without a road user are left out with a remark.

    Args:
        recordings: taken one after the other, so only one needs to be in memory.
        output: a path that ends in ``.mcap`` for one self-contained file, else a directory.
        kind: short name of the tracked-object message.
        join: one bag for all, with pauses of ``JOIN_GAP_S``.
        sources: files that the recordings are read from, which are not replaced.
        progress: show a bar on stderr.

    Raises:
        RecordingError: nothing to write, or the output cannot be written.
        MessageError: the message kind cannot carry a recording.
    """
    write = functools.partial(_write, kind=kind, sources=sources, progress=progress)
    from msg_adapters.bags.mcap_writer import is_single_file

    if join or is_single_file(output):
        return [write(recordings, output)]
    iterator = iter(recordings)
    first, second = next(iterator, None), next(iterator, None)
    if first is None or second is None:
        return [write([first] if first else [], output)]
    empty: list[str] = []
    named = _with_road_users(_chain(first, second, iterator), empty)
    bags = [write([recording], output / recording.name) for recording in named]
    if not bags:
        raise _nothing_written(output)
    _remark_on(empty)
    return bags


def _require_apart(output: Path, sources: Collection[Path]) -> None:
    """Check that a bag would not overwrite one of its sources.

    Raises:
        RecordingError: it would, and other content of that file would be lost.
    """
    place = output.resolve()
    for source in sources:
        found = source.resolve()
        if found == place or place in found.parents:
            raise RecordingError(
                f"{output} would take the place of {source}, which is read, expected another"
                " output"
            )


@dataclass(frozen=True)
class CopiedBag:
    """A bag that was copied.

    Attributes:
        path: the file or directory.
        topics: names of the topics.
        messages: number of messages.
        duration_s: from the first to the last message (s).
        skipped: topics that were left out, in whole or in part -> why.
    """

    path: Path
    topics: frozenset[str]
    messages: int
    duration_s: float
    skipped: dict[str, str]


def copy_bag(bag: Path, output: Path, *, progress: bool = False) -> CopiedBag:
    """Write every message of every topic of a bag into a new one, as it was recorded.

    The readable part of a damaged bag becomes an intact bag.

    Args:
        bag: the bag.
        output: a path that ends in ``.mcap`` for one self-contained file, else a directory.
        progress: show a bar on stderr.

    Raises:
        RecordingError: the bag cannot be read, or the output cannot be written.
    """
    # Imported late: rosbags is not needed to complete or explain a command line.
    from msg_adapters.bags.bag_reader import BagReader
    from msg_adapters.bags.mcap_writer import McapWriter
    from msg_adapters.bags.stored_bag import bag_files

    if output.resolve() == bag.resolve():
        raise RecordingError(f"{output} is the bag itself, expected another output")
    _require_apart(output, bag_files(bag) if bag.is_dir() else [bag])
    with BagReader(bag) as source, McapWriter(output, replace=True, compress=True) as target:
        copied, skipped = _add_topics(source, target)
        if not copied:
            reasons = "; ".join(f"{topic}: {reason}" for topic, reason in skipped.items())
            raise RecordingError(f"no topic of {bag} can be copied: {reasons}")
        stored = source.stored(copied, source.start_ns, source.end_ns + 1)
        first_ns = last_ns = None
        for connection, time_ns, data in tqdm(
            stored,
            desc=bag.name,
            total=sum(one.msgcount for one in copied),
            file=sys.stderr,
            disable=not progress,
            leave=False,
        ):
            target.write_bytes(connection.topic, time_ns, data)
            first_ns, last_ns = time_ns if first_ns is None else first_ns, time_ns
        if not target.messages:
            raise RecordingError(f"nothing was written to {output}: {bag} has no message")
        duration_s = ((last_ns or 0) - (first_ns or 0)) * 1e-9
    return CopiedBag(
        output, frozenset(one.topic for one in copied), target.messages, duration_s, skipped
    )


def _add_topics(source: BagReader, target: McapWriter) -> tuple[list[Connection], dict[str, str]]:
    """Add the topics of a bag to a new one.

    Returns:
        The connections whose messages are to be copied, and the reasons why others are not, by
        topic.
    """
    from msg_adapters.bags.bag_definitions import BagDefinitions
    from msg_adapters.bags.bag_loss import counted

    topics, skipped = source.topics(), source.skipped()
    definitions = BagDefinitions(source.connections)
    copied: list[Connection] = []
    known: dict[str, tuple[str, list[tuple[str, str]]]] = {}
    for topic in topics:
        for connection in source.connections_of(topic):
            layout = definitions.layout(connection)
            first, usual = known.setdefault(topic.message_type, (topic.name, layout))
            if layout != usual:
                # The writer, as rosbag2's own, has one definition for a type.
                skipped[topic.name] = (
                    f"{counted(connection.msgcount)} with another definition of "
                    f"{topic.message_type} than those of {first}"
                )
                continue
            try:
                if not target.has_topic(topic.name):
                    target.add_recorded_topic(connection, definitions.type_hash(connection))
                copied.append(connection)
            except (MessageError, RecordingError) as error:
                skipped[topic.name] = str(error)
    return copied, skipped


def _chain(
    first: Recording, second: Recording, others: Iterator[Recording]
) -> Iterator[Recording]:
    yield first
    yield second
    yield from others


def _with_road_users(recordings: Iterable[Recording], empty: list[str]) -> Iterator[Recording]:
    """Yield the recordings that have road users, and append the names of the others to a list."""
    for recording in recordings:
        if len(recording):
            yield recording
        else:
            empty.append(recording.name)


def _nothing_written(path: Path) -> RecordingError:
    return RecordingError(f"nothing was written to {path}: no recording has a road user")


def _remark_on(empty: Sequence[str]) -> None:
    for name in empty:
        remark(f"the recording {name} has no road user in what is wanted of it: it is left out")


def _write(
    recordings: Iterable[Recording],
    path: Path,
    *,
    kind: str,
    sources: Collection[Path],
    progress: bool,
) -> Converted:
    """Write one bag of recordings, one after the other in time."""
    from msg_adapters.bags.mcap_writer import McapWriter

    _require_apart(path, sources)
    names, empty = list[str](), list[str]()
    frames, duration_s, next_start_ns = 0, 0.0, None
    with McapWriter(path, replace=True, compress=True) as bag:
        for recording in _with_road_users(recordings, empty):
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
            raise _nothing_written(path)
    _remark_on(empty)
    return Converted(path, tuple(names), bag.messages, frames, duration_s)


def selected(
    recordings: Iterable[Recording],
    *,
    start_s: float | None = None,
    end_s: float | None = None,
    ego_id: int | None = None,
    drop_parked: bool = False,
) -> Iterator[Recording]:
    """Yield the part of each recording that is wanted.

    Args:
        recordings: taken one after the other.
        start_s: begin, from the recording's first frame (s).
        end_s: end, from the recording's first frame (s).
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
