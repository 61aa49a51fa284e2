# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The messages of a bag by the rules by which the node takes them, in pieces without a break.

What the node drops is left out here, and counted by the same names
(:data:`mtpgo_core.history.odd_input.ODD_INPUT`). A jump of the clock or a new frame, where the
node clears its history, begins another piece; so does a long pause.
"""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Container, Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from rosbags.interfaces import Connection

from msg_adapters.adapter import InputAdapter
from msg_adapters.bags.bag_definitions import obstacle
from msg_adapters.bags.bag_reader import DecodingBagReader
from msg_adapters.inputs.ego_odometry import EGO_NAME, EgoOdometry
from msg_adapters.inputs.lane_markers import lanes_from_markers
from msg_adapters.inputs.odometry import ODOMETRY
from msg_adapters.stamp_seconds import StampSeconds
from mtpgo_core.errors import FrameError, MessageError, RecordingError, found_names
from mtpgo_core.frames import moves_with_vehicle
from mtpgo_core.history.odd_input import described
from mtpgo_core.history.stream_guard import MessageStatus, StreamGuard
from mtpgo_core.identity import keys_from_texts
from mtpgo_core.schema import Float64Array, KeyArray, TrackedStates
from mtpgo_core.task.task_description import HistoryConfig
from mtpgo_training.data.readers.bags.bag_poses import BagPoses
from mtpgo_training.data.readers.bags.bag_topics import (
    MARKERS,
    ObjectsTopic,
    nearest_first,
    shared_namespaces,
)
from mtpgo_training.data.readers.reading_options import ReadingOptions
from mtpgo_training.data.recording_bag import EGO_TOPIC, LANES_TOPIC

PIECE_GAP_S = 5.0
"""A longer pause between messages begins another piece (s); chosen above the length of a
history."""

_AHEAD_NS = 1_000_000_000
"""A single message whose stamp runs ahead of the recorder's clock by more than this is left out
(ns): the default of the node's ``stamp_tolerance``."""
_CONFIRMATIONS = 3
"""Consecutive messages ahead of the clock after which the stream's clock is accepted, as in the
node."""


class _Message(NamedTuple):
    """The content of a message, and its log time (ns)."""

    states: TrackedStates
    received_ns: int

    def is_ahead(self, other: _Message) -> bool:
        """Return whether its stamp runs ahead of another message's, by the log times."""
        stamp_ns = self.states.stamp_ns - other.states.stamp_ns
        return stamp_ns - (self.received_ns - other.received_ns) > _AHEAD_NS

    @property
    def is_from_the_future(self) -> bool:
        """Whether its stamp is ahead of the recorder's clock."""
        return self.states.stamp_ns - self.received_ns > _AHEAD_NS


@dataclass
class BagPiece:
    """Messages that follow each other without a break.

    Attributes:
        states: content of each message, in the order in which they were recorded.
        lanes: lane markings.
        ego: last text on the ego's topic.
        ego_key: [4] identity of the ego that its odometry has added, None without one.
        counts: what was odd, by counter; the rules for single objects are not applied yet.
        received_ns: log time of the last message (ns).
    """

    states: list[TrackedStates] = field(default_factory=list)
    lanes: tuple[Float64Array, ...] = ()
    ego: str | None = None
    ego_key: KeyArray | None = None
    counts: Counter[str] = field(default_factory=Counter)
    received_ns: int | None = None


