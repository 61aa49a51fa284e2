# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Which recording was played into a bag, and how far the bag's clock is from the recording's.

Whoever plays a recording may put it anywhere in time: the demo begins at the first frame, a bag
of several recordings places one after the other. Where a bag holds observations beside its
predictions, they tell both without doubt.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mtpgo_core.schema import Prediction
from mtpgo_training.data.recording import Int64Array, Recording

SAME_PLACE_M = 0.05
"""An observation is of a recording if that has the road user within this of its place (m)."""

SAME_SHARE = 0.9
"""This share of a bag's observations must be of a recording that was played."""

MOVING_MPS = 1.0
"""Only who is faster shows by its place what time it is (m/s)."""

_SAMPLE, _ASKED, _CANDIDATES = 400, 60, 8
_GRID_NS = 1_000_000
_OFF_GRID_NS = 2_000_000


@dataclass(frozen=True)
class AlignedPart:
    """A stretch of a bag in which one recording was played.

    Attributes:
        name: of the recording, None where it is none of those given.
        shift_ns: the bag's clock less the recording's (ns).
        first_ns: first and
        last_ns: last observation on the bag's clock (ns).
    """

    name: str | None
    shift_ns: int
    first_ns: int
    last_ns: int

    def holds(self, stamp_ns: int) -> bool:
        """Whether an instant of the bag's clock lies within."""
        return self.first_ns - _GRID_NS <= stamp_ns <= self.last_ns + _GRID_NS


def find_parts(
    observed: Sequence[Recording], recordings: Mapping[str, Recording]
) -> list[AlignedPart]:
    """The parts of a bag.

    Args:
        observed: what the bag observed, one after the other.
        recordings: what may have been played, by name.
    """
    return [_find_part(piece, recordings) for piece in observed]


def _find_part(piece: Recording, recordings: Mapping[str, Recording]) -> AlignedPart:
    first, last = (piece.stamp_ns(int(piece.frames[i])) for i in (0, -1))
    best_name, best_shift, best_share = None, 0, SAME_SHARE
    for name, recording in recordings.items():
        shift_ns, share = _shift_ns(piece, recording)
        if share > best_share or (share >= best_share and best_name is None):
            best_name, best_shift, best_share = name, shift_ns, share
    return AlignedPart(best_name, best_shift, first, last)


def restamped(prediction: Prediction, part: AlignedPart) -> int:
    """The prediction's stamp on the recording's clock (ns)."""
    return prediction.stamp_ns - part.shift_ns


def _shift_ns(piece: Recording, recording: Recording) -> tuple[int, float]:
    """The clock shift that explains the most of the piece's observations, and their share."""
    tracks = {key.tobytes(): i for i, key in enumerate(recording.key)}
    own = np.array([tracks.get(key.tobytes(), -1) for key in piece.key], dtype=np.int64)
    if not (own >= 0).any():
        return 0, 0.0
    rows = np.unique(np.linspace(0, len(piece) - 1, _SAMPLE).astype(np.int64))
    track = own[piece.track[rows]]
    stamp_ns = _stamps_ns(piece, piece.frame[rows])
    order = np.lexsort((recording.frame, recording.track))
    span = int(recording.frame[-1]) + 2
    codes = recording.track[order] * span + recording.frame[order]
    best_shift, best_share = 0, -1.0
    for shift in _candidates_ns(piece, own, recording, order):
        then_ns = stamp_ns - shift
        frame = np.rint((then_ns - recording.start_time_ns) * 1e-9 * recording.frame_rate).astype(
            np.int64
        )
        near = np.abs(_stamps_ns(recording, frame) - then_ns) <= _OFF_GRID_NS
        near &= (track >= 0) & (frame >= 0) & (frame < span)
        code = np.where(near, track * span + frame, -1)
        found = np.clip(np.searchsorted(codes, code), 0, len(codes) - 1)
        near &= codes[found] == code
        away = np.linalg.norm(recording.position[order][found] - piece.position[rows], axis=1)
        share = float((near & (away <= SAME_PLACE_M)).mean())
        if share > best_share:
            best_shift, best_share = shift, share
    return best_shift, best_share


def _candidates_ns(
    piece: Recording, own: Int64Array, recording: Recording, order: Int64Array
) -> list[int]:
    """No shift at all, and those that bring the most road users to where they were (ns)."""
    speed = np.nan_to_num(np.linalg.norm(piece.velocity, axis=1), nan=np.inf)
    rows = np.flatnonzero((own[piece.track] >= 0) & (speed >= MOVING_MPS))
    if not len(rows):
        return [0]
    shifts = []
    for row in rows[np.unique(np.linspace(0, len(rows) - 1, _ASKED).astype(np.int64))].tolist():
        track = own[piece.track[row]]
        its = order[slice(*np.searchsorted(recording.track[order], [track, track + 1]))]
        away = np.linalg.norm(recording.position[its] - piece.position[row], axis=1)
        if len(its) and away.min() <= SAME_PLACE_M:
            frames = np.array([piece.frame[row], recording.frame[its[np.argmin(away)]]])
            now_ns = int(_stamps_ns(piece, frames[:1])[0])
            shifts.append(now_ns - int(_stamps_ns(recording, frames[1:])[0]))
    # Rounded only for counting: layouts and messages round their stamps differently.
    grid = [round(shift / _GRID_NS) for shift in shifts]
    common = [g for g, _ in Counter(grid).most_common(_CANDIDATES)]
    return [
        0,
        *(
            int(np.median([s for s, at in zip(shifts, grid, strict=True) if at == g]))
            for g in common
        ),
    ]


def _stamps_ns(recording: Recording, frame: Int64Array) -> Int64Array:
    """[...] stamps of frames (ns)."""
    since = np.rint(frame * (1e9 / recording.frame_rate)).astype(np.int64)
    return np.asarray(recording.start_time_ns + since)
