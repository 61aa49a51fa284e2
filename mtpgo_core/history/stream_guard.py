# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The report on a message, and the check of a stream's clock and frame."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, auto

LATE_NS = 500_000_000
"""A message this much older than the newest one may mean that the clock was set back (ns); chosen
longer than any delay between two sensors of one tracker."""
_CONFIRMATIONS = 3
"""Consecutive messages that confirm a small jump of the clock or a change of frame. Chosen: two
can be an accident of two publishers, more would delay the new stream."""
_MOST_PATIENCE = 8
"""Factor on the confirmations of a jump of the clock, at most, where two publishers have different
clocks; chosen: a clock that was really set back is then believed after some seconds."""
_DOUBT_NS = 60_000_000_000
"""After this long without a message from behind there is one clock again (ns); chosen: six periods
of the slowest publisher."""


@dataclass(frozen=True)
class UpdateReport:
    """The outcome of one message; all counts are agents.

    Attributes:
        accepted: observations that entered the history.
        new_tracks: of these, first observations of an agent.
        restarted: of these, tracks started again after an impossible move (reused identity).
        alternating: of these, of tracks that alternate between two places, as if two publishers
            used the same identity.
        duplicates: dropped, the track has an observation with this stamp.
        late: dropped, the track has a newer observation.
        behind: of those accepted, too far behind the newest stamp to be carried on to it, so that
            they are not predicted: another publisher's clock is ahead.
        duplicate_keys: dropped, the identity occurs earlier in the message.
        non_finite: dropped, no usable position.
        too_fast: dropped, faster than ``max_speed_mps``.
        left_out: dropped, farther away than the nearest ``max_tracks`` of the message.
        dropped: new tracks dropped, and old ones evicted, for lack of room.
        wrong_frame: dropped with the message, see ``frame_changed``.
        forgotten: tracks forgotten because they were not seen for a whole window.
        clock_reset: the clock jumped back and the history was cleared.
        frame_changed: the message is in another frame than the history; it was rejected or, if
            ``wrong_frame`` is zero, started a new history.
    """

    accepted: int = 0
    new_tracks: int = 0
    restarted: int = 0
    alternating: int = 0
    duplicates: int = 0
    late: int = 0
    behind: int = 0
    duplicate_keys: int = 0
    non_finite: int = 0
    too_fast: int = 0
    left_out: int = 0
    dropped: int = 0
    wrong_frame: int = 0
    forgotten: int = 0
    clock_reset: bool = False
    frame_changed: bool = False


class MessageStatus(Enum):
    """How a message relates to the stream before it, by its frame and stamp."""

    CONTINUES = auto()
    UNEXPECTED_FRAME = auto()
    NEW_FRAME = auto()
    CLOCK_RESET = auto()


class StreamGuard:
    """Distinguishes single odd messages from a stream whose clock or frame has changed.

    A single message in another frame, or one from the recent past, is taken as an error; three in
    a row are taken as a change. A message older than the whole history means that the clock was
    set back. It was not if a message then goes on where the clock had been: two publishers have
    different clocks, and each would clear the history of the other. The next jump back therefore
    needs twice as many messages in a row, so that the publisher whose clock is ahead is served.

    Args:
        keep_ns: length of the history (ns).

    Attributes:
        newest_ns: newest stamp, None before the first message.
        frame_id: frame of the stream, None before the first object.
    """

    def __init__(self, keep_ns: int) -> None:
        self._keep_ns = keep_ns
        self.clear()

    def clear(self) -> None:
        """Forget the stream."""
        self.newest_ns: int | None = None
        self.frame_id: str | None = None
        self._unexpected_frame = ""
        self._unexpected = self._late = 0
        self._set_back_from_ns: int | None = None
        self._patience, self._doubted_ns = 1, 0

    def classify(self, stamp_ns: int, frame_id: str | None) -> MessageStatus:
        """Return the status of the next message, and track it unless its frame is unexpected.

        Args:
            stamp_ns: of the message.
            frame_id: of its objects, None where it has none.
        """
        status = self._classify(stamp_ns, frame_id)
        if status is MessageStatus.UNEXPECTED_FRAME:
            return status
        if status is not MessageStatus.CONTINUES:
            set_back_from_ns, patience = self.newest_ns, self._patience
            self.clear()
            if status is MessageStatus.CLOCK_RESET:
                self._set_back_from_ns, self._patience = set_back_from_ns, patience
                self._doubted_ns = stamp_ns
        if frame_id is not None:
            self._unexpected, self.frame_id = 0, frame_id
        self.newest_ns = stamp_ns if self.newest_ns is None else max(stamp_ns, self.newest_ns)
        return status

    def _classify(self, stamp_ns: int, frame_id: str | None) -> MessageStatus:
        if self.newest_ns is None:
            return MessageStatus.CONTINUES
        if frame_id is not None and self.frame_id is not None and frame_id != self.frame_id:
            self._unexpected = self._unexpected + 1 if frame_id == self._unexpected_frame else 1
            self._unexpected_frame = frame_id
            if self._unexpected < _CONFIRMATIONS:
                return MessageStatus.UNEXPECTED_FRAME
            return MessageStatus.NEW_FRAME
        behind_ns = self.newest_ns - stamp_ns
        if -behind_ns > LATE_NS and stamp_ns > (self._set_back_from_ns or stamp_ns):
            self._set_back_from_ns = None
            self._patience = min(2 * self._patience, _MOST_PATIENCE)
            self._doubted_ns = stamp_ns
        if behind_ns > LATE_NS:
            self._late, self._doubted_ns = self._late + 1, self.newest_ns
        else:
            self._late = 0
            if stamp_ns - self._doubted_ns > _DOUBT_NS:
                self._patience = 1
        needed = self._patience * (1 if behind_ns > self._keep_ns else _CONFIRMATIONS)
        jumped = self._late >= needed
        return MessageStatus.CLOCK_RESET if jumped else MessageStatus.CONTINUES
