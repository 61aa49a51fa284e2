# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The future of any track of a recording at any time, for targets and scores.

This is the only module that reads beyond the present. It reads the recording, never the history
window, so the future cannot enter a model's input.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.schema import BoolArray, Float64Array
from mtpgo_training.data.recording import Columns, Recording

IntArray = NDArray[np.int64]

_ROWS_AT_ONCE = 65536
"""Rows fitted together; chosen, bounds the memory."""


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
    """States by track and time, interpolated linearly between the frames of a recording."""

    def __init__(
        self,
        recording: Recording,
        *,
        max_gap_s: float = 0.5,
        velocity_smoothing_s: float = 0.0,
        columns: Mapping[str, NDArray[Any]] | None = None,
    ) -> None:
        """Sort the rows once by track and frame.

        Args:
            recording: the recording.
            max_gap_s: longest gap within a track that is bridged (s).
            velocity_smoothing_s: see :func:`future_columns`.
            columns: result of :func:`future_columns` if it was computed before; it may be mapped
                from disk.
        """
        if columns is None:
            columns = future_columns(recording, velocity_smoothing_s)
        self._row_key: IntArray = columns["key"]
        self._track: NDArray[np.int32] = columns["track"]
        self._position: Float64Array = columns["position"]
        self._velocity: Float64Array = columns["velocity"]
        self._rate = recording.frame_rate
        self._start_ns = recording.start_time_ns
        self._max_gap_frames = max(1.0, max_gap_s * recording.frame_rate + 1e-6)
        self._first, self._stride = _span(recording)

    def at(
        self, track: IntArray, stamp_ns: int | IntArray, horizon_steps: int, dt_s: float
    ) -> Future:
        """Return the states at ``stamp_ns + k dt_s``, k = 1 ... H.

        Args:
            track: [n] indices of the recording's tracks; -1 for an agent that is not in it.
            stamp_ns: the present, one for all or [n] (ns).
            horizon_steps: H.
            dt_s: horizon step (s).
        """
        ahead = np.arange(1, horizon_steps + 1, dtype=np.float64) * (dt_s * self._rate)
        return self._lookup(track, np.asarray(self._frame(stamp_ns) + ahead))

    def at_times(self, track: IntArray, stamp_ns: int | IntArray, time_s: Float64Array) -> Future:
        """Return the states at ``stamp_ns + time_s``.

        Args:
            track: [n] as in :meth:`at`.
            stamp_ns: the present, one for all or [n] (ns).
            time_s: [H] (s).
        """
        return self._lookup(track, np.asarray(self._frame(stamp_ns) + time_s * self._rate))

    def _frame(self, stamp_ns: int | IntArray) -> Float64Array:
        """Return [1 or n, 1] the frames after the first one of stamps (ns)."""
        now = (stamp_ns - self._start_ns) * 1e-9 * self._rate - self._first
        return np.reshape(np.asarray(now, dtype=np.float64), (-1, 1))

    def _lookup(self, track: IntArray, when: Float64Array) -> Future:
        """Return the states at ``when`` [1 or n, H], in frames after the first one."""
        if not len(self._row_key):
            nothing = np.zeros((len(track), when.shape[1], 2))
            return Future(nothing, nothing, np.zeros(nothing.shape[:2], dtype=np.bool_))
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


def future_columns(recording: Recording, velocity_smoothing_s: float = 0.0) -> Columns:
    """Return the rows of a recording by track and frame, as a :class:`FutureTable` needs them.

    Rows without a finite position are left out: they are no observation, as in the history.

    Args:
        recording: the recording.
        velocity_smoothing_s: 0 keeps the recorded velocities. A positive value is the standard
            deviation (s) of the kernel of a local quadratic fit through the positions, whose slope
            is the target velocity. The fit uses past and future: a target may, an input may not.
    """
    order = np.lexsort((recording.frame, recording.track))
    order = order[np.isfinite(recording.position[order]).all(axis=1)]
    frame, track = recording.frame[order], recording.track[order]
    position, velocity = recording.position[order], recording.velocity[order]
    first, stride = _span(recording)
    if velocity_smoothing_s > 0.0 or not np.isfinite(velocity).all():
        sigma_s = max(velocity_smoothing_s, 1.5 / recording.frame_rate)
        fitted = _fitted_velocity(frame, recording.frame_rate, track, position, sigma_s)
        if velocity_smoothing_s > 0.0:
            velocity = fitted
        else:
            velocity = np.where(np.isfinite(velocity), velocity, fitted)
    return {
        "key": track * stride + (frame - first),
        "track": track.astype(np.int32),
        "position": position,
        "velocity": velocity,
    }


def _span(recording: Recording) -> tuple[int, int]:
    """Return the first frame and an offset from track to track, longer than the recording."""
    if not len(recording):
        return 0, 2
    first, last = int(recording.frame[0]), int(recording.frame[-1])
    return first, last - first + 2


def _fitted_velocity(
    frame: IntArray, rate: float, track: IntArray, position: Float64Array, sigma_s: float
) -> Float64Array:
    """Return [rows, 2] the slope of a Gaussian-weighted quadratic fit over each row's track.

    The rows are sorted by track and time; a fit uses two standard deviations to both sides.
    """
    rows = len(frame)
    out = np.zeros((rows, 2))
    index = np.arange(rows)
    reach = _farthest(frame / rate, track, 2.0 * sigma_s + 1e-9)
    for begin in range(0, rows, _ROWS_AT_ONCE):
        mine = slice(begin, min(begin + _ROWS_AT_ONCE, rows))
        n = mine.stop - mine.start
        matrix, right = np.zeros((n, 3, 3)), np.zeros((n, 3, 2))
        for offset in range(-reach, reach + 1):
            wanted = index[mine] + offset
            other = np.clip(wanted, 0, rows - 1)
            time_s = (frame[other] - frame[mine]) / rate
            close = np.abs(time_s) <= 2.0 * sigma_s + 1e-9
            close &= (track[other] == track[mine]) & (other == wanted)
            # In units of sigma, for powers of a time of any size are no numbers to compute with.
            step = np.where(close, time_s / sigma_s, 0.0)
            weight = np.where(close, np.exp(-0.5 * step**2), 0.0)
            basis = np.stack([np.ones(n), step, step**2], axis=-1)
            weighted = weight[:, None] * basis
            matrix += weighted[:, :, None] * basis[:, None, :]
            right += weighted[:, :, None] * (position[other] - position[mine])[:, None, :]
        # With the ridge, a fit through two points is a line, and through one has slope zero.
        matrix += np.diag([1e-9, max(1e-9 / sigma_s**2, 1e-12), max(1e-5 / sigma_s**4, 1e-5)])
        out[mine] = np.linalg.solve(matrix, right)[:, 1] / sigma_s
    return out


def _farthest(time_s: Float64Array, track: IntArray, reach_s: float) -> int:
    """Return the largest number of rows of one track within ``reach_s`` of a row."""
    if not len(time_s):
        return 0
    stretch = float(time_s.max() - time_s.min()) + 2.0 * reach_s + 1.0
    along = time_s - time_s.min() + track * stretch
    end = np.searchsorted(along, along + reach_s * (1.0 + 1e-6), side="right")
    return int((end - np.arange(len(along))).max())
