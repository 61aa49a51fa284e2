# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The samples that the history makes of a whole recording, and windows cut from them.

The node's history gets one message at a time. A recording is known as a whole, and a track's
samples (position, velocity, acceleration, yaw with what is missing estimated) depend on its own
past only. So they are computed here for many tracks at once, by the same functions of
:mod:`mtpgo_core.history.track_update`, and kept in columns, sorted by track and time. A window at
a time t is then cut from the samples up to t, again by the same functions. The result equals
what :class:`mtpgo_core.history.track_history.TrackHistory` gives message by message, number by
number (test).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.history.resampling import NEVER_NS, Brackets, bracket
from mtpgo_core.history.track_index import sort_keys
from mtpgo_core.history.track_store import SAMPLE_COLUMNS, TrackStore
from mtpgo_core.history.track_update import (
    complete_samples,
    interpolate,
    moved_impossibly,
    usable_observations,
)
from mtpgo_core.schema import Float64Array, TrackedStates, tracked_states
from mtpgo_core.task.task_description import HistoryConfig
from mtpgo_training.data.recording import FRAME_ID, Columns, Recording

IntArray = NDArray[np.int64]

TRACKS_AT_ONCE = 2048
ROWS_AT_ONCE = 200_000
"""Tracks and rows that are processed together; chosen, bounds the memory."""


@dataclass(frozen=True)
class Pairs:
    """The tracks that have a past at some times, one row for each pair of track and time.

    Attributes:
        time: [p] index of the time, ascending; within a time in the order of the tracks' keys.
        newest: [p] the track's newest sample up to that time.
    """

    time: IntArray
    newest: IntArray


class SampleTable:
    """The samples of every track of a recording, by track (in the order of the keys) and time."""

    def __init__(self, columns: Mapping[str, NDArray[Any]], history: HistoryConfig) -> None:
        """Keep the columns of :func:`take_in`, which may be mapped from disk.

        Args:
            columns: ``stamp_ns`` [r], ``track`` [r] (index in the recording), ``begin`` [r] (row
                with which the unbroken past of this row begins), ``replaced`` [r] (overwritten by
                the track's next sample, which came too soon after), ``sample`` [r, 7].
            history: the configuration that they were made with.
        """
        self.history = history
        self.stamp_ns: IntArray = columns["stamp_ns"]
        self.track: NDArray[np.int32] = columns["track"]
        self.sample: Float64Array = columns["sample"]
        self._begin: NDArray[np.int32] = columns["begin"]
        self._grid_ns = np.array(history.grid_ns, dtype=np.int64)
        replaced = columns["replaced"]
        self._kept = np.flatnonzero(~replaced) if replaced.any() else None
        self._reach = self._longest_past()

    def __len__(self) -> int:
        return self.stamp_ns.shape[0]

    def pairs(self, times_ns: IntArray) -> Pairs:
        """Return the tracks that the history keeps at each of the ascending times [w] (ns)."""
        last = np.append(self.track[1:] != self.track[:-1], True)[: len(self)]
        until = np.where(last, np.iinfo(np.int64).max, np.append(self.stamp_ns[1:], 0) - 1)
        until = np.minimum(until, self.stamp_ns + self.history.keep_ns)
        first = np.searchsorted(times_ns, self.stamp_ns, side="left")
        count = np.maximum(np.searchsorted(times_ns, until, side="right") - first, 0)
        newest = np.repeat(np.arange(len(self)), count)
        before = np.cumsum(count) - count
        time = np.arange(len(newest)) - np.repeat(before - first, count)
        order = np.argsort(time, kind="stable")
        return Pairs(time[order], newest[order])

    def brackets(self, newest: IntArray, time_ns: int | IntArray) -> tuple[Brackets, IntArray]:
        """Return where the grid times are among the samples of some pairs.

        Args:
            newest: [p] the newest samples.
            time_ns: the common time of all, or [p] of each (ns).

        Returns:
            The brackets and [p, K] the rows of their columns.
        """
        rows = self._rows(newest)
        there = rows >= self._begin[newest][:, None]
        rows = np.maximum(rows, 0)
        age_ns = self.stamp_ns[rows] - np.reshape(time_ns, (-1, 1))
        found = bracket(
            np.where(there, age_ns, NEVER_NS),
            self._grid_ns,
            max_gap_ns=self.history.max_gap_ns,
            max_extrapolation_ns=self.history.max_extrapolation_ns,
        )
        return found, rows

    def states(self, brackets: Brackets, rows: IntArray) -> Float64Array:
        """Return [p, T, 7] samples at the grid times of :meth:`brackets`, NaN where unknown."""
        pair = np.arange(rows.shape[0])[:, None]
        left = self.sample[rows[pair, brackets.left]]
        right = self.sample[rows[pair, brackets.right]]
        return interpolate(left, right, brackets)

    def _rows(self, newest: IntArray) -> IntArray:
        """Return [p, K] rows of the samples in a track's ring, newest last; below 0 for none."""
        back = np.arange(1 - self._reach, 1)
        if self._kept is None:
            return newest[:, None] + back
        # A sample that was overwritten later is only there while it is the newest.
        place = np.searchsorted(self._kept, newest, side="left")[:, None] + back[:-1]
        rows = np.where(place >= 0, self._kept[np.maximum(place, 0)], -1)
        return np.concatenate([rows, newest[:, None]], axis=1)

    def _longest_past(self) -> int:
        """Return the largest number of samples of one track that the history keeps."""
        if not len(self):
            return 1
        starts = np.flatnonzero(np.append(True, self.track[1:] != self.track[:-1]))
        most = 1
        for start, end in zip(starts, np.append(starts[1:], len(self)), strict=True):
            stamps = self.stamp_ns[start:end]
            oldest = np.searchsorted(stamps, stamps - self.history.keep_ns)
            most = max(most, int((np.arange(end - start) - oldest).max()) + 1)
        return most + 1


