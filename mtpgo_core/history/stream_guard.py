# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What became of a message, and whether the stream of messages can be believed."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, auto

_LATE_NS = 500_000_000
_PATIENCE = 3
"""Messages in a row it takes to believe a small jump of the clock or a change of frame."""


@dataclass(frozen=True)
class UpdateReport:
    """What became of one message; all counts are agents.

    Attributes:
        accepted: observations that entered the history.
        new_tracks: of these, first observations of an agent.
        restarted: of these, tracks begun anew because of an impossible move (reused identity).
        duplicates: dropped, the track has an observation with this stamp.
        late: dropped, the track has a newer observation.
        duplicate_keys: dropped, the identity stands in the message already.
        non_finite: dropped, no usable position.
        too_fast: dropped, faster than ``max_speed_mps``.
        dropped: new tracks dropped, and old ones evicted, for lack of room.
        wrong_frame: dropped with the message, see ``frame_changed``.
        forgotten: tracks forgotten because they were not seen for a whole window.
        clock_reset: the clock jumped back and the past was forgotten.
        frame_changed: the message came in another frame than the past; rejected, or, when
            ``wrong_frame`` is zero, taken as the start of a new past.
    """

    accepted: int = 0
    new_tracks: int = 0
    restarted: int = 0
    duplicates: int = 0
    late: int = 0
    duplicate_keys: int = 0
    non_finite: int = 0
    too_fast: int = 0
    dropped: int = 0
    wrong_frame: int = 0
    forgotten: int = 0
    clock_reset: bool = False
    frame_changed: bool = False


class Verdict(Enum):
    """What a message's frame and stamp say about it."""

    CONTINUES = auto()
    STRANGE_FRAME = auto()
    NEW_FRAME = auto()
    CLOCK_RESET = auto()


class StreamWatch:
    """Tells odd messages from a stream that has really changed.

    One message in another frame, or one from the recent past, is an accident; three in a row are
    the truth. A message older than everything that is remembered can only mean that the clock was
    set back.

    Args:
        keep_ns: how far back the history remembers (ns).

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
        self._strange_frame = ""
        self._strange = self._late = 0

    def judge(self, stamp_ns: int, frame_id: str | None) -> Verdict:
        """Judge the next message and remember it, unless it is of a strange frame.

        Args:
            stamp_ns: of the message.
            frame_id: of its objects, None where it has none.
        """
        verdict = self._judge(stamp_ns, frame_id)
        if verdict is Verdict.STRANGE_FRAME:
            return verdict
        if verdict is not Verdict.CONTINUES:
            self.clear()
        self._strange = 0
        self.frame_id = frame_id if frame_id is not None else self.frame_id
        self.newest_ns = stamp_ns if self.newest_ns is None else max(stamp_ns, self.newest_ns)
        return verdict

    def _judge(self, stamp_ns: int, frame_id: str | None) -> Verdict:
        if self.newest_ns is None:
            return Verdict.CONTINUES
        if frame_id is not None and self.frame_id is not None and frame_id != self.frame_id:
            self._strange = self._strange + 1 if frame_id == self._strange_frame else 1
            self._strange_frame = frame_id
            return Verdict.NEW_FRAME if self._strange >= _PATIENCE else Verdict.STRANGE_FRAME
        behind_ns = self.newest_ns - stamp_ns
        self._late = self._late + 1 if behind_ns > _LATE_NS else 0
        jumped = behind_ns > self._keep_ns or self._late >= _PATIENCE
        return Verdict.CLOCK_RESET if jumped else Verdict.CONTINUES
