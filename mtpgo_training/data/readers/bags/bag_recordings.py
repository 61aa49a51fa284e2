# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Bags of tracked objects, of any message kind that the adapters know, as recordings."""

from __future__ import annotations

import dataclasses
import functools
import os
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from msg_adapters.bags.bag_reader import (
    DecodingBagReader,
    bag_name,
    is_bag,
    is_or_begins_as_bag,
)
from msg_adapters.bags.sqlite_file import files_left_beside
from msg_adapters.bags.stored_bag import bag_files, has_bag_suffix, without_packed_copies
from msg_adapters.stamp_seconds import SLOWEST_PACE
from mtpgo_core.errors import RecordingError, found_names
from mtpgo_core.history.odd_input import described
from mtpgo_core.history.track_index import sort_keys
from mtpgo_core.history.track_update import usable_observations
from mtpgo_core.identity import first_key
from mtpgo_core.schema import BoolArray, Float64Array, KeyArray, tracked_states
from mtpgo_core.task.task_description import HistoryConfig
from mtpgo_training.data.readers.bags.bag_options import BagOptions
from mtpgo_training.data.readers.bags.bag_pieces import BagPiece, PieceReader
from mtpgo_training.data.readers.bags.bag_topics import objects_topic
from mtpgo_training.data.readers.bags.identity_moves import identity_moves
from mtpgo_training.data.readers.checks.reading_remarks import keep, remark
from mtpgo_training.data.readers.drone_files import (
    NoRecordingsError,
    existing_directory,
    select_names,
    visible_files,
)
from mtpgo_training.data.readers.file_hash import sha256_of
from mtpgo_training.data.readers.reading_options import AS_USUAL, ReadingOptions
from mtpgo_training.data.readers.reading_unit import Unit
from mtpgo_training.data.readers.tables.frame_grid import FREE_RATE, TOLERANCE_STEPS
from mtpgo_training.data.recording import Int64Array, Recording

_ROUNDING_S = 1e-6
"""Finest step in which recorders round their stamps (s)."""

_MOST_NAMES = 3
"""Folders that a sentence lists; chosen."""

_PACE_MESSAGES = 10
"""Fewer messages with the same stamp do not tell that their clock stands; chosen."""

_FASTEST_PACE = 10.0
"""Stamps that advance faster than the time at which they were recorded by more than this factor
are in another unit, if no two messages are near each other; chosen."""


def bag_units(
    directory: Path, names: Sequence[str] | None = None, options: ReadingOptions = AS_USUAL
) -> list[Unit]:
    """Return a bag, or all bags in a directory.

    A bag with long pauses (several recordings joined) gives one recording per part, named
    ``BAG-1``, ``BAG-2`` and so on.

    Args:
        directory: a rosbag2 directory, a bag file, or a directory of bags.
        names: names of the bags wanted (without the ending), all by default.
        options: what the user chose of the bags, and the class map.

    Raises:
        RecordingError: no bag there.
    """
    passed_over: list[str] = []
    if is_or_begins_as_bag(directory):
        bags = [directory]
    elif directory.is_file():
        raise RecordingError(
            f"{directory} is not a bag, expected an .mcap file (or .db3, .bag) or a directory"
        )
    else:
        existing_directory(directory, "a bag or a directory with bags")
        paths = visible_files(directory.iterdir(), directory)
        passed_over = [
            f"{path} is a link to {os.readlink(path)}, which does not exist"
            for path in paths
            if has_bag_suffix(path) and path.is_symlink() and not path.exists()
        ]
        bags = without_packed_copies([path for path in paths if is_bag(path)])
        below = [path for path in paths if path not in bags and _has_bags(path)]
        if below and bags:
            folders = found_names([path.name for path in below], _MOST_NAMES)
            passed_over.append(
                f"{directory}: the bags in {folders} are passed over, expected one folder of bags"
                " at a time"
            )
        if passed_over and not bags:
            raise RecordingError(passed_over[0])
        if not bags:
            raise NoRecordingsError(
                f"{directory} has no bags, expected .mcap files (or .db3, .bag) or rosbag2"
                " directories"
            )
    found: dict[str, Path] = {}
    for path in bags:
        if bag_name(path) in found:
            raise RecordingError(
                f"{found[bag_name(path)]} and {path} have the same name, expected bags of"
                " different names"
            )
        found[bag_name(path)] = path
    for name in options.bags.topics:
        if name not in found:
            raise RecordingError(
                f"{directory} has no bag {name}, for which --topics names a topic; it has"
                f" {', '.join(found)}"
            )
    chosen = select_names(list(found), names, directory)
    return [
        Unit(
            name,
            "bag",
            _sources(found[name]),
            functools.partial(_read_bag, name, found[name], options),
            settings={
                "topic": options.bags.topic_of(name),
                "stamps": options.bags.stamps,
                "twist_frame": options.bags.twist_frame,
                "fixed_frame": options.bags.fixed_frame,
                **_ego_settings(options.bags),
            },
            remarks=passed_over if name == chosen[0] else (),
        )
        for name in chosen
    ]


