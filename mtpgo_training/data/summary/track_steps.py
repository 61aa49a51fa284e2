# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The steps from each row of a track to its next one."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mtpgo_core.schema import Float64Array
from mtpgo_training.data.recording import Int64Array, Recording


@dataclass(frozen=True)
class TrackSteps:
    """Steps between consecutive rows of the same track, by track and time.

    Attributes:
        before, after: [steps] rows of the recording.
        track: [steps] index of the track.
        dt_s: [steps] duration (s).
        move: [steps, 2] displacement (m).
        velocity: [steps, 2] recorded velocity, the mean of both ends (m/s), NaN where unknown.
    """

    before: Int64Array
    after: Int64Array
    track: Int64Array
    dt_s: Float64Array
    move: Float64Array
    velocity: Float64Array

    @classmethod
    def of(cls, recording: Recording) -> TrackSteps:
        """Return the steps of a recording."""
        order = np.lexsort((recording.frame, recording.track)).astype(np.int64)
        same = recording.track[order[1:]] == recording.track[order[:-1]]
        before, after = order[:-1][same], order[1:][same]
        frames = recording.frame[after] - recording.frame[before]
        return cls(
            before=before,
            after=after,
            track=recording.track[before],
            dt_s=frames / recording.frame_rate,
            move=recording.position[after] - recording.position[before],
            velocity=(recording.velocity[before] + recording.velocity[after]) / 2,
        )

    @cached_property
    def distance_m(self) -> Float64Array:
        """[steps] distance (m)."""
        return lengths(self.move)

    @cached_property
    def speed_mps(self) -> Float64Array:
        """[steps] distance over duration (m/s)."""
        return np.asarray(self.distance_m / self.dt_s)


def lengths(vectors: Float64Array) -> Float64Array:
    """Return [n] lengths of [n, 2] vectors, also where a square would overflow."""
    return np.asarray(np.hypot(vectors[:, 0], vectors[:, 1]))
