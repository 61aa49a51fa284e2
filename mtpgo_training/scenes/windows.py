# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The windows of a recording, from which scenes are cut.

A window contains nothing later than its stamp, since it is cut from samples up to that time only.
Windows are not stored, only which track has a past at which instant; a window is cut from the
recording's samples (:mod:`mtpgo_training.scenes.track_samples`) when it is needed.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import overload

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.history.resampling import Brackets
from mtpgo_core.history.track_store import (
    ACCELERATION,
    POSITION,
    SAMPLE_COLUMNS,
    VELOCITY,
    YAW,
)
from mtpgo_core.schema import BoolArray, Float64Array, HistoryWindow
from mtpgo_training.data.recording import FRAME_ID, Recording
from mtpgo_training.scenes.track_samples import SampleTable

IntArray = NDArray[np.int64]

_PAIRS_AT_ONCE = 4096
"""Pairs of track and time looked up together; chosen, bounds the memory."""


@dataclass(frozen=True)
class TrackedWindow:
    """A window and the tracks of its agents.

    Attributes:
        window: the window.
        track: [n] index of each agent's track in the recording.
    """

    window: HistoryWindow
    track: IntArray


@dataclass(frozen=True)
class Instants:
    """The agents of all windows at the windows' own times, one row for each agent of a window.

    Attributes:
        stamp_ns: [w] the windows' times.
        offset: [w + 1] the first row of each window, and the end.
        track: [p] index of the agent's track in the recording.
        newest: [p] its newest sample.
        present: [p] valid at the window's time.
        position: [p, 2] then (m), NaN where not present.
        velocity: [p, 2] then (m/s), NaN where not known.
        yaw: [p] then (rad), NaN where not known.
    """

    stamp_ns: IntArray
    offset: IntArray
    track: IntArray
    newest: IntArray
    present: BoolArray
    position: Float64Array
    velocity: Float64Array
    yaw: Float64Array

    def rows(self, window: int) -> slice:
        """Return the rows of a window, in the order of its agents."""
        return slice(int(self.offset[window]), int(self.offset[window + 1]))

    @property
    def window(self) -> IntArray:
        """[p] window of each row."""
        return np.repeat(np.arange(len(self.stamp_ns)), np.diff(self.offset))


class Windows(Sequence[TrackedWindow]):
    """The windows of a recording at given times, each cut when it is asked for.

    Attributes:
        instants: the agents in them.
    """

    def __init__(
        self, recording: Recording, table: SampleTable, times_ns: IntArray, owner: IntArray
    ) -> None:
        """Find the agents of each window.

        Args:
            recording: the recording that ``table`` was made of.
            table: its samples.
            times_ns: [w] ascending times (ns).
            owner: [tracks] number to use as the agents' ``track``; of several tracks with the same
                owner in a window the last one is kept.
        """
        self._recording = recording
        self._table = table
        self._owner = owner
        self.instants = self._find(times_ns)

    def _find(self, times_ns: IntArray) -> Instants:
        table = self._table
        pairs = table.pairs(times_ns)
        seen = np.zeros(len(pairs.time), dtype=np.bool_)
        present = np.zeros_like(seen)
        state = np.full((len(seen), SAMPLE_COLUMNS), np.nan)
        for begin in range(0, len(seen), _PAIRS_AT_ONCE):
            some = slice(begin, begin + _PAIRS_AT_ONCE)
            brackets, rows = table.brackets(pairs.newest[some], times_ns[pairs.time[some]])
            seen[some] = brackets.valid.any(axis=1)
            present[some] = brackets.valid[:, -1]
            state[some] = table.states(_last_step(brackets), rows)[:, 0]
        piece = table.track[pairs.newest].astype(np.int64)
        keep = np.flatnonzero(seen)
        keep = keep[_newest_piece(pairs.time[keep], piece[keep], self._owner)]
        return Instants(
            stamp_ns=times_ns,
            offset=np.searchsorted(pairs.time[keep], np.arange(len(times_ns) + 1)),
            track=self._owner[piece[keep]],
            newest=pairs.newest[keep],
            present=present[keep],
            position=state[keep, POSITION],
            velocity=state[keep, VELOCITY],
            yaw=state[keep, YAW],
        )

    def __len__(self) -> int:
        return len(self.instants.stamp_ns)

    @overload
    def __getitem__(self, index: int) -> TrackedWindow: ...
    @overload
    def __getitem__(self, index: slice) -> list[TrackedWindow]: ...
    def __getitem__(self, index: int | slice) -> TrackedWindow | list[TrackedWindow]:
        if isinstance(index, slice):
            return [self._cut(i) for i in range(*index.indices(len(self)))]
        if not -len(self) <= index < len(self):
            raise IndexError(index)
        return self._cut(index % len(self))

    def __iter__(self) -> Iterator[TrackedWindow]:
        return (self._cut(i) for i in range(len(self)))

    def _cut(self, index: int) -> TrackedWindow:
        table, recording = self._table, self._recording
        rows = self.instants.rows(index)
        newest = self.instants.newest[rows]
        stamp_ns = int(self.instants.stamp_ns[index])
        brackets, places = table.brackets(newest, stamp_ns)
        sample = table.states(brackets, places)
        piece = table.track[newest]
        n = len(newest)
        window = HistoryWindow(
            stamp_ns=stamp_ns,
            frame_id=FRAME_ID,
            key=recording.key[piece],
            agent_class=recording.agent_class[piece],
            z=np.full(n, np.nan),
            size=recording.size[piece],
            position=sample[..., POSITION],
            velocity=sample[..., VELOCITY],
            acceleration=sample[..., ACCELERATION],
            yaw=sample[..., YAW],
            valid=brackets.valid,
            covariance=np.full((n, 4, 4), np.nan),
        )
        return TrackedWindow(window, self.instants.track[rows])


