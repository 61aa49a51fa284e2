# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Bounded memory of where road users went, in the fixed frame.

A moving road user leaves a trail of points at a fixed spacing; a standing one adds none. Each
point stores the time at which it became known, so a memory of a whole recording can be queried for
any instant as if it held only the past of that instant (docs/design.md, "Trails").
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.frames import own_heading, wrap
from mtpgo_core.history.track_index import SortKeyArray, find_sort_keys, sort_keys
from mtpgo_core.scene.trails.class_groups import class_groups, spacing_m
from mtpgo_core.scene.trails.trail_index import LARGEST_NUMBER, TrailIndex
from mtpgo_core.scene.trails.trail_points import IntArray, PointColumns, TrailPoints
from mtpgo_core.schema import (
    BoolArray,
    ClassArray,
    Float64Array,
    HistoryWindow,
    IndexArray,
    KeyArray,
)

CAPACITY = 1 << 19
"""Points that are kept: 36 minutes of 60 vehicles at 8 m/s, in 22 MB with the index (computed)."""
GAP_NS = 1_000_000_000
"""A road user that is absent for longer starts a new trail (ns); chosen: twice the longest gap
that the history bridges."""
SET_BACK_NS = 600_000_000
"""Windows of one stream may step back this far (ns), by the compensation of delays (0.5 s); an
older one belongs to another stream."""
_FAR_M = 50_000.0
"""Road users farther from the memory's origin leave no trails (m): at that distance float32 has a
grid of 4 mm. Chosen: no site is as large; where most of them are farther, it is another site."""
_TURN_RAD = 1.0
"""Largest angle between the movement of a road user and its heading before a new trail starts
(rad); chosen: more than the tightest turn within two metres."""
_LEAP, _LEAP_MPS = 1.5, 2.0
"""A step longer than at the speed times this factor plus this speed (m/s), as after a swap of
identities, starts a new trail; chosen."""

_TRACK = np.dtype(
    [
        ("name", "S16"),
        ("anchor", "f8", (2,)),
        ("heading", "f8"),
        ("speed", "f8"),
        ("seen_ns", "i8"),
        ("number", "i8"),
        ("trail", "i4"),
        ("group", "u1"),
    ]
)
"""The end of the trail of a road user: its key, place and heading of its last point, speed and
time of its last sample, number of the last point (-1 before the first), trail, class group."""


