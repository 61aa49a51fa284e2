# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Counts moves that show that several road users share an identity, as the node does.

Two publishers with the same identities make tracks that restart (``restarted``), or alternate
between two places (``alternating``). The counts come from the node's own history, message by
message, which takes half a millisecond each. It is therefore run only on suspect tracks, which are
found by the same rules applied to whole columns; a recording without this fault has hardly any.
"""

from __future__ import annotations

from collections import Counter

import numpy as np

from mtpgo_core.history.causal_slope import CausalSlope
from mtpgo_core.history.checks.alternation import IN_A_ROW, deviations, turned_back
from mtpgo_core.history.track_history import TrackHistory
from mtpgo_core.history.track_update import impossible_steps
from mtpgo_core.schema import BoolArray, Float64Array, KeyArray, tracked_states
from mtpgo_core.task.task_description import HistoryConfig
from mtpgo_training.data.recording import FRAME_ID, Int64Array

BLOCK = 256
"""Rows of a track whose velocities are estimated one after the other, while those of all other
blocks are, too; chosen: 10 µs a row for one long track, and the lead is a fraction of it."""

LEAD_TAUS, LEAD_ROWS = 20.0, 16
"""What is estimated before a block so that it begins with a past: time constants of the estimate,
and rows at least. Chosen: the weight of what is left out is exp(-40)."""

SPARE_M = 0.1
"""How much shorter than impossible a step may be and still be shown to the history (m); chosen far
above what the lead leaves out."""


def identity_moves(
    track: Int64Array, stamp_ns: Int64Array, position: Float64Array, key: KeyArray
) -> Counter[str]:
    """Return the node's counters ``restarted`` and ``alternating`` of a recording.

    Args:
        track: [rows] index of the track; the rows are in order of time, one of a track at a time.
        stamp_ns: [rows] (ns).
        position: [rows, 2] (m), finite.
        key: [tracks, 4] identities.
    """
    config = HistoryConfig()
    rows = np.flatnonzero(np.isin(track, _suspects(config, track, stamp_ns, position)))
    history = TrackHistory(config, max_tracks=len(key))
    counts: Counter[str] = Counter()
    borders = np.flatnonzero(np.diff(stamp_ns[rows])) + 1
    for some in np.split(rows, borders) if len(rows) else ():
        states = tracked_states(stamp_ns[some[0]], FRAME_ID, key[track[some]], position[some])
        report = history.update(states)
        counts.update(restarted=report.restarted, alternating=report.alternating)
    return counts


def _suspects(
    config: HistoryConfig, track: Int64Array, stamp_ns: Int64Array, position: Float64Array
) -> Int64Array:
    """Return all tracks that may restart or alternate by the rules of the history (a superset)."""
    order = np.argsort(track, kind="stable")
    past = _Pasts(config, track[order], stamp_ns[order], position[order])
    some = past.of(past.track[1:][past.impossible(_worst_velocities(past))])
    restarting = some.track[1:][some.impossible(_velocities(some)[:-1])]
    return np.union1d(restarting, past.track[2:][_alternating(past)])


class _Pasts:
    """The observations of tracks, by track and time, and which of them the history connects.

    Attributes:
        track, stamp_ns, position: [rows].
        again: [rows - 1] whether the next row continues the past of a row: a track that was
            forgotten meanwhile begins anew.
        dt_s: [rows - 1] time to the next row where it does (s).
        step: [rows - 1, 2] the way to it (m).
    """

    def __init__(
        self,
        config: HistoryConfig,
        track: Int64Array,
        stamp_ns: Int64Array,
        position: Float64Array,
    ) -> None:
        self.config, self.track, self.stamp_ns, self.position = config, track, stamp_ns, position
        self.again = (np.diff(track) == 0) & (np.diff(stamp_ns) <= config.keep_ns)
        self.dt_s = np.where(self.again, np.diff(stamp_ns) * 1e-9, 0.0)
        self.step = np.where(self.again[:, None], np.diff(position, axis=0), 0.0)

    def of(self, tracks: Int64Array) -> _Pasts:
        """Return those of some tracks."""
        rows = np.isin(self.track, tracks)
        return _Pasts(self.config, self.track[rows], self.stamp_ns[rows], self.position[rows])

    def impossible(self, velocity: Float64Array) -> BoolArray:
        """Return [rows - 1] the steps with which a track restarts, and some that are shorter.

        Args:
            velocity: [rows - 1, 2] estimated before each (m/s).
        """
        found = impossible_steps(self.config, self.dt_s, self.step, velocity, spare_m=SPARE_M)
        return self.again & found


def _worst_velocities(past: _Pasts) -> Float64Array:
    """Return [rows - 1, 2] velocities that bound how far a step deviates from any estimate.

    An estimate is a weighted mean of the track's step velocities, so no estimate is farther from
    the velocity of a step than a vector of the largest speed in the opposite direction.
    """
    moved_m = np.hypot(past.step[:, 0], past.step[:, 1])
    fastest_mps = np.zeros(int(past.track.max(initial=0)) + 1)
    speed_mps = moved_m / np.where(past.again, past.dt_s, 1.0)
    np.maximum.at(fastest_mps, past.track[1:], speed_mps)
    still = moved_m == 0.0
    along = np.where(
        still[:, None], (1.0, 0.0), past.step / np.where(still, 1.0, moved_m)[:, None]
    )
    return -fastest_mps[past.track[1:]][:, None] * along


def _velocities(past: _Pasts) -> Float64Array:
    """Return [rows, 2] the velocities that the history estimates from positions (m/s).

    Long pasts are cut into blocks, all of which are estimated at the same time.
    """
    rows, tau_s = len(past.track), past.config.velocity_tau_s
    velocity = np.empty((rows, 2))
    since_s = np.concatenate([[0.0], past.dt_s])
    starts = np.flatnonzero(np.concatenate([[True], ~past.again])[:rows])
    length = np.diff(np.append(starts, rows))
    blocks = -(-length // BLOCK)
    number = np.arange(blocks.sum()) - np.repeat(np.cumsum(blocks) - blocks, blocks)
    start = np.repeat(starts, blocks)
    begin = start + BLOCK * number
    end = np.minimum(begin + BLOCK, start + np.repeat(length, blocks))
    clock_s = np.cumsum(since_s)
    early = np.searchsorted(clock_s, clock_s[begin] - LEAD_TAUS * tau_s)
    lead = np.maximum(np.minimum(early, begin - LEAD_ROWS), start)
    order = np.argsort(lead - end, kind="stable")  # the longest first
    lead, begin, end = lead[order], begin[order], end[order]
    slope = CausalSlope(len(lead), tau_s)
    for n in range(int((end - lead).max(initial=0))):
        going = np.arange(np.searchsorted(lead - end, -n))
        at = lead[going] + n
        found = slope.step(going, since_s[at] if n else np.zeros(len(going)), past.position[at])
        own = at >= begin[going]
        velocity[at[own]] = found[own]
    return velocity


def _alternating(past: _Pasts) -> BoolArray:
    """Return [rows - 2] whether a track alternates at the row after next, without restarts."""
    inside = past.again[1:] & past.again[:-1]
    span_ns = np.where(inside, past.stamp_ns[2:] - past.stamp_ns[:-2], 1)
    share = (past.stamp_ns[1:-1] - past.stamp_ns[:-2]) / span_ns
    found = deviations(share, past.position[:-2], past.position[1:-1], past.position[2:])
    found[~inside] = 0.0
    turned = np.zeros(len(found), dtype=np.bool_)
    turned[1:] = turned_back(found[1:], found[:-1])
    in_a_row = turned.copy()
    for back in range(1, IN_A_ROW):
        in_a_row[back:] &= turned[:-back]
    return in_a_row