def _has_bags(path: Path) -> bool:
    """Return whether a path is a folder with bags."""
    try:
        return path.is_dir() and any(map(is_bag, visible_files(path.iterdir(), path)))
    except OSError:
        return False


def _ego_settings(options: BagOptions) -> dict[str, Any]:
    """Return what is read of the ego, nothing where it is not read."""
    if not options.ego_topic:
        return {}
    return {"ego_topic": options.ego_topic, "ego": dataclasses.asdict(options.ego)}


def _read_bag(name: str, path: Path, options: ReadingOptions) -> Iterator[Recording]:
    """Yield the recordings of one bag.

    Raises:
        RecordingError: the bag is damaged, or none of its topics has tracked objects.
    """
    with DecodingBagReader(path) as reader:
        skipped = reader.skipped()
        if skipped:
            listed = "; ".join(f"{topic}: {reason}" for topic, reason in skipped.items())
            remark(f"{path}: what cannot be read is left out: {listed}")
        topic = objects_topic(reader, options.bags.topic_of(name))
        if topic.others:
            remark(
                f"{path}: the objects are read from {topic.name}, and not from"
                f" {', '.join(topic.others)}; --topic chooses another one"
            )
        if topic.remark:
            remark(f"{path}, topic {topic.name}: {topic.remark}")
        piece_reader = PieceReader(reader, topic, options)
        found = [_recording(name, piece) for piece in piece_reader.pieces()]
        for sentence in reader.told:
            keep(sentence)
    for sentence in piece_reader.remarks:
        remark(sentence)
    recordings = [recording for recording in found if len(recording)]
    counts = Counter(piece_reader.rest)
    for recording in found if not recordings else ():
        counts.update(recording.counts)
    if not recordings:
        raise RecordingError(
            f"{path}, topic {topic.name}: no tracked object can be used ({described(counts)})"
        )
    _check_stamps(path, topic.name, piece_reader, recordings)
    last = recordings[-1]
    recordings[-1] = dataclasses.replace(last, counts=dict(Counter(last.counts) + counts))
    sha256 = sha256_of(_sources(path))
    if len(recordings) == 1:
        yield dataclasses.replace(recordings[0], sha256=sha256)
        return
    for number, recording in enumerate(recordings, start=1):
        part = f"{name}-{number}"
        yield dataclasses.replace(recording, name=part, sha256=f"{sha256}#{number}")


