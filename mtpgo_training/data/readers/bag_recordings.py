# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Bags of tracked objects, of any message kind that the adapters know, as recordings."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from rosbags.interfaces import Connection

from msg_adapters.bags.bag_reader import DecodingBagReader, is_bag
from msg_adapters.inputs.lane_markers import lanes_from_markers
from mtpgo_core.class_map import ClassMap
from mtpgo_core.errors import MessageError, RecordingError
from mtpgo_core.history.track_index import sort_keys
from mtpgo_core.schema import Float64Array, TrackedStates
from mtpgo_training.data.readers.bag_poses import BagPoses
from mtpgo_training.data.readers.bag_topics import MARKERS, objects_topic
from mtpgo_training.data.readers.csv_table import sha256_of
from mtpgo_training.data.readers.drone_files import existing_directory, select_names
from mtpgo_training.data.readers.reading_options import AS_USUAL, ReadingOptions
from mtpgo_training.data.readers.reading_unit import Unit
from mtpgo_training.data.recording import Int64Array, Recording
from mtpgo_training.data.recording_bag import EGO_TOPIC, LANES_TOPIC

PIECE_GAP_S = 5.0
"""A longer pause between messages, or a step back in time, begins another recording (s); chosen
above the length of a history."""

_FREE_RATE = 1000.0
"""Frame rate of messages without a fixed rate (Hz); chosen: finer than any tracker's jitter."""


@dataclass
class _Piece:
    """The messages read since the last pause."""

    states: list[TrackedStates] = field(default_factory=list)
    lanes: tuple[Float64Array, ...] = ()
    ego: str | None = None
    received_ns: int | None = None

    def filled(self) -> Iterator[_Piece]:
        """Yield the piece itself if it has any road user."""
        if self.states:
            yield self


def bag_units(
    directory: Path, names: Sequence[str] | None = None, options: ReadingOptions = AS_USUAL
) -> list[Unit]:
    """Return a bag, or all bags in a directory.

    A bag with long pauses (several recordings joined) gives one recording per part, named
    ``BAG-1``, ``BAG-2`` and so on.

    Args:
        directory: a rosbag2 directory, an ``.mcap`` file, or a directory of bags.
        names: names of the bags wanted (without ``.mcap``), all by default.
        options: the class map.

    Raises:
        RecordingError: no bag there.
    """
    if is_bag(directory):
        found = {directory.stem if directory.suffix == ".mcap" else directory.name: directory}
    elif directory.is_file():
        raise RecordingError(f"{directory} is not a bag, expected an .mcap file or a directory")
    else:
        existing_directory(directory)
        bags = sorted(path for path in directory.iterdir() if is_bag(path))
        found = {path.stem if path.suffix == ".mcap" else path.name: path for path in bags}
        if not found:
            raise RecordingError(
                f"{directory} has no bags, expected .mcap files or rosbag2 directories"
            )
    read = functools.partial(_read_bag, classes=options.classes)
    return [
        Unit(name, "bag", _sources(found[name]), functools.partial(read, name, found[name]))
        for name in select_names(list(found), names, directory)
    ]


def _read_bag(name: str, path: Path, classes: ClassMap) -> Iterator[Recording]:
    """Yield the recordings of one bag.

    Raises:
        RecordingError: the bag is damaged, or none of its topics has tracked objects.
    """
    pieces = list(_pieces(path, classes))
    sha256 = sha256_of(_sources(path))
    for number, piece in enumerate(pieces, start=1):
        part = f"{name}-{number}" if len(pieces) > 1 else name
        yield _recording(part, piece, sha256 if len(pieces) == 1 else f"{sha256}#{number}")


def _sources(path: Path) -> list[Path]:
    if path.is_file():
        return [path]
    return sorted(p for p in path.iterdir() if p.suffix in (".mcap", ".db3", ".zstd"))


def _pieces(path: Path, classes: ClassMap) -> Iterator[_Piece]:
    with DecodingBagReader(path) as reader:
        objects, adapter = objects_topic(reader)
        others = [
            c
            for c in reader.connections
            if (c.topic.endswith(LANES_TOPIC) and c.msgtype == MARKERS)
            or (c.topic.endswith(EGO_TOPIC) and c.msgtype == "std_msgs/msg/String")
        ]
        poses = BagPoses(reader)
        piece, found = _Piece(), False
        for connection, received_ns, message in reader.messages([objects, *others]):
            if connection is not objects:
                # Latched messages of the next part come just before its first objects.
                if piece.received_ns is not None and _apart(piece.received_ns, received_ns):
                    yield from piece.filled()
                    piece = _Piece(lanes=piece.lanes, ego=piece.ego)
                _note(path, piece, connection, message)
                continue
            try:
                states = adapter.to_states(
                    message, fallback_stamp_ns=received_ns, class_map=classes
                )
            except MessageError as error:
                raise RecordingError(f"{path}, topic {connection.topic}: {error}") from error
            if piece.states and _apart(piece.states[-1].stamp_ns, states.stamp_ns):
                yield from piece.filled()
                piece = _Piece(lanes=piece.lanes, ego=piece.ego)
            piece.received_ns = received_ns
            lifted = poses.lift(states)
            if lifted is None or not len(lifted):
                continue
            states = lifted
            if piece.states and piece.states[-1].frame_id != states.frame_id:
                raise RecordingError(
                    f"{path}, topic {connection.topic}: the frame changes from "
                    f"{piece.states[-1].frame_id!r} to {states.frame_id!r}, expected one frame"
                )
            piece.states.append(_without_covariance(states))
            found = True
        if not found:
            reason = f": {poses.problem}" if poses.problem else ""
            raise RecordingError(
                f"{path} has no tracked object on its topic {objects.topic}{reason}"
            )
        yield from piece.filled()


