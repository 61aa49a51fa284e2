# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A recording of real or simulated traffic in the internal frame, independent of its file layout.

The frame is right-handed and fixed to the site, y to the left of x; metres, seconds, radians.
Values that a layout does not give are NaN.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.history.track_index import SortKeyArray, find_sort_keys, sort_keys
from mtpgo_core.identity import keys_from_integers
from mtpgo_core.schema import (
    BoolArray,
    ClassArray,
    Float64Array,
    KeyArray,
    TrackedStates,
    tracked_states,
)

Int64Array = NDArray[np.int64]
Columns = dict[str, NDArray[Any]]
"""Arrays by name."""

FRAME_ID = "map"
"""Name of the internal frame in messages."""

DEFAULT_START_NS = 1_500_000_000 * 10**9
"""Stamp of frame 0 (ns) where a layout gives no absolute time; chosen, as 0 is "no clock yet"."""


@dataclass(frozen=True)
class Recording:
    """Road users over time, one row per frame and track.

    Attributes:
        name: name of the recording within its directory, such as ``01``.
        layout: name of the layout it was read from, see :mod:`mtpgo_training.data.readers`.
        location: the site, as the data set names it.
        frame_rate: frames per second (Hz).
        frame: [rows] frame number, ascending; within a frame the tracks ascend.
        track: [rows] index into the per-track arrays.
        position: [rows, 2] box centre x, y (m).
        velocity: [rows, 2] (m/s). acceleration: [rows, 2] (m/s^2). yaw: [rows] (rad), in
            (-pi, pi]. All three NaN where unknown.
        track_id: [tracks] the data set's own number of the road user.
        agent_class: [tracks] :class:`~mtpgo_core.schema.AgentClass` values.
        size: [tracks, 2] length, width (m), NaN where unknown.
        lanes: [k, 2] polylines of the lane markings (m), along the direction of travel.
        ego_id: the ``track_id`` of a chosen ego, if any.
        sha256: hash over the contents of the source files.
        start_time_ns: stamp of frame 0 (ns).
        track_key: [tracks, 4] identities, where ``track_id`` cannot carry them (UUIDs, text).
        counts: what was odd in its messages, by the node's counters, see
            :mod:`mtpgo_core.history.odd_input`.
    """

    name: str
    layout: str
    location: str
    frame_rate: float
    frame: Int64Array
    track: Int64Array
    position: Float64Array
    velocity: Float64Array
    acceleration: Float64Array
    yaw: Float64Array
    track_id: Int64Array
    agent_class: ClassArray
    size: Float64Array
    lanes: tuple[Float64Array, ...] = ()
    ego_id: int | None = None
    sha256: str = ""
    start_time_ns: int = DEFAULT_START_NS
    track_key: KeyArray | None = None
    counts: Mapping[str, int] = field(default_factory=dict)

    def __len__(self) -> int:
        return self.frame.shape[0]

    @cached_property
    def key(self) -> KeyArray:
        """[tracks, 4] identities: ``track_key``, else made of ``track_id``."""
        if self.track_key is not None:
            return self.track_key
        return keys_from_integers(self.track_id.tolist())

    @cached_property
    def _sorted_names(self) -> tuple[SortKeyArray, Int64Array]:
        """The names of the keys in ascending order, and the track of each."""
        names = sort_keys(self.key)
        order = np.argsort(names, kind="stable")
        return names[order], order

    def find_tracks(self, key: KeyArray) -> Int64Array:
        """[n] index of the track with each [n, 4] key, -1 for a key that no track has."""
        names, track = self._sorted_names
        place = find_sort_keys(names, sort_keys(key))
        return np.where(place >= 0, track[place], -1) if len(track) else place

    @cached_property
    def _bounds(self) -> tuple[Int64Array, Int64Array]:
        """The distinct frames, and where the rows of each begin (one entry more at the end)."""
        frames, starts = np.unique(self.frame, return_index=True)
        return frames, np.append(starts, len(self)).astype(np.int64)

    @property
    def frames(self) -> Int64Array:
        """Frame numbers with at least one road user, ascending."""
        return self._bounds[0]

    @property
    def duration_s(self) -> float:
        """Time from the first to the last frame (s)."""
        return float(self.frame[-1] - self.frame[0]) / self.frame_rate if len(self) else 0.0

    def stamp_ns(self, frame: int) -> int:
        """Return the time of a frame (ns)."""
        return self.start_time_ns + round(int(frame) * 1e9 / self.frame_rate)

    @property
    def span_ns(self) -> tuple[int, int]:
        """Stamps of the first and last frame with a road user (ns)."""
        return self.stamp_ns(int(self.frames[0])), self.stamp_ns(int(self.frames[-1]))

    def states(self) -> Iterator[TrackedStates]:
        """Yield the road users frame by frame, as a tracker would have published them."""
        frames, starts = self._bounds
        for i, frame in enumerate(frames.tolist()):
            yield self._states(frame, slice(int(starts[i]), int(starts[i + 1])))

    def _states(self, frame: int, rows: slice) -> TrackedStates:
        track = self.track[rows]
        return tracked_states(
            self.stamp_ns(frame),
            FRAME_ID,
            self.key[track],
            self.position[rows],
            agent_class=self.agent_class[track],
            velocity=self.velocity[rows],
            acceleration=self.acceleration[rows],
            yaw=self.yaw[rows],
            size=self.size[track],
        )

    def select_rows(self, rows: BoolArray) -> Recording:
        """Return the recording with the rows of the mask only, without tracks that have no row."""
        kept, track = np.unique(self.track[rows], return_inverse=True)
        return dataclasses.replace(
            self,
            frame=self.frame[rows],
            track=track.astype(np.int64),
            position=self.position[rows],
            velocity=self.velocity[rows],
            acceleration=self.acceleration[rows],
            yaw=self.yaw[rows],
            track_id=self.track_id[kept],
            agent_class=self.agent_class[kept],
            size=self.size[kept],
            track_key=None if self.track_key is None else self.track_key[kept],
        )

    def between(self, start_s: float | None = None, end_s: float | None = None) -> Recording:
        """Return the part from ``start_s`` to ``end_s``, both counted from the first frame (s)."""
        if not len(self):
            return self
        time = (self.frame - self.frame[0]) / self.frame_rate
        rows = np.ones(len(self), dtype=np.bool_)
        if start_s is not None:
            rows &= time >= start_s - 1e-9
        if end_s is not None:
            rows &= time <= end_s + 1e-9
        return self.select_rows(rows)

    def without_parked(self, moved_m: float = 2.0) -> Recording:
        """Return the recording without road users that stay within ``moved_m`` of their start."""
        order = np.lexsort((self.frame, self.track))
        first = order[np.unique(self.track[order], return_index=True)[1]]
        away = np.linalg.norm(self.position - self.position[first][self.track], axis=1)
        farthest = np.zeros(self.track_id.shape[0])
        np.maximum.at(farthest, self.track, away)
        return self.select_rows((farthest >= moved_m)[self.track])


def first_and_last(track: Int64Array, tracks: int) -> tuple[Int64Array, Int64Array]:
    """Return [tracks] the first and the last row of each track, 0 for one without a row.

    Args:
        track: [rows] indices of the tracks.
        tracks: number of tracks.
    """
    row = np.arange(len(track))
    first, last = np.zeros((2, tracks), dtype=np.int64)
    # Of several assignments the last one stays.
    first[track[::-1]], last[track] = row[::-1], row
    return first, last


def require_span(start_s: float | None, end_s: float | None) -> None:
    """Check ``--start`` and ``--end`` of a part of a recording.

    Args:
        start_s: begin (s), None for that of the recording.
        end_s: end (s), None for that of the recording.

    Raises:
        ConfigurationError: the begin is not 0 or later, or the end not later than the begin.
    """
    if start_s is not None and not start_s >= 0.0:
        raise ConfigurationError(f"--start is {start_s}, expected at least 0 s")
    if end_s is not None and not end_s > (start_s or 0.0):
        raise ConfigurationError(
            f"--end is {end_s}, expected more than the start, {start_s or 0.0:g} s"
        )