def _check_stamps(
    path: Path, topic: str, piece_reader: PieceReader, recordings: Sequence[Recording]
) -> None:
    """Check by the log times that the stamps of a bag are seconds and nanoseconds.

    Raises:
        RecordingError: they are in another unit, or all the same.
    """
    if (
        len(recordings) > 2
        and piece_reader.pace > _FASTEST_PACE
        and not any(recording.duration_s for recording in recordings)
    ):
        raise RecordingError(
            f"{path}, topic {topic}: its stamps advance {piece_reader.pace:.3g} times as "
            "fast as the time at which they were recorded, so that no two messages belong "
            "together; expected the time of the observation in seconds and nanoseconds"
        )
    if piece_reader.parts_of_seconds_are_wrong:
        raise RecordingError(
            f"{path}, topic {topic}: its stamps are all in the first millisecond of a second,"
            " as with microseconds or milliseconds in the field of nanoseconds; expected the time"
            " of the observation in seconds and nanoseconds"
        )
    if piece_reader.pace < SLOWEST_PACE:  # false for NaN
        remark(
            f"{path}, topic {topic}: its stamps advance {piece_reader.pace:.3g} times as fast"
            " as the time at which they were recorded; expected the time of the observation in"
            " seconds and nanoseconds"
        )
    if (
        piece_reader.used >= _PACE_MESSAGES
        and piece_reader.recorded_s >= 1.0
        and not piece_reader.moved_s
    ):
        raise RecordingError(
            f"{path}, topic {topic}: its {piece_reader.used} messages all have the same"
            f" stamp, while they were recorded over {piece_reader.recorded_s:.1f} s; expected the"
            " time of the observation in seconds and nanoseconds"
        )


def _sources(path: Path) -> list[Path]:
    """Return the files of a bag, with those that a killed recorder left beside them."""
    files = [path] if path.is_file() else bag_files(path)
    return sorted(one for file in files for one in (file, *files_left_beside(file)))


def _frames(stamps_ns: Int64Array) -> tuple[Int64Array, float]:
    """Return [messages] frame numbers from 0 and their rate (Hz), the messages' rate if steady."""
    elapsed_s = (stamps_ns - stamps_ns[:1]) / 1e9
    steps_s = np.diff(elapsed_s)
    steps_s = steps_s[steps_s > 0]
    # Where many messages are missing, the rate follows from the shortest step, not the median.
    for step_s in (np.median(steps_s), steps_s.min()) if len(steps_s) else ():
        frame = np.round(elapsed_s / step_s)
        mean = float(frame[-1] / elapsed_s[-1])
        film = round(mean * 1.001) / 1.001
        likely = [r for r in (round(mean, 1), film, round(mean, 3)) if abs(r - mean) < 1e-4 * mean]
        off_s = {rate: np.abs(frame / rate - elapsed_s).max() for rate in (*likely, mean)}
        # One that gives the stamps as they are, else the first that is near enough.
        rates = sorted(off_s, key=lambda rate: off_s[rate] > _ROUNDING_S)
        for rate in rates:
            if off_s[rate] < min(1e-4, TOLERANCE_STEPS / rate):
                return frame.astype(np.int64), rate
    return np.round(elapsed_s * FREE_RATE).astype(np.int64), FREE_RATE


def _recording(name: str, piece: BagPiece) -> Recording:
    """Return the recording of a piece, without the rows that the node drops."""
    stamps_ns = np.array([states.stamp_ns for states in piece.states], dtype=np.int64)
    message = np.repeat(np.arange(len(stamps_ns)), [len(states) for states in piece.states])

    def column(attribute: str) -> np.ndarray:
        return np.concatenate([getattr(states, attribute) for states in piece.states])

    keys, position, velocity = column("key"), column("position"), column("velocity")
    key, track = _tracks(keys)
    accepted, counts = _accepted(message, track, stamps_ns, position, velocity, keys)
    agent_class = column("agent_class")
    counts["unknown_class"] = int(np.count_nonzero(agent_class == 0))
    # In order of time, which is not that of the messages where two sensors are merged.
    rows = np.flatnonzero(accepted)
    rows = rows[np.lexsort((track[rows], stamps_ns[message[rows]]))]
    row_ns = stamps_ns[message[rows]]
    counts.update(identity_moves(track[rows], row_ns, position[rows], key))
    stamps, frame_of = np.unique(row_ns, return_inverse=True)
    numbers, frame_rate = _frames(stamps)
    frame = numbers[frame_of]
    # Two stamps may fall on the same frame of a free rate: the first row of a track counts.
    again = (np.diff(frame, prepend=-1) == 0) & (np.diff(track[rows], prepend=-1) == 0)
    rows, frame = rows[~again], frame[~again]
    kept, track = np.unique(track[rows], return_inverse=True)
    key = key[kept]

    small = (key[:, 2:] == 0).all(axis=1) & (key[:, 1] < 1 << 31)
    track_id = key[:, 0].astype(np.int64) + (key[:, 1].astype(np.int64) << 32)
    if not small.all():
        # Identities beyond 63 bits are replaced by a count; track_key keeps them.
        track_id = np.arange(len(key), dtype=np.int64)
    size, track_class = _of_tracks(column("size")[rows], agent_class[rows], track)
    ego: int | None = None
    ego_key = first_key(piece.ego or "") if piece.ego_key is None else piece.ego_key
    if ego_key is not None:
        rows_of_ego = np.flatnonzero((key == ego_key).all(axis=1))
        ego = int(track_id[rows_of_ego[0]]) if len(rows_of_ego) else None
    return Recording(
        name=name,
        layout="bag",
        location="",
        frame_rate=frame_rate,
        frame=frame,
        track=track.astype(np.int64),
        position=position[rows],
        velocity=velocity[rows],
        acceleration=column("acceleration")[rows],
        yaw=column("yaw")[rows],
        track_id=track_id,
        agent_class=track_class,
        size=size,
        lanes=piece.lanes,
        ego_id=ego,
        start_time_ns=int(stamps_ns[0] if not len(stamps) else stamps[0]),
        track_key=key,
        counts={name: count for name, count in (piece.counts + counts).items() if count},
    )