def windows_of(recording: Recording, table: SampleTable, stride_s: float) -> Windows:
    """Return windows every ``stride_s`` of a recording, each with only its past.

    There is no window at times without an agent.

    Args:
        recording: the recording.
        table: its samples.
        stride_s: time between two windows (s); see :func:`frames_every`.
    """
    owner = np.arange(len(recording.track_id), dtype=np.int64)
    windows = Windows(recording, table, _times(recording, stride_s), owner)
    instants = windows.instants
    there = np.zeros(len(windows), dtype=np.bool_)
    there[instants.window[instants.present]] = True
    return windows if there.all() else Windows(recording, table, instants.stamp_ns[there], owner)


def cut_tracks(
    recording: Recording, within_s: float, generator: np.random.Generator
) -> tuple[Recording, IntArray]:
    """Return the recording with each track cut into pieces, and [pieces] the track of each.

    The pieces of a track last ``within_s``, with a random phase, and each has an identity of its
    own, so the history starts again at every cut. The short past of an agent is then exactly what
    the node would have, estimated derivatives included.

    Args:
        recording: the recording.
        within_s: length of a piece (s), the longest time for which an agent has been seen.
        generator: source of the phases.
    """
    length = max(1, round(within_s * recording.frame_rate))
    phase = generator.integers(0, length, size=len(recording.track_id))
    number = (recording.frame + phase[recording.track]) // length
    number -= number.min() if len(number) else 0
    code = recording.track * (int(number.max(initial=0)) + 1) + number
    _, first, piece = np.unique(code, return_index=True, return_inverse=True)
    owner = recording.track[first]
    return dataclasses.replace(with_pieces(recording, owner), track=piece.astype(np.int64)), owner


def with_pieces(recording: Recording, owner: IntArray) -> Recording:
    """Return the recording with a track for each of [pieces] pieces of its tracks, rows unchanged.

    Args:
        recording: the recording.
        owner: [pieces] the track of each piece.
    """
    return dataclasses.replace(
        recording,
        track_id=np.arange(len(owner), dtype=np.int64),
        agent_class=recording.agent_class[owner],
        size=recording.size[owner],
        ego_id=None,
        track_key=None,
    )


def stride_frames(recording: Recording, stride_s: float) -> int:
    """Return the whole number of frames, one at least, that a time (s) is nearest to."""
    frames = recording.frames
    longest = float(frames[-1] - frames[0] + 1)  # from there on only the first frame is left
    return max(1, round(min(stride_s * recording.frame_rate, longest)))


def frames_every(recording: Recording, stride_s: float) -> IntArray:
    """Return the frames every ``stride_s``, counted from the first, that have a road user.

    The stride is a whole number of frames, see :func:`stride_frames`.

    Where frames have no fixed times (a bag of jittered messages), the nearest one is taken if it
    is less than a usual step of frames away.
    """
    frames = recording.frames
    if not len(frames):
        return frames
    wanted = np.arange(frames[0], frames[-1] + 1, stride_frames(recording, stride_s))
    after = np.clip(np.searchsorted(frames, wanted), 1, max(1, len(frames) - 1))
    after = np.minimum(after, len(frames) - 1)
    before = np.maximum(after - 1, 0)
    nearer = np.abs(frames[before] - wanted) < np.abs(frames[after] - wanted)
    chosen = np.where(nearer, frames[before], frames[after])
    usual = float(np.median(np.diff(frames))) if len(frames) > 1 else 1.0
    return np.unique(chosen[np.abs(chosen - wanted) < usual])


def _times(recording: Recording, stride_s: float) -> IntArray:
    frames = frames_every(recording, stride_s).tolist()
    return np.array([recording.stamp_ns(frame) for frame in frames], dtype=np.int64)


def _last_step(brackets: Brackets) -> Brackets:
    """Return the brackets of the common time only."""
    return Brackets(
        left=brackets.left[:, -1:],
        right=brackets.right[:, -1:],
        fraction=brackets.fraction[:, -1:],
        after_s=brackets.after_s,
        valid=brackets.valid[:, -1:],
    )


def _newest_piece(window: IntArray, piece: IntArray, owner: IntArray) -> BoolArray:
    """Return [p] whether no later piece of the same owner is in the same window.

    A piece that has just ended would otherwise be extrapolated next to its successor.
    """
    if len(owner) == 0 or not len(piece):
        return np.ones(len(piece), dtype=np.bool_)
    code = window * (int(owner.max()) + 1) + owner[piece]
    order = np.lexsort((piece, code))
    last = np.append(code[order][1:] != code[order][:-1], True)
    keep = np.zeros(len(piece), dtype=np.bool_)
    keep[order[last]] = True
    return keep
