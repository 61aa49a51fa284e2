# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Counts the moves by which the node notices that an identity stands for several road users.

Two publishers with the same identities make tracks that restart (``restarted``), or alternate
between two places (``alternating``). The node's own history decides; it is asked only about tracks
that may do so by a bound that whole columns are compared with, which takes far less time.
"""

from __future__ import annotations

from collections import Counter

import numpy as np

from mtpgo_core.history.alternation import LEAST_M
from mtpgo_core.history.track_history import TrackHistory
from mtpgo_core.history.track_update import JUMP_M, JUMP_MPSS
from mtpgo_core.schema import Float64Array, KeyArray, tracked_states
from mtpgo_core.task.task_description import HistoryConfig
from mtpgo_training.data.recording import FRAME_ID, Int64Array


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
    rows = np.flatnonzero(np.isin(track, _suspects(track, stamp_ns, position)))
    history = TrackHistory(HistoryConfig(), max_tracks=len(key))
    counts: Counter[str] = Counter()
    borders = np.flatnonzero(np.diff(stamp_ns[rows])) + 1
    for some in np.split(rows, borders) if len(rows) else ():
        states = tracked_states(stamp_ns[some[0]], FRAME_ID, key[track[some]], position[some])
        report = history.update(states)
        counts.update(restarted=report.restarted, alternating=report.alternating)
    return counts


def _suspects(track: Int64Array, stamp_ns: Int64Array, position: Float64Array) -> Int64Array:
    """Return the tracks that may restart or alternate by the rules of the history."""
    order = np.argsort(track, kind="stable")
    track, position = track[order], position[order]
    again = np.diff(track) == 0
    dt_s = np.where(again, np.diff(stamp_ns[order]) * 1e-9, 1.0)
    step = np.where(again[:, None], np.diff(position, axis=0), 0.0)
    moved_m = np.hypot(step[:, 0], step[:, 1])
    # The estimated velocity is a mean of those between two observations of the track.
    fastest_mps = np.zeros(int(track.max()) + 1 if len(track) else 0)
    np.maximum.at(fastest_mps, track[1:], moved_m / dt_s)
    farthest_m = moved_m + fastest_mps[track[1:]] * dt_s
    jumps = again & (farthest_m > JUMP_M + 0.5 * JUMP_MPSS * dt_s**2)
    jumps |= moved_m > JUMP_M + HistoryConfig().max_speed_mps * dt_s
    inside = again[1:] & again[:-1]
    share = (dt_s[:-1] / (dt_s[:-1] + dt_s[1:]))[:, None]
    off = (1.0 - share) * step[:-1] - share * step[1:]
    bent = inside & (np.hypot(off[:, 0], off[:, 1]) > LEAST_M)
    return np.union1d(track[1:][jumps], track[2:][bent])