def _tracks(keys: KeyArray) -> tuple[KeyArray, Int64Array]:
    """Return the distinct identities, ascending, and [rows] the index of each row's."""
    names: np.ndarray
    if not keys[:, 2:].any():  # numbers are sorted faster than texts
        names = keys[:, 0].astype(np.uint64) | keys[:, 1].astype(np.uint64) << np.uint64(32)
    else:
        names = sort_keys(keys)
    _, first, track = np.unique(names, return_index=True, return_inverse=True)
    return keys[first], track.astype(np.int64)


def _accepted(
    message: Int64Array,
    track: Int64Array,
    stamps_ns: Int64Array,
    position: Float64Array,
    velocity: Float64Array,
    keys: KeyArray,
) -> tuple[BoolArray, Counter[str]]:
    """Return [rows] which rows the node would accept, and the counters of the others.

    A row must be usable, the first of its track in its message, and newer than all of its track
    before it.

    Args:
        message: [rows] number of the message, in the order of the recording.
        track: [rows] index of the track.
        stamps_ns: [messages] (ns).
        position: [rows, 2] (m).
        velocity: [rows, 2] (m/s).
        keys: [rows, 4] identities.
    """
    states = tracked_states(0, "", keys, position, velocity=velocity)
    finite, too_fast = usable_observations(HistoryConfig(), states)
    usable = finite & ~too_fast
    rows = np.flatnonzero(usable)
    rows = rows[np.argsort(track[rows], kind="stable")]
    # One number for track and time, so that one running maximum serves all tracks.
    distinct, order = np.unique(stamps_ns, return_inverse=True)
    value = track[rows] * (len(distinct) + 1) + order[message[rows]]
    newest = np.maximum.accumulate(value)
    before = np.concatenate([[-1], newest[:-1]])
    repeated = np.zeros(len(rows), dtype=np.bool_)
    repeated[1:] = (np.diff(track[rows]) == 0) & (np.diff(message[rows]) == 0)
    fresh = (value > before) & ~repeated
    accepted = np.zeros(len(track), dtype=np.bool_)
    accepted[rows[fresh]] = True
    counts = Counter(
        non_finite=int((~finite).sum()),
        too_fast=int(too_fast.sum()),
        duplicate_keys=int(repeated.sum()),
        duplicates=int(((value == before) & ~repeated).sum()),
        late=int(((value < before) & ~repeated).sum()),
    )
    return accepted, counts


def _of_tracks(
    size: Float64Array, agent_class: np.ndarray, track: Int64Array
) -> tuple[Float64Array, np.ndarray]:
    """Return the last known size and class of each track; the rows are in order of time."""
    _, first = np.unique(track, return_index=True)
    out_size, out_class = size[first], agent_class[first]
    known = np.isfinite(size).all(axis=1)
    out_size[track[known]] = size[known]
    out_class[track[agent_class > 0]] = agent_class[agent_class > 0]
    return out_size, out_class
