# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Selects the recordings that the demo plays and lays them out on one time axis."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from mtpgo_core.errors import RecordingError
from mtpgo_training.data.recording import DEFAULT_START_NS, Recording
from mtpgo_training.evaluation.training_overlap import is_known

PAUSE_S = 60.0
"""Gap between the stamps of two recordings (s). Chosen: far longer than a history (3 s)."""


@dataclass(frozen=True)
class PlaybackPlan:
    """The recordings to play one after the other, with increasing stamps.

    Attributes:
        recordings: in the order of playback, with ``start_time_ns`` set so that stamps increase.
        left_out: names of the recordings not played because the model was trained or chosen
            with them.
    """

    recordings: tuple[Recording, ...]
    left_out: tuple[str, ...]

    @property
    def duration_s(self) -> float:
        """Duration of all recordings, without the gaps between their stamps (s)."""
        return sum(recording.duration_s for recording in self.recordings)

    def at(self, stamp_ns: int) -> int | None:
        """Return the index of the recording that has this stamp (ns), None if there is none."""
        for index, recording in enumerate(self.recordings):
            first, last = recording.span_ns
            if first <= stamp_ns <= last:
                return index
        return None


def make_plan(
    recordings: Sequence[Recording], training: Mapping[str, Any], *, play_all: bool
) -> PlaybackPlan:
    """Return the recordings that the model was not trained on, laid out in time.

    Args:
        recordings: the recordings given.
        training: description of the model's training, ``TaskDescription.training``.
        play_all: also play recordings that the model was trained on.

    Raises:
        RecordingError: no recording is left to play.
    """
    present = [r for r in recordings if len(r)]
    seen = [not play_all and is_known(training, r.sha256, r.name) for r in present]
    played = [r for r, known in zip(present, seen, strict=True) if not known]
    left_out = [r.name for r, known in zip(present, seen, strict=True) if known]
    if not played:
        raise RecordingError(
            f"the model was trained or chosen with all recordings given ({', '.join(left_out)}), "
            "expected another one, or --all to play them anyway"
            if left_out
            else "the recordings given are empty, expected at least one road user"
        )
    start_ns, placed = DEFAULT_START_NS, []
    for recording in played:
        offset_ns = recording.span_ns[0] - recording.start_time_ns
        recording = dataclasses.replace(recording, start_time_ns=start_ns - offset_ns)
        placed.append(recording)
        start_ns = recording.span_ns[1] + round(PAUSE_S * 1e9)
    return PlaybackPlan(tuple(placed), tuple(left_out))