def take_in(recording: Recording, history: HistoryConfig) -> Columns:
    """Return the columns of a :class:`SampleTable`: the history's sample of every row.

    Rows that the history rejects (no finite position, too fast) are left out.
    """
    order = _by_track(recording, _usable_rows(recording, history))
    track = recording.track[order]
    stamp_ns = _stamps(recording, recording.frame[order])
    sample = np.empty((len(order), SAMPLE_COLUMNS))
    fresh, replaced = np.zeros((2, len(order)), dtype=np.bool_)
    for bounds in _together(track):
        length = bounds[:, 1] - bounds[:, 0]
        first = np.cumsum(length) - length
        mine = np.arange(length.sum()) + np.repeat(bounds[:, 0] - first, length)
        states = _states(recording, order[mine])
        store = TrackStore(history, len(bounds), history.keep_ns)
        names = np.zeros((len(bounds), 4), dtype=np.uint32)
        names[:, 0] = np.arange(len(bounds))
        slots, _ = store.allocate(sort_keys(names), np.empty(0, dtype=np.intp))
        with np.errstate(invalid="ignore", over="ignore"):
            for n in range(int(length.max())):
                going = n < length
                slot, here = slots[going], first[going] + n
                at = mine[here]
                _forget(history, store, slot, stamp_ns[at], states.position[here])
                count = store.rings.count[slot]
                sample[at] = complete_samples(history, store, slot, stamp_ns[at], states, here)
                store.rings.append(slot, stamp_ns[at], sample[at])
                fresh[at] = count == 0
                replaced[at - 1] |= store.rings.count[slot] == count
    begin = np.maximum.accumulate(np.where(fresh, np.arange(len(order)), 0))
    return {
        "stamp_ns": stamp_ns,
        "track": track.astype(np.int32),
        "begin": begin.astype(np.int32),
        "replaced": replaced,
        "sample": sample,
    }


def _states(recording: Recording, rows: IntArray | slice) -> TrackedStates:
    """Return rows of a recording as input of the history, without their times."""
    return tracked_states(
        0,
        FRAME_ID,
        recording.key[recording.track[rows]],
        recording.position[rows],
        velocity=recording.velocity[rows],
        acceleration=recording.acceleration[rows],
        yaw=recording.yaw[rows],
    )


def _usable_rows(recording: Recording, history: HistoryConfig) -> IntArray:
    """Return the rows that the history does not reject."""
    good = np.zeros(len(recording), dtype=np.bool_)
    with np.errstate(invalid="ignore", over="ignore"):
        for begin in range(0, len(good), ROWS_AT_ONCE):
            some = slice(begin, begin + ROWS_AT_ONCE)
            finite, too_fast = usable_observations(history, _states(recording, some))
            good[some] = finite & ~too_fast
    return np.flatnonzero(good)


def _by_track(recording: Recording, rows: IntArray) -> IntArray:
    """Return the rows sorted by track (in the order of the keys) and time."""
    rank = np.empty(len(recording.track_id), dtype=np.int64)
    rank[np.argsort(sort_keys(recording.key), kind="stable")] = np.arange(len(rank))
    return rows[np.lexsort((recording.frame[rows], rank[recording.track[rows]]))]


def _stamps(recording: Recording, frame: IntArray) -> IntArray:
    """Return [r] :meth:`Recording.stamp_ns` of many frames."""
    frames, place = np.unique(frame, return_inverse=True)
    stamps = np.array([recording.stamp_ns(f) for f in frames.tolist()], dtype=np.int64)
    return stamps[place.reshape(-1)]


def _together(track: IntArray) -> Iterator[IntArray]:
    """Yield [n, 2] first row and end of tracks of similar length, processed together."""
    if not len(track):
        return
    starts = np.flatnonzero(np.append(True, track[1:] != track[:-1]))
    bounds = np.stack([starts, np.append(starts[1:], len(track))], axis=1)
    bounds = bounds[np.argsort(bounds[:, 0] - bounds[:, 1], kind="stable")]
    rows = np.cumsum(bounds[:, 1] - bounds[:, 0])
    begin = 0
    while begin < len(bounds):
        before = int(rows[begin - 1]) if begin else 0
        end = int(np.searchsorted(rows, before + ROWS_AT_ONCE, side="right"))
        end = min(max(end, begin + 1), begin + TRACKS_AT_ONCE)
        yield bounds[begin:end]
        begin = end


def _forget(
    history: HistoryConfig,
    store: TrackStore,
    slot: NDArray[np.intp],
    stamp_ns: IntArray,
    position: Float64Array,
) -> None:
    """Restart the tracks that were absent for too long or cannot have moved so far."""
    known = store.rings.count[slot] > 0
    away = known & (store.rings.last_ns[slot] < stamp_ns - history.keep_ns)
    known &= ~away
    away[known] = moved_impossibly(history, store, slot[known], stamp_ns[known], position[known])
    if away.any():
        store.reset(slot[away])
