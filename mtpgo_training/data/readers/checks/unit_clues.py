# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Detects times and positions of a recording that seem to be in another unit."""

from __future__ import annotations

import numpy as np

from mtpgo_core.history.checks.position_spread import one_place
from mtpgo_core.schema import BoolArray
from mtpgo_core.task.task_description import HistoryConfig
from mtpgo_training.data.recording import Recording, first_and_last

LONGEST_STEP_S, SHORTEST_STEP_S = 2.0, 5e-4
"""Usual times between two rows of a road user (s) beyond which no movement can be followed;
chosen: four times what the history bridges, and twice as often as any sensor measures."""

FEWEST_USERS, SMALLEST_M = 2, 0.5
"""So many road users at a time are not in a square of this size (m) for a whole recording; chosen:
those of a site in degrees or kilometres are."""

FEWEST_FRAMES = 10
"""In so many frames a road user is seen more than once; chosen."""


def unit_clue(recording: Recording) -> str:
    """Return why times or positions seem to be in another unit, empty if they do not.

    Only what holds for most road users counts: single ones may have defects.

    Args:
        recording: the recording.
    """
    finite = np.asarray(np.isfinite(recording.position).all(axis=1))
    if not finite.all():
        recording = recording.select_rows(finite)
    with np.errstate(over="ignore"):  # of positions that are defects
        return _clue(recording) if len(recording) else ""


def impossible_velocities(recording: Recording) -> BoolArray:
    """Return [rows] which ones the history leaves out for their recorded velocity."""
    speed_mps = np.hypot(recording.velocity[:, 0], recording.velocity[:, 1])
    return np.asarray(speed_mps > HistoryConfig().max_speed_mps)  # false for NaN


def _clue(recording: Recording) -> str:
    """Return the clue in a recording with rows and finite positions."""
    frame, track, position = recording.frame, recording.track, recording.position
    first, last = first_and_last(track, len(recording.track_id))  # rows are in the order of time
    rows = np.bincount(track, minlength=len(recording.track_id))
    several, step_s = rows > 1, 0.0
    if several.any():
        first, last = first[several], last[several]
        seconds = (frame[last] - frame[first]) / recording.frame_rate
        step_s = float(np.median(seconds / (rows[several] - 1)))
        if not SHORTEST_STEP_S <= step_s <= LONGEST_STEP_S:
            return (
                f"a row of a road user every {step_s:.3g} s, so that no movement can be followed; "
                "is the unit of the times another one?"
            )
        moved = position[last] - position[first]
        speed_mps = float(np.median(np.hypot(moved[:, 0], moved[:, 1]) / seconds))
        if speed_mps > HistoryConfig().max_speed_mps:
            return (
                f"the road users move at {speed_mps:.5g} m/s, so that the history rejects most "
                "rows; is the unit of the positions or of the times another one?"
            )
    size_m = float(np.ptp(position, axis=0).max())
    _, together = np.unique(frame, return_counts=True)
    if together.max() >= FEWEST_USERS and size_m < SMALLEST_M:
        return one_place(int(together.max()), size_m)
    rows = rows[rows > 0]
    if len(together) >= FEWEST_FRAMES and np.median(rows) < 2:
        return (
            f"most of the {len(rows)} road users have one row, so that no movement can be "
            "followed; are the identities others in each frame?"
        )
    bridged_s = HistoryConfig().max_gap_s
    if step_s > bridged_s * (1.0 + 1e-6):
        return (
            f"a row of a road user every {step_s:.3g} s, where the history bridges {bridged_s:g} "
            "s, so that the road users have no past"
        )
    return ""
