# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The rolling history of every track, resampled on the model's time grid.

Observations may arrive at any rate and with jitter (docs/design.md, decisions 1, 2 and 13). Each
kind of odd observation has one outcome and one counter:

===========================================  ==================================================
observation                                  outcome
===========================================  ==================================================
position NaN, infinite or beyond 1e8 m       that agent's observation is rejected (``non_finite``)
velocity, acceleration, yaw not finite       treated as missing, estimated
speed above ``max_speed_mps``                that agent's observation is rejected (``too_fast``)
impossible move since the last sample        the track restarts there (``restarted``)
to and fro between two places                used, and counted (``alternating``): two publishers
                                             may share the identity
same track twice in a message                the first usable one is used (``duplicate_keys``)
same stamp as the track's newest             dropped (``duplicates``)
older than the track's newest                dropped (``late``); other tracks are updated
older than the newest stamp by more than     used, but too old to be predicted (``behind``):
``max_extrapolation_s``                      another publisher's clock is ahead
stamp older than the whole window, or the    the clock jumped back (a bag loops): the history
third message in a row older than the        is cleared and starts with this message
newest by more than 0.5 s                    (``clock_reset``); after a jump that a newer message
                                             showed to be none, twice as many in a row are needed
another frame                                message rejected (``frame_changed``); the third in a
                                             row in one new frame starts a new history in it
empty message                                only the time advances
more objects than ``max_tracks``             the nearest to the ego or the middle are used
                                             (``left_out``)
more tracks than ``max_tracks``              those unseen for longest are evicted (``dropped``)
not seen for the window plus one gap         forgotten (``forgotten``)
===========================================  ==================================================

There is no loop over agents: every step is an array operation over the agents of a message.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.history.nearest_tracks import centre_of, nearest
from mtpgo_core.history.observed_positions import ObservedPositions
from mtpgo_core.history.resampling import (
    NEVER_NS,
    TOLERANCE_NS,
    Brackets,
    bracket,
    interpolate_linear,
)
from mtpgo_core.history.stream_guard import MessageStatus, StreamGuard, UpdateReport
from mtpgo_core.history.track_index import sort_keys
from mtpgo_core.history.track_store import ACCELERATION, POSITION, VELOCITY, YAW, TrackStore
from mtpgo_core.history.track_update import (
    complete_samples,
    extrapolate_covariance,
    interpolate,
    moved_impossibly,
    usable_observations,
)
from mtpgo_core.schema import HistoryWindow, IndexArray, KeyArray, TrackedStates
from mtpgo_core.task.task_description import HistoryConfig

__all__ = ["TrackHistory", "UpdateReport"]


