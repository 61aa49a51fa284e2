# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Predictions read from a bag, matched to the recordings that they were made on."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from msg_adapters.predictions import predictions_in_bag
from mtpgo_core.errors import RecordingError
from mtpgo_core.prediction.output_assembly import select
from mtpgo_core.prediction.prediction_queries import first_places
from mtpgo_core.risk.collision_risk import WEIGHT_TOLERANCE
from mtpgo_core.schema import BoolArray, Prediction
from mtpgo_training.data.recording import Recording
from mtpgo_training.evaluation.bags.clock_alignment import AlignedPart, restamped

NEAR_M = 30.0
"""A prediction is of the road user with its identity only if it begins closer than this to where
that one was (m). Identities are numbers that every recording uses again. Chosen: more than any
road user moves in a step."""

STAMP_SLACK_NS = 1_000_000
"""A prediction this close to a frame is one of the frame (ns): bags and layouts round differently,
and irregular messages are put on a grid of milliseconds."""


def read_predictions(
    path: Path, topic: str | None = None, *, span_ns: tuple[int, int] | None = None
) -> list[Prediction]:
    """Return the predictions in a bag, ascending in time, the last one of each stamp.

    Args:
        path: a rosbag2 directory or an ``.mcap`` file.
        topic: their topic; by default the one that holds predictions.
        span_ns: first and last stamp of those wanted (ns), None for all.

    Raises:
        NoPredictionsError: it holds no predictions.
        RecordingError: it is not a bag, or it is damaged.
    """
    return last_of_each_stamp(predictions_in_bag(path, topic, span_ns=span_ns))


def last_of_each_stamp(predictions: Iterable[Prediction]) -> list[Prediction]:
    """Return predictions ascending in time, of those with the same stamp the last one."""
    found = {one.stamp_ns: one for one in predictions}
    return [found[stamp] for stamp in sorted(found)]


def without_holes(predictions: Sequence[Prediction]) -> tuple[list[Prediction], int]:
    """Return predictions without the agents of which points are missing, and how many these are.

    A cloud that was filtered has such agents; a score needs every mode and step.
    """
    whole, holes = [], 0
    for one in predictions:
        kept = np.isfinite(one.mean).all(axis=(1, 2, 3)) & np.isfinite(one.time_s).all()
        kept &= np.abs(one.weight.sum(axis=1) - 1.0) <= WEIGHT_TOLERANCE
        holes += int((~kept).sum())
        whole.append(one if kept.all() else select(one, kept))
    return whole, holes


@dataclasses.dataclass(frozen=True)
class Matched:
    """Recorded predictions by recording.

    Attributes:
        by_recording: name -> predictions, stamped with the recording's own frames, their agents
            only those that the recording has there.
        unmatched: number of predictions of which no agent is in any recording.
    """

    by_recording: dict[str, list[Prediction]]
    unmatched: int


def match(
    bag: Path,
    predictions: Sequence[Prediction],
    recordings: Mapping[str, Recording],
    parts: Sequence[AlignedPart] = (),
) -> Matched:
    """Find the recording of each prediction, by time, identities and positions.

    Args:
        bag: where they come from, for the error.
        predictions: what was recorded.
        recordings: what may have been played, by name.
        parts: the parts of the bag by its own observations, if there are any.

    Raises:
        RecordingError: none of them belongs to any of the recordings.
    """
    by_recording: dict[str, list[Prediction]] = {}
    positions = {name: _PositionTable(recording) for name, recording in recordings.items()}
    unmatched = 0
    for prediction in predictions:
        if not len(prediction):
            continue
        part = next((p for p in parts if p.name and p.holds(prediction.stamp_ns)), None)
        stamp_ns = prediction.stamp_ns if part is None else restamped(prediction, part)
        found = [
            (name, *table.find(prediction, stamp_ns))
            for name, table in positions.items()
            if part is None or part.name == name
        ]
        name, stamp_ns, rows = max(found, key=lambda item: int(item[2].sum()))
        if not rows.any():
            unmatched += 1
            continue
        own = dataclasses.replace(select(prediction, np.flatnonzero(rows)), stamp_ns=stamp_ns)
        by_recording.setdefault(name, []).append(own)
    if not by_recording:
        spans = [s for r in recordings.values() for s in r.span_ns]
        stamps = [p.stamp_ns for p in predictions]
        raise RecordingError(
            f"the {len(predictions)} predictions in {bag}, stamped from {min(stamps) * 1e-9:.1f} "
            f"to {max(stamps) * 1e-9:.1f} s, are of no road user of the recordings "
            f"{', '.join(recordings)}, stamped from {min(spans) * 1e-9:.1f} to "
            f"{max(spans) * 1e-9:.1f} s, expected the recordings that were played"
        )
    return Matched(by_recording, unmatched)


class _PositionTable:
    """Positions of the agents of a recording by frame and identity."""

    def __init__(self, recording: Recording) -> None:
        self._recording = recording
        self._first_ns, self._last_ns = recording.span_ns

    def find(self, prediction: Prediction, stamp_ns: int) -> tuple[int, BoolArray]:
        """Return the stamp of the frame (ns), and [n] which agents the recording has there."""
        recording = self._recording
        early, late = self._first_ns - STAMP_SLACK_NS, self._last_ns + STAMP_SLACK_NS
        if not early <= stamp_ns <= late:
            return stamp_ns, np.zeros(len(prediction), dtype=np.bool_)
        # An agent may be predicted for a moment after it was seen for the last time.
        frames = recording.frames
        index = int(np.searchsorted(frames, self._frame(stamp_ns) - 0.5))
        after = frames[min(index, len(frames) - 1)]
        if abs(recording.stamp_ns(int(after)) - stamp_ns) <= STAMP_SLACK_NS:
            stamp_ns = recording.stamp_ns(int(after))
        start, end = np.searchsorted(
            recording.frame, [self._frame(stamp_ns) - 0.6 * recording.frame_rate, after + 1]
        )
        last = np.full(len(recording.track_id) + 1, -1)  # row of each track; the last is for -1
        last[recording.track[start:end]] = np.arange(start, end)
        row = last[recording.find_tracks(prediction.key)]
        away = np.linalg.norm(first_places(prediction) - recording.position[row], axis=-1)
        with np.errstate(invalid="ignore"):
            return stamp_ns, (row >= 0) & (away < NEAR_M)

    def _frame(self, stamp_ns: int) -> float:
        return (stamp_ns - self._recording.start_time_ns) * 1e-9 * self._recording.frame_rate