def _note(path: Path, piece: _Piece, connection: Connection, message: object) -> None:
    """Keep the content of a latched message."""
    if connection.msgtype == MARKERS:
        try:
            piece.lanes = lanes_from_markers(message).polylines
        except MessageError as error:
            raise RecordingError(f"{path}, topic {connection.topic}: {error}") from error
    else:
        piece.ego = str(getattr(message, "data", ""))


def _without_covariance(states: TrackedStates) -> TrackedStates:
    """Return the states without the covariance, which a recording does not keep (memory)."""
    covariance = np.broadcast_to(np.nan, states.covariance.shape)
    return dataclasses.replace(states, covariance=covariance)


def _apart(before_ns: int, after_ns: int) -> bool:
    return not 0 <= after_ns - before_ns <= PIECE_GAP_S * 1e9


def _frames(stamps_ns: Int64Array) -> tuple[Int64Array, float]:
    """Return [messages] frame numbers from 0 and their rate (Hz), the messages' rate if steady."""
    elapsed_s = (stamps_ns - stamps_ns[0]) / 1e9
    steps_s = np.diff(elapsed_s)
    steps_s = steps_s[steps_s > 0]
    # Where many messages are missing, the rate follows from the shortest step, not the median.
    for step_s in (np.median(steps_s), steps_s.min()) if len(steps_s) else ():
        frame = np.round(elapsed_s / step_s)
        rate = float(frame[-1] / elapsed_s[-1])
        if abs(rate - round(rate, 1)) < 1e-4 * rate:
            rate = round(rate, 1)
        if (np.abs(frame / rate - elapsed_s) < 1e-4).all():
            return frame.astype(np.int64), rate
    return np.round(elapsed_s * _FREE_RATE).astype(np.int64), _FREE_RATE


def _recording(name: str, piece: _Piece, sha256: str) -> Recording:
    stamps_ns = np.array([states.stamp_ns for states in piece.states], dtype=np.int64)
    numbers, frame_rate = _frames(stamps_ns)
    count = [len(states) for states in piece.states]
    frame = np.repeat(numbers, count)
    keys = np.concatenate([states.key for states in piece.states])
    _, first, track = np.unique(sort_keys(keys), return_index=True, return_inverse=True)
    key = keys[first]
    # A message that comes twice adds nothing: the first row of a frame and track counts.
    _, rows = np.unique(np.stack([frame, track], axis=1), axis=0, return_index=True)

    def column(attribute: str) -> np.ndarray:
        return np.concatenate([getattr(states, attribute) for states in piece.states])

    small = (key[:, 2:] == 0).all(axis=1) & (key[:, 1] < 1 << 31)
    track_id = key[:, 0].astype(np.int64) + (key[:, 1].astype(np.int64) << 32)
    if not small.all():
        # Identities beyond 63 bits are replaced by a count; track_key keeps them.
        track_id = np.arange(len(key), dtype=np.int64)
    size, agent_class = _of_tracks(column("size"), column("agent_class"), track, first)
    ego = int(piece.ego) if piece.ego is not None and piece.ego.isdigit() else None
    return Recording(
        name=name,
        layout="bag",
        location="",
        frame_rate=frame_rate,
        frame=frame[rows],
        track=track[rows].astype(np.int64),
        position=column("position")[rows],
        velocity=column("velocity")[rows],
        acceleration=column("acceleration")[rows],
        yaw=column("yaw")[rows],
        track_id=track_id,
        agent_class=agent_class,
        size=size,
        lanes=piece.lanes,
        ego_id=ego if ego is not None and ego in track_id else None,
        sha256=sha256,
        start_time_ns=int(stamps_ns[0]),
        track_key=key,
    )


def _of_tracks(
    size: Float64Array, agent_class: np.ndarray, track: np.ndarray, first: np.ndarray
) -> tuple[Float64Array, np.ndarray]:
    """Return the last known size and class of each track."""
    out_size, out_class = size[first], agent_class[first]
    known = np.isfinite(size).all(axis=1)
    out_size[track[known]] = size[known]
    out_class[track[agent_class > 0]] = agent_class[agent_class > 0]
    return out_size, out_class
