# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A causal Kalman filter over the measured positions of many tracks at once."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.schema import Float64Array

IntArray = NDArray[np.int64]

FIRST_STD = (10.0, 3.0)
"""Standard deviation of velocity (m/s) and acceleration (m/s^2) of a new track around zero;
chosen: a road user's."""

RESTART_S = 1.5
"""After a longer gap the filter starts again (s); chosen: trackers drop a track that is unseen for
about that long."""


@dataclass(frozen=True)
class FilterModel:
    """A filter whose highest state is driven by white noise, the same on both axes.

    Attributes:
        order: states on each axis: 2 position and velocity, 3 acceleration too.
        process_noise: square root of the noise's spectral density (m/s^order/sqrt(Hz)).
        measurement_std_m: noise of a measured position that the filter assumes (m).
    """

    order: int
    process_noise: float
    measurement_std_m: float

    def transition(self, dt_s: Float64Array) -> Float64Array:
        """Return [n, order, order] transition matrices over [n] times (s)."""
        matrix = np.zeros((len(dt_s), self.order, self.order))
        for i in range(self.order):
            for j in range(i, self.order):
                matrix[:, i, j] = dt_s ** (j - i) / math.factorial(j - i)
        return matrix

    def process_covariance(self, dt_s: Float64Array) -> Float64Array:
        """Return [n, order, order] covariances of the noise over [n] times (s)."""
        top = self.order - 1
        matrix = np.zeros((len(dt_s), self.order, self.order))
        for i in range(self.order):
            for j in range(self.order):
                p, q = top - i, top - j
                matrix[:, i, j] = dt_s ** (p + q + 1) / (
                    (p + q + 1) * math.factorial(p) * math.factorial(q)
                )
        return self.process_noise**2 * matrix


def filter_tracks(
    track: IntArray, time_s: Float64Array, measured: Float64Array, model: FilterModel
) -> tuple[Float64Array, IntArray]:
    """Return the filtered states of every row, each from the rows of its track up to it.

    Args:
        track: [rows] ascending.
        time_s: [rows] ascending within a track (s).
        measured: [rows, 2] positions (m).
        model: the filter.

    Returns:
        [rows, order, 2] position (m), velocity (m/s) and so on, and [rows] the number of
        measurements since the filter's start.
    """
    rows, order = len(track), model.order
    states = np.zeros((rows, order, 2))
    if not rows:
        return states, np.zeros(0, dtype=np.int64)
    follows = np.append(False, track[1:] == track[:-1])
    dt_s = np.where(follows, np.diff(time_s, prepend=time_s[0]), np.inf)
    fresh = dt_s > RESTART_S
    piece_start = np.maximum.accumulate(np.where(fresh, np.arange(rows), 0))
    count = np.arange(rows) - piece_start + 1
    # Few different times between rows occur, so their matrices are made once.
    steps: Float64Array = np.where(fresh, 0.0, dt_s)
    times, kind = np.unique(steps.round(6), return_inverse=True)
    forward, noise = model.transition(times), model.process_covariance(times)

    starts = np.flatnonzero(fresh)
    length = np.diff(np.append(starts, rows))
    starts = starts[np.argsort(-length, kind="stable")]
    length = -np.sort(-length)
    first = np.array([model.measurement_std_m, *FIRST_STD[: order - 1]])
    state = np.zeros((len(starts), order, 2))
    state[:, 0] = measured[starts]
    covariance = np.tile(np.diag(first**2), (len(starts), 1, 1))
    states[starts] = state
    variance = model.measurement_std_m**2
    for n in range(1, int(length[0])):
        going = int(np.searchsorted(-length, -n, side="left"))  # pieces with more than n rows
        at = starts[:going] + n
        f = forward[kind[at]]
        state = f @ state[:going]
        covariance = f @ covariance[:going] @ f.transpose(0, 2, 1) + noise[kind[at]]
        gain = covariance[:, :, 0] / (covariance[:, :1, 0] + variance)
        state += gain[:, :, None] * (measured[at] - state[:, 0])[:, None, :]
        covariance -= gain[:, :, None] * covariance[:, None, 0, :]
        states[at] = state
    return states, count


def correlated_noise(
    track: IntArray,
    time_s: Float64Array,
    correlation_s: float,
    rng: np.random.Generator,
) -> Float64Array:
    """Return [rows, 2] noise of unit variance that changes slowly within a track.

    A stationary first-order process with the autocorrelation exp(-|t| / ``correlation_s``).

    Args:
        track: [rows] ascending.
        time_s: [rows] ascending within a track (s).
        correlation_s: correlation time (s).
        rng: source of the noise.
    """
    rows = len(track)
    noise = rng.normal(size=(rows, 2))
    if not rows:
        return noise
    follows = np.append(False, track[1:] == track[:-1])
    keep = np.where(follows, np.exp(-np.diff(time_s, prepend=time_s[0]) / correlation_s), 0.0)
    noise *= np.sqrt(1.0 - keep**2)[:, None]
    starts = np.flatnonzero(~follows)
    length = np.diff(np.append(starts, rows))
    starts = starts[np.argsort(-length, kind="stable")]
    length = -np.sort(-length)
    for n in range(1, int(length[0])):
        at = starts[: int(np.searchsorted(-length, -n, side="left"))] + n
        noise[at] += keep[at, None] * noise[at - 1]
    return noise
