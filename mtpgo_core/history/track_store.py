# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The memory of the history: a slot for every track, handed out, grown and taken back."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.history.causal_slope import CausalSlope
from mtpgo_core.history.sample_rings import SampleRings
from mtpgo_core.history.track_index import NameArray, TrackTable
from mtpgo_core.schema import BoolArray, TrackedStates
from mtpgo_core.task.task_description import HistoryConfig

_ACCELERATION_PRIOR_S2 = (0.1 / 2.2) ** 2
"""Prior of the acceleration estimate: velocities good to about 0.1 m/s, accelerations of about
2 m/s^2; keeps the first estimates of a track from being noise divided by a short time."""
_FIRST_CAPACITY = 64

IndexArray = NDArray[np.intp]

SAMPLE_COLUMNS = 7
POSITION, VELOCITY, ACCELERATION, YAW = slice(0, 2), slice(2, 4), slice(4, 6), 6
"""Columns of a sample."""


class TrackStore:
    """Slots for up to ``max_tracks`` tracks.

    Args:
        config: time constants of the estimators.
        max_tracks: bound on the memory.
        keep_ns: how long a track's samples are kept (ns).

    Attributes:
        table: which track owns which slot.
        rings: the samples: position, velocity, acceleration, yaw.
        velocity, acceleration: the estimators.
        motion: [capacity, 2] velocity by the positions alone (m/s).
        key, agent_class, z, size, covariance: [capacity, ...] as last told.
    """

    def __init__(self, config: HistoryConfig, max_tracks: int, keep_ns: int) -> None:
        capacity = min(_FIRST_CAPACITY, max_tracks)
        self._max_tracks = max_tracks
        self._free: IndexArray = np.arange(capacity, dtype=np.intp)[::-1]
        self.table = TrackTable()
        self.rings = SampleRings(capacity, SAMPLE_COLUMNS, keep_ns)
        self.velocity = CausalSlope(capacity, config.velocity_tau_s)
        self.acceleration = CausalSlope(
            capacity, config.acceleration_tau_s, _ACCELERATION_PRIOR_S2
        )
        self.motion = np.full((capacity, 2), np.nan)
        self.key = np.zeros((capacity, 4), dtype=np.uint32)
        self.agent_class = np.zeros(capacity, dtype=np.uint8)
        self.z = np.full(capacity, np.nan)
        self.size = np.full((capacity, 2), np.nan)
        self.covariance = np.full((capacity, 4, 4), np.nan)

    def blank(self, slot: IndexArray) -> None:
        """Make the slots as good as new; they keep their owners."""
        self.rings.blank(slot)
        self.velocity.reset(slot)
        self.acceleration.reset(slot)
        self.agent_class[slot] = 0
        for array in (self.motion, self.z, self.size, self.covariance):
            array[slot] = np.nan

    def forget_before(self, stamp_ns: int) -> int:
        """Take back the slots of tracks not seen since ``stamp_ns``; returns how many."""
        return self._release(self.rings.last_ns[self.table.slots] < stamp_ns)

    def admit(self, names: NameArray, others: IndexArray) -> tuple[IndexArray, int]:
        """Slots for new tracks, -1 where there is no room, and the number of tracks dropped.

        For lack of room, those not seen for longest go, then the surplus of the new ones.

        Args:
            names: [n] sorted names of the new tracks.
            others: slots of the known tracks in the same message; these never go.
        """
        slots = np.full(names.shape[0], -1, dtype=np.intp)
        if names.shape[0] == 0:
            return slots, 0
        room = min(names.shape[0], self._max_tracks - others.shape[0])
        evicted = self._evict(len(self.table) + room - self._max_tracks, others)
        if room > self._free.shape[0]:
            self._grow(len(self.table) + room)
        rest = self._free.shape[0] - room
        slots[:room], self._free = self._free[rest:][::-1], self._free[:rest]
        self.blank(slots[:room])
        self.table.add(names[:room], slots[:room])
        return slots, names.shape[0] - room + evicted

    def tell(self, slot: IndexArray, states: TrackedStates, index: IndexArray) -> None:
        """Keep what the observations ``index`` say beside the motion; unknown keeps the last."""
        self.key[slot] = states.key[index]
        agent_class, z, size = states.agent_class[index], states.z[index], states.size[index]
        self.agent_class[slot] = np.where(agent_class > 0, agent_class, self.agent_class[slot])
        self.z[slot] = np.where(np.isfinite(z), z, self.z[slot])
        self.size[slot] = np.where(np.isfinite(size), size, self.size[slot])
        self.covariance[slot] = states.covariance[index]

    def _evict(self, surplus: int, others: IndexArray) -> int:
        """Take back the slots of the tracks not seen for longest."""
        if surplus <= 0:
            return 0
        last_ns = self.rings.last_ns[self.table.slots]
        last_ns[np.isin(self.table.slots, others)] = np.iinfo(np.int64).max
        rows = np.zeros(len(self.table), dtype=bool)
        rows[np.argsort(last_ns, kind="stable")[:surplus]] = True
        return self._release(rows)

    def _release(self, rows: BoolArray) -> int:
        """Take back the slots in these rows of the table."""
        if not rows.any():
            return 0
        slots = self.table.remove(rows)
        self._free = np.concatenate([self._free, slots])
        return int(slots.shape[0])

    def _grow(self, least: int) -> None:
        """Room for at least ``least`` tracks."""
        old = self.rings.capacity
        capacity = min(max(2 * old, least), self._max_tracks)
        for name in ("motion", "key", "agent_class", "z", "size", "covariance"):
            array = getattr(self, name)
            more = np.zeros((capacity - old, *array.shape[1:]), dtype=array.dtype)
            setattr(self, name, np.concatenate([array, more]))  # blanked when handed out
        self.rings.grow(capacity)
        self.velocity.grow(capacity)
        self.acceleration.grow(capacity)
        self._free = np.concatenate([np.arange(old, capacity, dtype=np.intp)[::-1], self._free])
