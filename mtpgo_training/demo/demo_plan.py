# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Which recordings the demo plays, and at which times of the common clock."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from mtpgo_core.errors import RecordingError
from mtpgo_training.data.recording import DEFAULT_START_NS, Recording
from mtpgo_training.evaluation.training_overlap import seen_hashes

PAUSE_S = 60.0
"""Time of the observations' clock between two recordings (s): no history reaches over it."""


@dataclass(frozen=True)
class DemoPlan:
    """The recordings to play, one after the other, on one rising clock.

    Attributes:
        recordings: in order, ``start_time_ns`` set so that their stamps never fall.
        left_out: names of those that the model was trained on and that are not played.
    """

    recordings: tuple[Recording, ...]
    left_out: tuple[str, ...]

    @property
    def duration_s(self) -> float:
        """Time that playing takes at real time, without the pauses (s)."""
        return sum(recording.duration_s for recording in self.recordings)

    def at(self, stamp_ns: int) -> int | None:
        """Index of the recording that an observation of this time belongs to."""
        for index, recording in enumerate(self.recordings):
            first, last = span_ns(recording)
            if first <= stamp_ns <= last:
                return index
        return None


def span_ns(recording: Recording) -> tuple[int, int]:
    """Stamps of the first and last frame (ns)."""
    frames = recording.frames
    return recording.stamp_ns(int(frames[0])), recording.stamp_ns(int(frames[-1]))


def make_plan(
    recordings: Sequence[Recording], training: Mapping[str, Any], *, play_all: bool
) -> DemoPlan:
    """The recordings that the model has not seen, laid out in time.

    Args:
        recordings: all that were asked for.
        training: the model's own account of its training, ``TaskDescription.training``.
        play_all: play those too that it was trained on.

    Raises:
        RecordingError: nothing is left to play.
    """
    seen = seen_hashes(training)
    played = [r for r in recordings if len(r) and (play_all or r.sha256 not in seen)]
    left_out = [r.name for r in recordings if len(r) and not play_all and r.sha256 in seen]
    if not played:
        raise RecordingError(
            f"the model was trained on all {len(left_out)} recordings given, expected one that "
            "it has not seen, or --all to play them nevertheless"
            if left_out
            else "the recordings given are empty, expected at least one road user"
        )
    start_ns, placed = DEFAULT_START_NS, []
    for recording in played:
        offset_ns = span_ns(recording)[0] - recording.start_time_ns
        recording = dataclasses.replace(recording, start_time_ns=start_ns - offset_ns)
        placed.append(recording)
        start_ns = span_ns(recording)[1] + round(PAUSE_S * 1e9)
    return DemoPlan(tuple(placed), tuple(left_out))
