# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Implausible velocities, headings and boxes of a recording as a whole."""

from __future__ import annotations

import numpy as np

from mtpgo_core.history.checks.box_fit import BoxFit
from mtpgo_core.history.checks.movement_fit import SPAN_S, MovementFit
from mtpgo_core.schema import BoolArray
from mtpgo_training.data.recording import Recording

MOST = 5000
"""Rows of a recording that are looked at, spread over it; chosen: a few milliseconds."""

_LONGEST_SPAN = 1.5
"""A movement whose end is later than this is left out (multiples of the usual span); chosen."""

MOST_FRAMES = 50
"""Frames of a recording whose boxes are looked at, spread over it; chosen."""


def stream_clues(recording: Recording) -> list[str]:
    """Return what is implausible in a recording as a whole, in the node's sentences on a stream.

    Args:
        recording: the recording.
    """
    movement, boxes = _movement(recording), _boxes(recording)
    found = (
        movement.velocity_problem,
        movement.heading_problem,
        boxes.size_problem,
        boxes.double_problem,
    )
    return [problem for problem in found if problem]


def _boxes(recording: Recording) -> BoxFit:
    """Look at the boxes of some frames."""
    fit, frames = BoxFit(), recording.frames
    known: BoolArray = np.asarray(np.isfinite(recording.position).all(axis=1))
    places = np.linspace(0, len(frames) - 1, min(MOST_FRAMES, len(frames)))
    chosen = frames[places.astype(np.intp)]
    begins, ends = (np.searchsorted(recording.frame, chosen, side) for side in ("left", "right"))
    for begin, end in zip(begins, ends, strict=True):
        rows = begin + np.flatnonzero(known[begin:end])
        track = recording.track[rows]
        fit.compare(recording.position[rows], recording.size[track], recording.agent_class[track])
    return fit


def _movement(recording: Recording) -> MovementFit:
    """Compare velocities and headings with movements."""
    order = np.argsort(recording.track, kind="stable")  # rows are in the order of time
    track, frame = recording.track[order], recording.frame[order]
    span = max(1, round(SPAN_S * recording.frame_rate))  # frames
    reach = int(frame.max(initial=0)) + span + 1
    time = track * reach + frame  # ascending: of one track after the other
    begin = np.linspace(0, len(order) - 1, min(MOST, len(order))).astype(np.intp)
    end = np.searchsorted(time, time[begin] + span)
    begin, end = begin[end < len(order)], end[end < len(order)]
    near = (track[end] == track[begin]) & (frame[end] - frame[begin] <= _LONGEST_SPAN * span)
    begin, end = begin[near], end[near]
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
    return fit
