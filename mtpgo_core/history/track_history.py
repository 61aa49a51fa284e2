# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The rolling past of every track, resampled on the model's grid (design D1, D2, D13, section 4).

Observations may come at any rate and jitter. What happens to odd ones is fixed here, and counted:

===========================================  ==================================================
observation                                  outcome
===========================================  ==================================================
position NaN, infinite or beyond 1e8 m       that agent's observation is rejected (``non_finite``)
velocity, acceleration, yaw not finite       taken as missing, estimated
given speed above ``max_speed_mps``          that agent's observation is rejected (``too_fast``)
moved farther than it can have moved         the track starts anew there (``restarted``)
same track twice in a message                the first usable one counts (``duplicate_keys``)
same stamp as the track's newest             dropped (``duplicates``)
older than the track's newest                dropped (``late``); other tracks are served
stamp older than the whole window, or the    the clock jumped back (a bag loops): the past is
third message in a row older than the        forgotten and begins with this message
newest by more than 0.5 s                    (``clock_reset``)
another frame                                message rejected (``frame_changed``); the third in a
                                             row in one new frame starts a new past in it
empty message                                the time goes on, nothing else
more tracks than ``max_tracks``              those not seen for longest go, then the surplus of
                                             the message is dropped (``dropped``)
not seen for the window and one gap          forgotten (``forgotten``)
===========================================  ==================================================

No loop runs over agents: every step is an array operation over the agents of a message.
"""

from __future__ import annotations

import numpy as np

from mtpgo_core.history.resampling import NEVER_NS, Brackets, bracket
from mtpgo_core.history.stream_guard import StreamWatch, UpdateReport, Verdict
from mtpgo_core.history.track_index import names_of
from mtpgo_core.history.track_store import ACCELERATION, POSITION, VELOCITY, YAW, TrackStore
from mtpgo_core.history.track_update import carry, derive, has_jumped, interpolate, usable
from mtpgo_core.schema import HistoryWindow, TrackedStates
from mtpgo_core.task.task_description import HistoryConfig

__all__ = ["TrackHistory", "UpdateReport"]


class TrackHistory:
    """Rolling past of up to ``max_tracks`` tracks.

    Args:
        config: grid, gaps and estimators.
        max_tracks: bound on the memory, see the module's table.
    """

    def __init__(self, config: HistoryConfig, max_tracks: int = 4096) -> None:
        self.config = config
        self._max_tracks = max_tracks
        self._keep_ns = config.keep_ns
        self._grid_ns = np.array(config.grid_ns, dtype=np.int64)
        self._watch = StreamWatch(self._keep_ns)
        self.clear()

    def clear(self) -> None:
        """Forget everything, the clock and the frame included."""
        self._watch.clear()
        self._store = TrackStore(self.config, self._max_tracks, self._keep_ns)

    def __len__(self) -> int:
        return len(self._store.table)

    @property
    def newest_stamp_ns(self) -> int | None:
        """Stamp of the newest message (ns), None before the first."""
        return self._watch.newest_ns

    @property
    def frame_id(self) -> str:
        """The frame of the past, empty before the first object."""
        return self._watch.frame_id or ""

    def update(self, states: TrackedStates) -> UpdateReport:
        """Take one message in; the module's table says what becomes of what."""
        stamp_ns = int(states.stamp_ns)
        # Without objects the name of the frame means nothing; some messages then have none.
        verdict = self._watch.judge(stamp_ns, states.frame_id if len(states) else None)
        if verdict is Verdict.STRANGE_FRAME:
            return UpdateReport(frame_changed=True, wrong_frame=len(states))
        if verdict is not Verdict.CONTINUES:
            self._store = TrackStore(self.config, self._max_tracks, self._keep_ns)
        with np.errstate(invalid="ignore", over="ignore"):
            return self._take(stamp_ns, states, verdict)

    def _take(self, stamp_ns: int, states: TrackedStates, verdict: Verdict) -> UpdateReport:
        store, newest_ns = self._store, self._watch.newest_ns
        newest_ns = stamp_ns if newest_ns is None else newest_ns
        forgotten = store.forget_before(newest_ns - self._keep_ns)

        finite, too_fast = usable(self.config, states)
        rows = np.flatnonzero(finite & ~too_fast)
        names, first = np.unique(names_of(states.key[rows]), return_index=True)
        index = rows[first]
        slot = store.table.find(names)
        last_ns = np.where(slot >= 0, store.rings.last_ns[slot], NEVER_NS)
        fresh = last_ns < stamp_ns
        names, index, slot = names[fresh], index[fresh], slot[fresh]

        known = slot >= 0
        seen_again = slot[known]
        jumped = has_jumped(
            self.config, store, seen_again, stamp_ns, states.position[index[known]]
        )
        if jumped.any():
            store.blank(seen_again[jumped])
        new, dropped = store.admit(names[~known], seen_again)
        slot[~known] = new
        slot, index = slot[slot >= 0], index[slot >= 0]
        if slot.shape[0]:
            sample = derive(self.config, store, slot, stamp_ns, states, index)
            store.rings.append(slot, stamp_ns, sample)
            store.tell(slot, states, index)
        return UpdateReport(
            accepted=slot.shape[0],
            new_tracks=int((new >= 0).sum()),
            restarted=int(jumped.sum()),
            duplicates=int((last_ns == stamp_ns).sum()),
            late=int((last_ns > stamp_ns).sum()),
            duplicate_keys=rows.shape[0] - first.shape[0],
            non_finite=int((~finite).sum()),
            too_fast=int(too_fast.sum()),
            dropped=dropped,
            forgotten=forgotten,
            clock_reset=verdict is Verdict.CLOCK_RESET,
            frame_changed=verdict is Verdict.NEW_FRAME,
        )

    def window(self, stamp_ns: int | None = None) -> HistoryWindow:
        """The grid samples up to a common time, of every track that has any.

        The agents stand in the order of their 128-bit numbers, whatever the order of messages.

        Args:
            stamp_ns: the common time t (ns), default the newest stamp. Samples after t are not
                looked at; tracks not seen at t are carried on to t at constant velocity, for
                ``max_extrapolation_s`` at most.

        Returns:
            The window; empty (stamp 0 unless given) before the first message.
        """
        store = self._store
        if stamp_ns is None:
            stamp_ns = self._watch.newest_ns or 0
        slot = store.table.slots
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
            covariance=carry(store.covariance[slot], brackets.after_s),
        )
