# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What happened next: the future of any track of a recording at any time, for targets and scores.

This is the only place that looks beyond the present. It reads the recording, never the history
window, so nothing of it can reach a model's input.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.schema import BoolArray, Float64Array
from mtpgo_training.recording import Recording

IntArray = NDArray[np.int64]


@dataclass(frozen=True)
class Future:
    """Observed states of n tracks at H later instants, in the recording's frame.

    Attributes:
        position: [n, H, 2] (m), zero where not known.
        velocity: [n, H, 2] (m/s), zero where not known.
        known: [n, H] the track was observed at that instant.
    """

    position: Float64Array
    velocity: Float64Array
    known: BoolArray


class FutureTable:
    """Looks states up by track and time, linear between the frames of a recording."""

    def __init__(
        self, recording: Recording, *, max_gap_s: float = 0.5, velocity_smoothing_s: float = 0.0
    ) -> None:
        """Sort the rows once by track and frame.

        Args:
            recording: the recording.
            max_gap_s: longest gap within a track that is bridged (s).
            velocity_smoothing_s: 0 keeps the recorded velocities; above it is the standard
                deviation (s) of the kernel of a local quadratic fit through the positions, whose
                slope is the target velocity. The fit looks to both sides: a target may, an input
                may not.
        """
        order = np.lexsort((recording.frame, recording.track))
        self._frame = recording.frame[order]
        self._track = recording.track[order]
        self._position = recording.position[order]
        self._rate = recording.frame_rate
        self._start_ns = recording.start_time_ns
        self._max_gap_frames = max(1.0, max_gap_s * recording.frame_rate + 1e-6)
        self._first = int(self._frame.min()) if len(self._frame) else 0
        self._stride = (int(self._frame.max()) - self._first if len(self._frame) else 0) + 2
        self._row_key = self._track * self._stride + (self._frame - self._first)
        velocity = recording.velocity[order]
        fitted = None
        if velocity_smoothing_s > 0.0 or not np.isfinite(velocity).all():
            fitted = self._fitted_velocity(max(velocity_smoothing_s, 1.5 / self._rate))
        if velocity_smoothing_s > 0.0 and fitted is not None:
            velocity = fitted
        elif fitted is not None:
            velocity = np.where(np.isfinite(velocity), velocity, fitted)
        self._velocity = velocity

    def at(self, track: IntArray, stamp_ns: int, horizon_steps: int, dt_s: float) -> Future:
        """The states at ``stamp_ns + k dt_s``, k = 1 ... H.

        Args:
            track: [n] indices of the recording's tracks; -1 for one that is not in it.
            stamp_ns: the present (ns).
            horizon_steps: H.
            dt_s: horizon step (s).
        """
        now = (stamp_ns - self._start_ns) * 1e-9 * self._rate - self._first
        ahead = np.arange(1, horizon_steps + 1, dtype=np.float64) * (dt_s * self._rate)
        return self._lookup(track, np.asarray(now + ahead, dtype=np.float64))

    def _lookup(self, track: IntArray, when: Float64Array) -> Future:
        """States at ``when`` [H], in frames after the first one."""
        nearest = np.rint(when)
        when = np.where(np.abs(when - nearest) < 1e-4, nearest, when)  # ns rounding of stamps
        inside = (when >= 0.0) & (when <= self._stride - 2)
        key = np.maximum(track, 0)[:, None] * self._stride + np.where(inside, when, 0.0)
        row = np.searchsorted(self._row_key, key, side="right") - 1  # [n, H]
        last = len(self._row_key) - 1
        low, high = np.clip(row, 0, last), np.clip(row + 1, 0, last)
        past, rest = key - self._row_key[low], self._row_key[high] - key
        same = self._track[low] == track[:, None]
        exact = same & (past == 0.0)
        between = same & (self._track[high] == track[:, None]) & (rest > 0.0) & (past > 0.0)
        between &= past + rest <= self._max_gap_frames
        known = (exact | between) & inside
        share = np.where(between, past / np.where(between, past + rest, 1.0), 0.0)[..., None]

        def mix(values: Float64Array) -> Float64Array:
            mixed = values[low] * (1.0 - share) + values[high] * share
            return np.where(known[..., None], mixed, 0.0)

        return Future(mix(self._position), mix(self._velocity), known)

    def _fitted_velocity(self, sigma_s: float) -> Float64Array:
        """[rows, 2] slope of a Gaussian-weighted local quadratic fit over each row's own track."""
        sigma = sigma_s * self._rate
        reach = max(1, int(np.ceil(2.0 * sigma)))
        rows = len(self._frame)
        matrix = np.zeros((rows, 3, 3))
        right = np.zeros((rows, 3, 2))
        index = np.arange(rows)
        for offset in range(-reach, reach + 1):
            other = np.clip(index + offset, 0, max(rows - 1, 0))
            step = (self._frame[other] - self._frame) / self._rate
            close = np.abs(step) <= 2.0 * sigma_s + 1e-9
            mine = (self._track[other] == self._track) & close & (other == index + offset)
            weight = np.where(mine, np.exp(-0.5 * (step / sigma_s) ** 2), 0.0)
            basis = np.stack([np.ones(rows), step, step**2], axis=-1)
            matrix += weight[:, None, None] * basis[:, :, None] * basis[:, None, :]
            moved = self._position[other] - self._position
            right += weight[:, None, None] * basis[:, :, None] * moved[:, None, :]
        # The ridge makes a fit through two points a line and through one a standstill.
        matrix += np.diag([1e-9, 1e-9, 1e-5])
        return np.asarray(np.linalg.solve(matrix, right)[:, 1], dtype=np.float64)