class TrackHistory:
    """Rolling history of up to ``max_tracks`` tracks.

    Args:
        config: grid, gaps and estimators.
        max_tracks: limit of the memory, see the table of this module.
        first_number: number of the first track.

    Attributes:
        config: as given.
        observed: numbers of the tracks that the last message observed.
        restarted: numbers of the tracks that ended with the last message because of an impossible
            move; their identities go on under other numbers.
    """

    def __init__(
        self, config: HistoryConfig, max_tracks: int = 4096, *, first_number: int = 0
    ) -> None:
        self.config = config
        self._max_tracks = max_tracks
        self._keep_ns = config.keep_ns
        self._grid_ns = np.array(config.grid_ns, dtype=np.int64)
        self._guard = StreamGuard(self._keep_ns)
        self._store = TrackStore(config, max_tracks, self._keep_ns, first_number)
        self.observed: NDArray[np.int64] = np.empty(0, dtype=np.int64)
        self.restarted = self.observed

    def clear(self) -> None:
        """Forget all tracks, the clock and the frame."""
        self._guard.clear()
        self._forget_tracks()

    def _forget_tracks(self) -> None:
        """Forget all tracks; their numbers are not used again."""
        self._store = TrackStore(
            self.config, self._max_tracks, self._keep_ns, self._store.next_number
        )

    def forget(self, key: KeyArray) -> None:
        """Forget the tracks of identities [n, 4] that have one."""
        self._store.forget(sort_keys(key))

    def __len__(self) -> int:
        return len(self._store.index)

    @property
    def next_number(self) -> int:
        """Number of the next track; numbers are never used twice."""
        return self._store.next_number

    @property
    def newest_stamp_ns(self) -> int | None:
        """Stamp of the newest message (ns), None before the first."""
        return self._guard.newest_ns

    @property
    def frame_id(self) -> str:
        """Frame of the history, empty before the first object."""
        return self._guard.frame_id or ""

    def update(self, states: TrackedStates, ego_key: KeyArray | None = None) -> UpdateReport:
        """Add one message; the table of this module lists the outcomes.

        Args:
            states: the message.
            ego_key: [4] identity of the ego, around which objects are kept if there are too many.
        """
        stamp_ns = int(states.stamp_ns)
        # Without objects the frame is irrelevant; some messages then name none.
        self.observed = self.restarted = np.empty(0, dtype=np.int64)
        status = self._guard.classify(stamp_ns, states.frame_id if len(states) else None)
        if status is MessageStatus.UNEXPECTED_FRAME:
            return UpdateReport(frame_changed=True, wrong_frame=len(states))
        if status is not MessageStatus.CONTINUES:
            self._forget_tracks()
        with np.errstate(invalid="ignore", over="ignore"):
            return self._add(stamp_ns, states, status, ego_key)

    def _add(
        self,
        stamp_ns: int,
        states: TrackedStates,
        status: MessageStatus,
        ego_key: KeyArray | None,
    ) -> UpdateReport:
        """Add a message that belongs to the stream, and return what became of its observations."""
        store, newest_ns = self._store, self._guard.newest_ns
        newest_ns = stamp_ns if newest_ns is None else newest_ns
        forgotten = store.forget_before(newest_ns - self._keep_ns)

        finite, too_fast = usable_observations(self.config, states)
        usable = np.flatnonzero(finite & ~too_fast)
        keys, first = np.unique(sort_keys(states.key[usable]), return_index=True)
        row = usable[first]
        slot = store.index.find(keys)
        unique = keys.shape[0]
        if unique > self._max_tracks:
            position = states.position[row]
            centre = centre_of(position, keys, ego_key)
            near = nearest(position, centre, self._max_tracks, slot >= 0)
            keys, row, slot = keys[near], row[near], slot[near]
        left_out = unique - keys.shape[0]
        last_ns = np.where(slot >= 0, store.rings.last_ns[slot], NEVER_NS)
        newer = last_ns < stamp_ns
        keys, row, slot = keys[newer], row[newer], slot[newer]

        known = slot >= 0
        jumped, alternating = self._check_moves(stamp_ns, states, row[known], slot[known])
        new, dropped = store.allocate(keys[~known], slot[known])
        slot[~known] = new
        slot, row = slot[slot >= 0], row[slot >= 0]
        self._store_samples(stamp_ns, states, row, slot)
        return UpdateReport(
            accepted=slot.shape[0],
            new_tracks=int((new >= 0).sum()),
            restarted=jumped,
            alternating=alternating,
            duplicates=int((last_ns == stamp_ns).sum()),
            late=int((last_ns > stamp_ns).sum()),
            behind=slot.shape[0] if self._behind(stamp_ns) else 0,
            duplicate_keys=usable.shape[0] - unique,
            left_out=left_out,
            non_finite=int((~finite).sum()),
            too_fast=int(too_fast.sum()),
            dropped=dropped,
            forgotten=forgotten,
            clock_reset=status is MessageStatus.CLOCK_RESET,
            frame_changed=status is MessageStatus.NEW_FRAME,
        )

    def _check_moves(
        self, stamp_ns: int, states: TrackedStates, row: IndexArray, slot: IndexArray
    ) -> tuple[int, int]:
        """Restart known tracks that moved impossibly; return how many, and how many alternate.

        Args:
            stamp_ns: of the message.
            states: the message.
            row: [k] observations of known tracks.
            slot: [k] the slots of these tracks.
        """
        store, position = self._store, states.position[row]
        jumped = moved_impossibly(self.config, store, slot, stamp_ns, position)
        steady = slot[~jumped]
        alternating = store.alternation.step(
            steady,
            stamp_ns,
            position[~jumped],
            store.rings.last_ns[steady],
            store.rings.last[steady, POSITION],
        )
        if jumped.any():
            self.restarted = store.number[slot[jumped]]
            store.reset(slot[jumped])
        return int(jumped.sum()), int(alternating.sum())

    def _store_samples(
        self, stamp_ns: int, states: TrackedStates, row: IndexArray, slot: IndexArray
    ) -> None:
        """Append the observations ``row`` [k] as samples of the tracks in ``slot`` [k]."""
        if not slot.shape[0]:
            return
        store = self._store
        first_seen = slot[store.rings.count[slot] == 0]
        store.first_ns[first_seen] = stamp_ns
        sample = complete_samples(self.config, store, slot, stamp_ns, states, row)
        store.rings.append(slot, stamp_ns, sample)
        store.update_attributes(slot, states, row)
        self.observed = store.number[slot]

    def _behind(self, stamp_ns: int) -> bool:
        """Return whether a message is too old to be extrapolated to the newest stamp."""
        newest_ns = self._guard.newest_ns
        late_ns = 0 if newest_ns is None else newest_ns - stamp_ns
        return late_ns > self.config.max_extrapolation_ns + TOLERANCE_NS

    def track_numbers(self, key: KeyArray, stamp_ns: int) -> NDArray[np.int64]:
        """Return [n] numbers of the tracks that had these identities at a time, -1 for none.

        A track that started after that time is another one: the identity was used again, or the
        track moved impossibly and started again.

        Args:
            key: [n, 4] identities.
            stamp_ns: the time (ns), not after the newest stamp.
        """
        store = self._store
        slot = store.index.find(sort_keys(key))
        there = (slot >= 0) & (store.first_ns[slot] <= stamp_ns)
        return np.where(there, store.number[slot], -1)

    def observed_positions(self, times_ns: NDArray[np.int64]) -> ObservedPositions:
        """Return where all tracks were at past times, by the rule of the windows' samples.

        A position is known where the track was observed then, or before and after it within
        ``max_gap_s``; nothing is extrapolated.

        Args:
            times_ns: [k] ascending times (ns), not after the newest stamp.
        """
        store = self._store
        order = np.argsort(store.number[store.index.slots])
        slot = store.index.slots[order]
        stamps, place = store.rings.in_order(slot)
        newest_ns = max(self._guard.newest_ns or 0, int(times_ns[-1]))
        brackets = bracket(
            stamps,
            np.append(times_ns, newest_ns),  # samples after the last time are used up to here
            max_gap_ns=self.config.max_gap_ns,
            max_extrapolation_ns=-1,
        )
        rows = np.arange(slot.shape[0])[:, None]
        left, right = (
            store.rings.samples(slot, place[rows, side[:, :-1]])[..., POSITION]
            for side in (brackets.left, brackets.right)
        )
        return ObservedPositions(
            number=store.number[slot],
            last_ns=store.rings.last_ns[slot],
            position=interpolate_linear(left, right, brackets.fraction[:, :-1, None]),
            known=brackets.valid[:, :-1],
        )

    def window(self, stamp_ns: int | None = None) -> HistoryWindow:
        """Return the grid samples up to a common time, of every track that has any.

        The agents are in the order of their 128-bit identities, whatever the order of messages.

        Args:
            stamp_ns: the common time t (ns), default the newest stamp. Samples after t are
                ignored; tracks not seen at t are extrapolated to t at constant velocity, by
                ``max_extrapolation_s`` at most.

        Returns:
            The window; empty (stamp 0 unless given) before the first message.
        """
        store = self._store
        if stamp_ns is None:
            stamp_ns = self._guard.newest_ns or 0
        slot = store.index.slots
        stamps, place = store.rings.in_order(slot)
        brackets = bracket(
            stamps,
            stamp_ns + self._grid_ns,
            max_gap_ns=self.config.max_gap_ns,
            max_extrapolation_ns=self.config.max_extrapolation_ns,
        )
        seen = np.flatnonzero(brackets.valid.any(axis=1))
        if seen.shape[0] < slot.shape[0]:
            brackets = Brackets(**{k: v[seen] for k, v in vars(brackets).items()})
            slot, place = slot[seen], place[seen]
        rows = np.arange(slot.shape[0])[:, None]
        sample = interpolate(
            store.rings.samples(slot, place[rows, brackets.left]),
            store.rings.samples(slot, place[rows, brackets.right]),
            brackets,
        )
        return HistoryWindow(
            stamp_ns=stamp_ns,
            frame_id=self.frame_id,
            key=store.key[slot],
            agent_class=store.agent_class[slot],
            z=store.z[slot],
            size=store.size[slot],
            position=sample[..., POSITION],
            velocity=sample[..., VELOCITY],
            acceleration=sample[..., ACCELERATION],
            yaw=sample[..., YAW],
            valid=brackets.valid,
            covariance=extrapolate_covariance(store.covariance[slot], brackets.after_s),
        )