class PieceReader:
    """Reads the tracked objects of a bag.

    Args:
        reader: the bag.
        topic: the topic of the objects.
        options: where missing stamps come from, the class map and the ego.
        taken: stamps (ns) of messages that the node has taken, whatever its clock was; known where
            its predictions from them were recorded.

    Raises:
        RecordingError: the topic of the ego's odometry is not in the bag.

    Attributes:
        remarks: what a user should know, one sentence each, known at the end.
        rest: what was odd after the last piece, by counter.
        used: number of messages that have a stamp and objects in a fixed frame.
    """

    def __init__(
        self,
        reader: DecodingBagReader,
        topic: ObjectsTopic,
        options: ReadingOptions,
        taken: Container[int] = (),
    ) -> None:
        self.remarks: list[str] = []
        self.rest: Counter[str] = Counter()
        self.used = 0
        self._reader, self._topic = reader, topic
        self._log_stamps = options.bags.stamps == "log"
        self._classes, self._twist_frame = options.classes, options.bags.twist_frame
        self._where = f"{reader.path}, topic {topic.name}"
        self._poses = BagPoses(reader, topic.name, options.bags.fixed_frame)
        self._guard = StreamGuard(HistoryConfig().keep_ns)
        self._taken = taken
        self._ahead: list[_Message] = []
        self._newest: _Message | None = None
        self._messages = 0
        self._first: _Message | None = None
        self._last: _Message | None = None
        self._stamps_moved_ns = 0
        self._seconds = StampSeconds()
        self._problem = ""
        self._frames: set[str] = set()
        self._piece = BagPiece()
        self._ego, self._ego_connections = None, _odometry(reader, options.bags.ego_topic)
        if self._ego_connections:
            self._ego = EgoOdometry(options.bags.ego)

    @property
    def pace(self) -> float:
        """How fast the stamps advance, as a multiple of the time at which they were recorded.

        NaN where it is not known: with less than a second, or a clock that was set back.
        """
        if self._first is None or self._last is None:
            return float("nan")
        logged_ns = self._last.received_ns - self._first.received_ns
        stamped_ns = self._last.states.stamp_ns - self._first.states.stamp_ns
        return stamped_ns / logged_ns if logged_ns >= 1e9 and stamped_ns > 0 else float("nan")

    @property
    def parts_of_seconds_are_wrong(self) -> bool:
        """Whether the stamps have microseconds or milliseconds in the field of nanoseconds."""
        return self._seconds.are_of_another_unit

    @property
    def moved_s(self) -> float:
        """How far the stamps have moved, forwards and backwards (s)."""
        return self._stamps_moved_ns * 1e-9

    @property
    def recorded_s(self) -> float:
        """Log time from the first to the last message that is used (s); 0 without one."""
        if self._first is None or self._last is None:
            return 0.0
        return (self._last.received_ns - self._first.received_ns) * 1e-9

    def pieces(self) -> Iterator[BagPiece]:
        """Yield the pieces that have a road user.

        Raises:
            RecordingError: the bag is damaged, or no message has a road user.
        """
        objects = {id(connection) for connection in self._topic.connections}
        others = self._context()
        odometry = {id(connection) for connection in self._ego_connections}
        found = 0

        def refused(connection: Connection, reason: str) -> None:
            if id(connection) in objects:
                self._messages += 1
                self._count("malformed", reason)
            elif id(connection) in odometry:
                self._count("ego_refused", reason)
            else:
                self._remark_on(connection, reason)

        for connection, received_ns, message in self._reader.messages(
            [*self._topic.connections, *others, *self._ego_connections], refused
        ):
            done: list[BagPiece | None] = []
            if id(connection) in odometry:
                self._add_odometry(message)
            elif id(connection) in objects:
                self._messages += 1
                states = self._read(self._topic.adapter, message, received_ns)
                if states is not None:
                    self.used += 1
                    if self._last is not None:
                        step_ns = states.stamp_ns - self._last.states.stamp_ns
                        self._stamps_moved_ns += abs(step_ns)
                    self._seconds.add(states.stamp_ns, received_ns)
                    self._last = _Message(states, received_ns)
                    self._first = self._first or self._last
                    usable = self._usable(self._last)
                    done = [self._add(one) for one in usable]
                self._piece.received_ns = received_ns
            else:
                # Latched messages of the next piece come just before its first objects.
                if _apart(self._piece.received_ns, received_ns):
                    done = [self._next_piece()]
                self._note(connection, message)
            for piece in done:
                if piece is not None:
                    found += 1
                    yield piece
        for _ in self._ahead:
            self._count("future_stamp")
        if self._piece.states:
            found += 1
            yield self._piece
        elif not found:
            raise RecordingError(self._nothing(self._piece.counts))
        else:
            self.rest = self._piece.counts

    def _context(self) -> list[Connection]:
        """Return the connections of lane markings and of the ego that belong to the objects."""
        found: list[Connection] = []
        for ending, kind in ((LANES_TOPIC, MARKERS), (EGO_TOPIC, "std_msgs/msg/String")):
            there = [
                c
                for c in self._reader.connections
                if c.topic.endswith(ending)
                and c.msgtype == kind
                and c.msgcount
                and not obstacle(c)
            ]
            names = nearest_first({c.topic for c in there}, self._topic.name)
            alike = [n for n in names[1:] if _near(n, self._topic) == _near(names[0], self._topic)]
            if alike:
                self.remarks.append(
                    f"{self._where}: {names[0]} is read with the objects, and not"
                    f" {found_names(alike)}"
                )
            found += [c for c in there if c.topic == names[0]]
        return found

    def _read(
        self, adapter: InputAdapter, message: object, received_ns: int
    ) -> TrackedStates | None:
        """Return the states of a message in a fixed frame, None if it is left out."""
        counts = self._piece.counts
        try:
            decoded = adapter.decode(
                message,
                twist_frame=self._twist_frame,
                fallback_stamp_ns=received_ns,
                class_map=self._classes,
            )
        except MessageError as error:
            self._count("malformed", str(error))
            return None
        states = decoded.states
        if decoded.skipped:
            counts["skipped_objects"] += decoded.skipped_total
            self._problem = self._problem or next(iter(decoded.skipped))
        if states.stamp_ns <= 0 and self._log_stamps:
            states = dataclasses.replace(states, stamp_ns=received_ns)
        if states.stamp_ns <= 0:  # before 1970, as in the node
            self._count("unstamped")
            return None
        try:
            return self._with_ego(self._poses.lift(states))
        except FrameError as error:
            self._count("not_lifted", str(error))
            return None

    def _add_odometry(self, message: object) -> None:
        """Keep the ego's pose."""
        assert self._ego is not None
        try:
            self._ego.add(message)
        except MessageError as error:
            self._count("ego_refused", str(error))

    def _with_ego(self, states: TrackedStates) -> TrackedStates:
        """Return the objects with the ego, by its odometry up to then, as in the node."""
        if self._ego is None:
            return states
        self._piece.ego_key = keys_from_texts([self._piece.ego or EGO_NAME])[0]
        joined = self._ego.join(states, self._piece.ego_key, self._poses.lift)
        if not joined.known:
            self._count("ego_missing", f"the ego is not known: {joined.problem}")
        return joined.states

    def _usable(self, new: _Message) -> list[_Message]:
        """Return the messages to add now; none if a stamp ahead of the clock has to be confirmed.

        The node's rule, with the recorder's clock: a single such stamp would make all later ones
        look old, a stream that stays ahead has another clock. As the log times of many bags are
        of another clock than the stamps, only what passed since the newest message is compared.
        Where a stream leaps without being ahead of the recorder's clock, as between recordings
        that are played one after the other, the node takes its first messages as well.
        """
        is_ahead = self._newest is not None and new.is_ahead(self._newest)
        confirmed = len(self._ahead) + 1 == _CONFIRMATIONS or new.states.stamp_ns in self._taken
        if is_ahead and not confirmed:
            self._ahead.append(new)
            return []
        usable = []
        for message in self._ahead:
            if not is_ahead or message.is_from_the_future or message.is_ahead(new):
                self._count("future_stamp")
            else:
                usable.append(message)
        self._ahead = []
        if is_ahead and new.is_from_the_future:
            self._count("future_stamp")
        return [*usable, new]

    def _add(self, new: _Message) -> BagPiece | None:
        """Add a message to the current piece, or to the next one; return a piece that it ends."""
        states = new.states
        newest_ns = self._guard.newest_ns
        status = self._guard.classify(states.stamp_ns, states.frame_id if len(states) else None)
        if states.stamp_ns == self._guard.newest_ns:
            self._newest = new
        counts, done = self._piece.counts, None
        if status is MessageStatus.UNEXPECTED_FRAME:
            counts["frame_changed"] += 1
            counts["wrong_frame"] += len(states)
            return None
        if status is not MessageStatus.CONTINUES:
            name = "clock_reset" if status is MessageStatus.CLOCK_RESET else "frame_changed"
            counts[name] += 1
            done = self._next_piece()
        elif newest_ns is not None and states.stamp_ns - newest_ns > PIECE_GAP_S * 1e9:
            done = self._next_piece()
        if len(states):
            self._warn_of_moving_frame(states.frame_id)
            # A recording does not keep the covariance.
            nothing = np.broadcast_to(np.nan, states.covariance.shape)
            self._piece.states.append(dataclasses.replace(states, covariance=nothing))
        return done

    def _next_piece(self) -> BagPiece | None:
        """Begin another piece and return the one before if it has a road user."""
        before = self._piece
        self._piece = BagPiece(lanes=before.lanes, ego=before.ego, ego_key=before.ego_key)
        if before.states:
            return before
        self._piece.counts = before.counts
        return None

    def _note(self, connection: Connection, message: object) -> None:
        """Keep the content of a latched message."""
        if connection.msgtype == MARKERS:
            try:
                self._piece.lanes = lanes_from_markers(message).polylines
            except MessageError as error:
                self._remark_on(connection, str(error))
        else:
            self._piece.ego = str(getattr(message, "data", ""))

    def _remark_on(self, connection: Connection, problem: str) -> None:
        """Note that a message on a topic beside the objects is not used."""
        where = f"{self._reader.path}, topic {connection.topic}"
        sentence = f"{where}: a message is left out: {problem}"
        if sentence not in self.remarks:
            self.remarks.append(sentence)

    def _count(self, name: str, problem: str = "") -> None:
        self._piece.counts[name] += 1
        self._problem = self._problem or problem

    def _warn_of_moving_frame(self, frame: str) -> None:
        if frame in self._frames:
            return
        self._frames.add(frame)
        if not frame:
            sentence = (
                f"{self._where}: objects come without the name of a frame: they are read as in a"
                " fixed one"
            )
        elif moves_with_vehicle(frame):
            sentence = (
                f"{self._where}: objects come in frame {frame!r}, which usually moves with the"
                " vehicle, expected odometry or transforms of it in the bag"
            )
        elif self._poses.is_apart(frame):
            sentence = (
                f"{self._where}: objects come in frame {frame!r}, which the bag's transforms do"
                " not connect with the vehicle or a fixed frame: it is read as a fixed one"
            )
        else:
            return
        self.remarks.append(sentence)

    def _nothing(self, counts: Counter[str]) -> str:
        """Return why there is no road user."""
        nothing = f"{self._reader.path} has no tracked object on its topic {self._topic.name}"
        if counts["unstamped"] == self._messages > 0:
            if self._log_stamps:
                return (
                    f"{nothing}: none of its {self._messages} messages has a stamp or a time at"
                    " which it was recorded"
                )
            return (
                f"{nothing}: none of its {self._messages} messages has a stamp, expected the time"
                " of the observation in the header; --stamps log takes the time at which a message"
                " was recorded"
            )
        if self.used == self._messages > 0 and not described(counts):
            return f"{nothing}: its {self._messages} message(s) are all empty"
        odd = described(counts)
        among = f" ({odd})" if odd else ""
        because = f": {self._problem}" if self._problem else ""
        return f"{nothing}{because}{among}"


def _odometry(reader: DecodingBagReader, topic: str) -> list[Connection]:
    """Return the connections of the ego's odometry, none without a topic.

    Raises:
        RecordingError: the topic is not in the bag.
    """
    if not topic:
        return []
    there = [c for c in reader.connections if c.msgtype == ODOMETRY and not obstacle(c)]
    found = [c for c in there if c.topic == "/" + topic.lstrip("/")]
    if not found:
        names = found_names(sorted({c.topic for c in there}))
        raise RecordingError(
            f"{reader.path} has no {ODOMETRY} on the topic {topic} of the ego, expected one of its"
            f" topics of that type: {names}"
        )
    return found


def _near(name: str, topic: ObjectsTopic) -> int:
    return shared_namespaces(name, topic.name)


def _apart(before_ns: int | None, after_ns: int) -> bool:
    return before_ns is not None and not 0 <= after_ns - before_ns <= PIECE_GAP_S * 1e9