class TrailMemory:
    """Where road users went.

    Args:
        capacity: points that are kept; the oldest are overwritten.
        reserved: take the memory of all of them now, as a node does that runs for hours.

    Attributes:
        points: the points.
        index: the points by place.
        origin: [2] from which the offsets of the points are counted (m), in the fixed frame.
    """

    def __init__(self, capacity: int = CAPACITY, *, reserved: bool = False) -> None:
        self._capacity, self._reserved = capacity, reserved
        self.clear()

    def clear(self) -> None:
        """Forget everything."""
        self._tracks = np.empty(0, dtype=_TRACK)
        self._forget_points()
        self._trails = 0
        self._newest_ns: int | None = None
        self._frame_id = ""

    def _forget_points(self) -> None:
        """Forget all points; road users who are there start new trails."""
        self.points = TrailPoints(self._capacity, reserved=self._reserved)
        self.index = TrailIndex(self._capacity if self._reserved else 0)
        self.origin: Float64Array = np.zeros(2)
        self._tracks["number"] = -1

    def __len__(self) -> int:
        """Return the number of points."""
        return self.points.count - self.points.oldest

    @property
    def nbytes(self) -> int:
        """Memory of points and index (bytes)."""
        return self.points.nbytes + self.index.nbytes + self._tracks.nbytes

    def add(self, window: HistoryWindow, dt_s: float) -> None:
        """Extend the trails by the samples of a window that are newer than the last window.

        A window in another frame, or older than the last one by more than ``SET_BACK_NS``, clears
        the memory first; a window that is slightly older, or of the same time, adds nothing.

        Args:
            window: its agents need not be present at its time.
            dt_s: time between two of its samples (s).
        """
        if not len(window):  # it may have no frame
            return
        since_ns = self._advance(window.stamp_ns, window.frame_id)
        if since_ns is None:
            return
        step_ns, steps = round(dt_s * 1e9), window.valid.shape[1]
        sample_ns = window.stamp_ns - (steps - 1 - np.arange(steps)) * step_ns
        # Half a step before a sample counts as that sample: cycles may jitter.
        limit_ns = sample_ns - np.where(np.arange(steps) < steps - 1, step_ns // 2, 0)
        fresh = window.valid & (limit_ns > since_ns)
        for step in np.flatnonzero(fresh.any(axis=0)).tolist():
            rows = np.flatnonzero(fresh[:, step])
            self._observe(
                window.stamp_ns,
                int(sample_ns[step]),
                window.key[rows],
                class_groups(window.agent_class[rows]),
                window.position[rows, step],
                window.velocity[rows, step],
                window.yaw[rows, step],
            )

    def add_instant(
        self,
        stamp_ns: int,
        frame_id: str,
        key: KeyArray,
        agent_class: ClassArray,
        position: Float64Array,
        velocity: Float64Array,
        yaw: Float64Array,
    ) -> None:
        """Add the road users present at an instant; as :meth:`add` with the last sample only.

        Args:
            stamp_ns: the instant (ns).
            frame_id: the fixed frame.
            key: [n, 4] identities.
            agent_class: [n].
            position: [n, 2] (m).
            velocity: [n, 2] (m/s), NaN where unknown.
            yaw: [n] (rad), NaN where unknown.
        """
        if len(key) and self._advance(stamp_ns, frame_id) is not None:
            group = class_groups(agent_class)
            self._observe(stamp_ns, stamp_ns, key, group, position, velocity, yaw)

    def _advance(self, stamp_ns: int, frame_id: str) -> int | None:
        """Advance to a time; return the time of the previous call (ns), None if not newer."""
        newest_ns = self._newest_ns
        if newest_ns is None or frame_id != self._frame_id or stamp_ns < newest_ns - SET_BACK_NS:
            self.clear()
            self._frame_id = frame_id
        elif stamp_ns <= newest_ns:
            return None
        if self.points.count > LARGEST_NUMBER // 2:  # after a year
            self.clear()
            self._frame_id = frame_id
        since_ns, self._newest_ns = self._newest_ns, stamp_ns
        return np.iinfo(np.int64).min if since_ns is None else since_ns

    def _observe(
        self,
        stamp_ns: int,
        sample_ns: int,
        key: KeyArray,
        group: ClassArray,
        position: Float64Array,
        velocity: Float64Array,
        yaw: Float64Array,
    ) -> None:
        """Extend the trails of n road users to their positions at ``sample_ns``.

        A trail ends, and a new one begins, where its road user is too far from the origin, changes
        its class group, moves in a direction far from its heading, or moves farther than its speed
        allows.

        Args:
            stamp_ns: when the new points become known (ns).
            sample_ns: when the road users were there (ns).
            key: [n, 4] identities.
            group: [n] class groups.
            position: [n, 2] (m).
            velocity: [n, 2] (m/s), NaN where unknown.
            yaw: [n] (rad), NaN where unknown.
        """
        far = self._far(position)
        heading = own_heading(velocity, yaw)
        names = sort_keys(key)
        order = np.argsort(names, kind="stable")
        names, key, group, heading = names[order], key[order], group[order], heading[order]
        position, far = position[order], far[order]
        speed = np.nan_to_num(np.hypot(velocity[order, 0], velocity[order, 1]))
        track = self._tracks_of(names, sample_ns, position, heading, group)
        rows = self._tracks[track]

        move = position - rows["anchor"]
        distance = np.hypot(move[:, 0], move[:, 1])
        spacing = spacing_m(group)
        count = np.floor(distance / spacing + 1e-9).astype(np.int64)
        course = np.arctan2(move[:, 1], move[:, 0])
        turn = wrap(heading - rows["heading"])
        passed_s = 1e-9 * (sample_ns - rows["seen_ns"])
        leap = spacing + (_LEAP * np.maximum(speed, rows["speed"]) + _LEAP_MPS) * passed_s
        with np.errstate(invalid="ignore"):
            steady = (np.abs(wrap(course - heading)) < _TURN_RAD) & np.isfinite(turn)
        ends = far | (rows["group"] != group) | ((count > 0) & ~(steady & (distance < leap)))
        count[ends] = 0
        rows["number"][ends] = -1
        rows["anchor"][ends] = position[ends]
        rows["heading"][ends] = heading[ends]
        rows["group"], rows["speed"], rows["seen_ns"] = group, speed, sample_ns
        grows = np.flatnonzero(count)
        if grows.shape[0]:
            fresh = (rows["number"][grows] < 0).astype(np.int64)
            rows["trail"][grows[fresh > 0]] = self._new_trails(int(fresh.sum()))
            self._extend(stamp_ns, rows, grows, fresh, count[grows], move, turn, key)
        self._tracks[track] = rows

    def _far(self, position: Float64Array) -> BoolArray:
        """Return [n] which road users are too far from the origin for their trails to be kept.

        Offsets are float32, so the origin must be near the road users; one stray object must not
        move it. If most road users are far away, either the first one was the stray object or the
        site has changed, and all points are forgotten. The origin of an empty memory is set where
        most road users are.

        Args:
            position: [n, 2] (m).
        """
        if len(self):
            far = np.asarray((np.abs(position - self.origin) > _FAR_M).any(axis=1))
            if far.sum() < 2 or 2 * far.sum() <= len(far):
                return far
            self._forget_points()
        apart = np.abs(position - np.median(position, axis=0))
        far = np.asarray((apart > _FAR_M).any(axis=1))
        return far & ~far.all()

    def _extend(
        self,
        stamp_ns: int,
        rows: NDArray[Any],
        grows: IndexArray,
        fresh: IntArray,
        count: IntArray,
        move: Float64Array,
        turn: Float64Array,
        key: KeyArray,
    ) -> None:
        """Store points from the ends of g trails to the positions of their road users.

        The points of one trail are stored one after the other, spaced evenly.

        Args:
            stamp_ns: when the points become known (ns).
            rows: [n] tracks, changed here.
            grows: [g] indices of the tracks whose trails grow.
            fresh: [g] 1 for a new trail, whose anchor is stored as its first point, else 0.
            count: [g] number of points after the anchor.
            move: [n, 2] from the anchor to the road user's position (m).
            turn: [n] from the anchor's heading to that of the road user (rad).
            key: [n, 4] identities.
        """
        spacing = spacing_m(rows["group"][grows])
        share = spacing / np.hypot(move[grows, 0], move[grows, 1])  # of the move, per point
        stored = count + fresh
        end = np.cumsum(stored)
        trail = np.repeat(np.arange(len(grows)), stored)  # of each point
        nth = np.arange(end[-1]) - np.repeat(end - stored, stored) + 1 - fresh[trail]
        fraction = (nth * share[trail])[:, None]
        track = grows[trail]
        place = rows["anchor"][track] + fraction * move[track]
        heading = wrap(rows["heading"][track] + fraction[:, 0] * turn[track])
        if not len(self):
            self.origin = np.floor(place[0])
        following = np.ones(len(trail), dtype=np.int32)
        following[end - 1] = 0
        number = self.points.append(
            PointColumns(
                offset=(place - self.origin).astype(np.float32),
                heading=heading.astype(np.float32),
                time_ns=np.full(len(trail), stamp_ns, dtype=np.int64),
                owner=owner_hash(key)[track],
                trail=rows["trail"][track],
                following=following,
                group=rows["group"][track],
            )
        )
        continued = fresh == 0
        last = rows["number"][grows[continued]]
        self.points.link(last, number[(end - stored)[continued]])
        self.index.add(place - self.origin, heading, number, self.points.oldest)
        # The last point of each trail is the anchor of its next points.
        rows["number"][grows] = number[end - 1]
        fraction = (count * share)[:, None]
        rows["anchor"][grows] += fraction * move[grows]
        rows["heading"][grows] = wrap(rows["heading"][grows] + fraction[:, 0] * turn[grows])

    def _tracks_of(
        self,
        names: SortKeyArray,
        sample_ns: int,
        position: Float64Array,
        heading: Float64Array,
        group: ClassArray,
    ) -> IndexArray:
        """Return [n] rows of the tracks of ascending names; new ones are added, lost ones removed.

        Args:
            names: [n] ascending sort keys.
            sample_ns: when the road users were seen (ns).
            position: [n, 2] (m).
            heading: [n] (rad).
            group: [n] class groups.
        """
        absent = self._tracks["seen_ns"] < sample_ns - GAP_NS
        if absent.any():
            self._tracks = self._tracks[~absent]
        new = find_sort_keys(self._tracks["name"], names) < 0
        if new.any():
            tracks = np.zeros(int(new.sum()), dtype=_TRACK)
            tracks["name"], tracks["anchor"] = names[new], position[new]
            tracks["heading"], tracks["group"] = heading[new], group[new]
            tracks["seen_ns"], tracks["number"] = sample_ns, -1
            place = np.searchsorted(self._tracks["name"], tracks["name"])
            self._tracks = np.insert(self._tracks, place, tracks)
        return find_sort_keys(self._tracks["name"], names)

    def _new_trails(self, count: int) -> IntArray:
        """Return [count] numbers of new trails."""
        self._trails += count
        return np.arange(self._trails - count, self._trails) & 0x7FFFFFFF


def owner_hash(key: KeyArray) -> NDArray[np.uint32]:
    """Return [n] hashes of identities [n, 4]; two road users rarely share one."""
    mixed = np.zeros(len(key), dtype=np.uint64)
    for word in range(key.shape[1]):
        mixed = (mixed ^ key[:, word]) * np.uint64(0x9E3779B97F4A7C15)
        mixed ^= mixed >> np.uint64(32)
    return mixed.astype(np.uint32)
