# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Which recording was played into a bag, and the offset of the bag's clock from the recording's.

A recording may be played at any time: the demo begins at the first frame, a bag of several
recordings has one after the other. Where a bag holds observations next to its predictions, they
determine both.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mtpgo_core.schema import Prediction
from mtpgo_training.data.recording import Int64Array, Recording

SAME_PLACE_M = 0.05
"""An observation is of a recording if the road user is within this of its position there (m);
chosen: well above the rounding of positions in files and messages."""

SAME_SHARE = 0.9
"""At least this share of a bag's observations are of a recording that was played; chosen."""

MOVING_MPS = 1.0
"""Only the position of a faster road user determines the time (m/s); chosen: such a road user
moves by ``SAME_PLACE_M`` in 50 ms."""

_SAMPLE, _ASKED, _CANDIDATES = 400, 60, 8
"""Numbers of observations that an offset is tested on, of observations that propose one, and of
offsets that are tested; chosen."""

_GRID_NS = 1_000_000
"""Clock offsets are counted on this grid (ns); chosen, since layouts and
messages round stamps differently."""

_OFF_GRID_NS = 2_000_000
"""A stamp is that of a frame if it is this close to it (ns); chosen: twice the grid."""


@dataclass(frozen=True)
class AlignedPart:
    """A stretch of a bag in which one recording was played.

    Attributes:
        name: of the recording, None where it is none of those given.
        shift_ns: the bag's clock minus the recording's (ns).
        first_ns: first and
        last_ns: last observation on the bag's clock (ns).
    """

    name: str | None
    shift_ns: int
    first_ns: int
    last_ns: int

    def holds(self, stamp_ns: int) -> bool:
        """Return whether an instant of the bag's clock lies within the part."""
        return self.first_ns - _GRID_NS <= stamp_ns <= self.last_ns + _GRID_NS


def find_parts(
    observed: Sequence[Recording], recordings: Mapping[str, Recording]
) -> list[AlignedPart]:
    """Return the parts of a bag in each of which one recording was played.

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
    """Return the prediction's stamp on the recording's clock (ns)."""
    return prediction.stamp_ns - part.shift_ns


def _shift_ns(piece: Recording, recording: Recording) -> tuple[int, float]:
    """Return the offset that fits most observations of the piece (ns), and their share."""
    own = recording.find_tracks(piece.key)
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
    """Return zero and the offsets that fit the positions of the most road users (ns)."""
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
