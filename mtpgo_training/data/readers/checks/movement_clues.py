# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Clues that velocities or headings of a recording are of another frame or unit."""

from __future__ import annotations

import numpy as np

from mtpgo_core.history.checks.movement_fit import SPAN_S, MovementFit
from mtpgo_training.data.recording import Recording

MOST = 20_000
"""Movements of a recording that are looked at, spread over it; chosen: a few milliseconds."""

_LONGEST_SPAN = 1.5
"""A movement whose end is later than this is left out (multiples of the usual span); chosen."""


def movement_clues(recording: Recording) -> list[str]:
    """Return how velocities and headings do not fit the movement, nothing where they do.

    Args:
        recording: the recording.
    """
    order = np.lexsort((recording.frame, recording.track))
    track, frame = recording.track[order], recording.frame[order]
    span = max(1, round(SPAN_S * recording.frame_rate))  # frames
    reach = int(frame.max(initial=0)) + span + 1
    time = track * reach + frame  # ascending: of one track after the other
    end = np.searchsorted(time, time + span)
    begin = np.flatnonzero(end < len(order))
    end = end[begin]
    near = (track[end] == track[begin]) & (frame[end] - frame[begin] <= _LONGEST_SPAN * span)
    begin, end = begin[near], end[near]
    if len(begin) > MOST:
        chosen = np.linspace(0, len(begin) - 1, MOST).astype(np.intp)
        begin, end = begin[chosen], end[chosen]
    rows = np.stack([order[begin], order[(begin + end) // 2], order[end]])
    with np.errstate(invalid="ignore", over="ignore"):  # of positions that are defects
        moved = recording.position[rows[2]] - recording.position[rows[0]]
        moved *= (recording.frame_rate / (frame[end] - frame[begin]))[:, None]
        known = np.isfinite(moved).all(axis=1)
        velocity = recording.velocity[rows][:, known]
        fit = MovementFit()
        fit.compare(
            moved[known],
            0.25 * (velocity[0] + 2.0 * velocity[1] + velocity[2]),
            recording.yaw[rows[1]][known],
        )
    return [problem for problem in (fit.velocity_problem, fit.heading_problem) if problem]
