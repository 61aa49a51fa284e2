# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Storage of the history: one slot per track, allocated, grown and released."""

from __future__ import annotations

import numpy as np

from mtpgo_core.history.causal_slope import CausalSlope
from mtpgo_core.history.checks.alternation import AlternationDetector
from mtpgo_core.history.resampling import NEVER_NS
from mtpgo_core.history.sample_rings import SampleRings, longer
from mtpgo_core.history.track_index import SortKeyArray, TrackIndex
from mtpgo_core.schema import (
    FARTHEST_M,
    LARGEST_SIZE_M,
    BoolArray,
    IndexArray,
    TrackedStates,
)
from mtpgo_core.task.task_description import HistoryConfig

_ACCELERATION_PRIOR_S2 = (0.1 / 2.2) ** 2
"""Prior of the acceleration estimate (s^2): velocities accurate to about 0.1 m/s, accelerations of
about 2.2 m/s^2. Without it, the first estimates of a track are noise divided by a short time."""
_FIRST_CAPACITY = 64
"""Slots of a new store; it doubles on demand."""

SAMPLE_COLUMNS = 7
POSITION, VELOCITY, ACCELERATION, YAW = slice(0, 2), slice(2, 4), slice(4, 6), 6
"""Columns of a sample: x, y (m), vx, vy (m/s), ax, ay (m/s^2), yaw (rad)."""


_COLUMNS = (
    "number",
    "first_ns",
    "position_velocity",
    "key",
    "agent_class",
    "z",
    "size",
    "covariance",
)
"""Arrays that grow with the slots."""


class TrackStore:
    """Slots for up to ``max_tracks`` tracks.

    Args:
        config: time constants of the estimators.
        max_tracks: bound on the memory.
        keep_ns: how long a track's samples are kept (ns).
        next_number: number of the first track.

    Attributes:
        index: from identities to slots.
        rings: the samples.
        next_number: number of the next track.
        number: [capacity] number of the track. A track that restarts gets a new number, so that a
            reused identity is distinguished from the road user who had it before.
        first_ns: [capacity] stamp of the track's first sample (ns).
        velocity, acceleration: the estimators.
        alternation: detects tracks that two publishers share.
        position_velocity: [capacity, 2] velocity estimated from the positions alone (m/s).
        key, agent_class, z, size, covariance: [capacity, ...] as last observed.
    """

    def __init__(
        self, config: HistoryConfig, max_tracks: int, keep_ns: int, next_number: int = 0
    ) -> None:
        capacity = min(_FIRST_CAPACITY, max_tracks)
        self._max_tracks = max_tracks
        self._free: IndexArray = np.arange(capacity, dtype=np.intp)[::-1]
        self.index = TrackIndex()
        self.rings = SampleRings(capacity, SAMPLE_COLUMNS, keep_ns)
        self.velocity = CausalSlope(capacity, config.velocity_tau_s)
        self.acceleration = CausalSlope(
            capacity, config.acceleration_tau_s, _ACCELERATION_PRIOR_S2
        )
        self.alternation = AlternationDetector(capacity)
        self.next_number = next_number
        self.number = np.full(capacity, -1, dtype=np.int64)
        self.first_ns = np.full(capacity, NEVER_NS, dtype=np.int64)
        self.position_velocity = np.full((capacity, 2), np.nan)
        self.key = np.zeros((capacity, 4), dtype=np.uint32)
        self.agent_class = np.zeros(capacity, dtype=np.uint8)
        self.z = np.full(capacity, np.nan)
        self.size = np.full((capacity, 2), np.nan)
        self.covariance = np.full((capacity, 4, 4), np.nan)

    def reset(self, slot: IndexArray) -> None:
        """Clear the slots; they stay assigned to their tracks."""
        self.rings.clear(slot)
        self.velocity.reset(slot)
        self.acceleration.reset(slot)
        self.alternation.reset(slot)
        self.number[slot] = self.next_number + np.arange(slot.shape[0])
        self.next_number += slot.shape[0]
        self.agent_class[slot] = 0
        for array in (self.position_velocity, self.z, self.size, self.covariance):
            array[slot] = np.nan

    def forget_before(self, stamp_ns: int) -> int:
        """Release the tracks last seen before ``stamp_ns`` and return how many."""
        return self._release(self.rings.last_ns[self.index.slots] < stamp_ns)

    def forget(self, keys: SortKeyArray) -> None:
        """Release the tracks of identities, given as [n] sort keys, that have one."""
        self._release(np.isin(self.index.keys, keys))

    def allocate(self, keys: SortKeyArray, others: IndexArray) -> tuple[IndexArray, int]:
        """Return slots for new tracks, -1 where there is no room, and how many were dropped.

        When the store is full, the tracks unseen for longest are evicted; new tracks that still
        find no room are dropped. Both count.

        Args:
            keys: [n] ascending sort keys of the new tracks.
            others: slots of the known tracks in the same message, which are never evicted.
        """
        slots = np.full(keys.shape[0], -1, dtype=np.intp)
        if keys.shape[0] == 0:
            return slots, 0
        room = min(keys.shape[0], self._max_tracks - others.shape[0])
        evicted = self._evict(len(self.index) + room - self._max_tracks, others)
        if room > self._free.shape[0]:
            self._grow(len(self.index) + room)
        rest = self._free.shape[0] - room
        slots[:room], self._free = self._free[rest:][::-1], self._free[:rest]
        self.reset(slots[:room])
        self.index.add(keys[:room], slots[:room])
        return slots, keys.shape[0] - room + evicted

    def update_attributes(self, slot: IndexArray, states: TrackedStates, row: IndexArray) -> None:
        """Store identity, class, height, size and covariance of the observations ``row``.

        An unknown class, height or size keeps its last known value; an impossible height or size
        is unknown.
        """
        self.key[slot] = states.key[row]
        agent_class, z, size = states.agent_class[row], states.z[row], states.size[row]
        self.agent_class[slot] = np.where(agent_class > 0, agent_class, self.agent_class[slot])
        self.z[slot] = np.where(np.abs(z) <= FARTHEST_M, z, self.z[slot])
        possible = (size > 0.0) & (size <= LARGEST_SIZE_M)
        self.size[slot] = np.where(possible, size, self.size[slot])
        self.covariance[slot] = states.covariance[row]

    def _evict(self, surplus: int, others: IndexArray) -> int:
        """Release the ``surplus`` tracks unseen for longest; return how many were released."""
        if surplus <= 0:
            return 0
        last_ns = self.rings.last_ns[self.index.slots]
        last_ns[np.isin(self.index.slots, others)] = np.iinfo(np.int64).max
        rows = np.zeros(len(self.index), dtype=bool)
        rows[np.argsort(last_ns, kind="stable")[:surplus]] = True
        return self._release(rows)

    def _release(self, rows: BoolArray) -> int:
        """Release the slots of these rows of the index; return how many."""
        if not rows.any():
            return 0
        slots = self.index.remove(rows)
        self._free = np.concatenate([self._free, slots])
        return int(slots.shape[0])

    def _grow(self, least: int) -> None:
        """Make room for at least ``least`` tracks."""
        old = self.rings.capacity
        capacity = min(max(2 * old, least), self._max_tracks)
        for name in _COLUMNS:
            setattr(self, name, longer(getattr(self, name), capacity))  # reset when allocated
        self.rings.grow(capacity)
        self.velocity.grow(capacity)
        self.acceleration.grow(capacity)
        self.alternation.grow(capacity)
        self._free = np.concatenate([np.arange(old, capacity, dtype=np.intp)[::-1], self._free])
