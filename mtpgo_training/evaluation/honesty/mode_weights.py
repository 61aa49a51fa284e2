# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Whether the weights of the modes are probabilities.

The event of a weight is that its mode is the nearest to the truth, by its end. Modes that are
equally near share the event. Names are those of
:mod:`mtpgo_core.quality.metrics`: ``mean`` [n, M, H, 2] (m), ``weight`` [n, M],
``truth`` [n, H, 2] (m), ``mask`` [n, H]. NaN where step H was not observed.
"""

from __future__ import annotations

import numpy as np

from mtpgo_core.quality.metrics import Array, Mask, over_steps

TIE_M = 1e-6
"""Modes whose distances differ by less are equally near (m); chosen far below any noise."""

BINS = 10
"""Bins of the reliability of weights, equally wide over [0, 1]; chosen, as usual."""


def final_distance(mean: Array, truth: Array, mask: Mask) -> Array:
    """[n, M] distance of each mode's end from the truth (m)."""
    distance = np.linalg.norm(mean[:, :, -1] - truth[:, None, -1], axis=-1)
    return np.where(mask[:, None, -1], distance, np.nan)


def average_distance(mean: Array, truth: Array, mask: Mask) -> Array:
    """[n, M] distance of each mode from the truth, averaged over the observed steps (m)."""
    distance = np.linalg.norm(mean - truth[:, None], axis=-1)
    return over_steps(distance, np.broadcast_to(mask[:, None], distance.shape))


def nearest(distance: Array, tie_m: float = TIE_M) -> Array:
    """[n, M] share of the event of being nearest: 1 for one mode, or divided among equals."""
    with np.errstate(invalid="ignore"):
        near = (distance <= distance.min(axis=1, keepdims=True) + tie_m).astype(float)
        share = near / near.sum(axis=1, keepdims=True)
    return np.where(np.isfinite(distance).all(axis=1, keepdims=True), share, np.nan)


def brier_score(weight: Array, event: Array) -> Array:
    """[n] Brier score: squared difference of weights and event [n, M], summed over the modes.

    0 for certain and right, 2 for certain and wrong, 1 - 1/M for equal weights.
    """
    return np.asarray(((weight - event) ** 2).sum(axis=1))


def heaviest_is_nearest(weight: Array, event: Array) -> Array:
    """[n] share of the event that the heaviest mode has."""
    return np.take_along_axis(event, weight.argmax(axis=1)[:, None], axis=1)[:, 0]


def brier_min(weight: Array, end: Array, error: Array) -> Array:
    """[n] brier-minFDE or brier-minADE (m): error of the best mode, plus (1 - p)^2.

    As in Argoverse 2 the best mode is the one whose end is nearest to the truth, for both values,
    and p is its weight, normalised over the modes. Argoverse 2 has at most K = 6 modes; here all
    of them count, however many. Not known where the last step was not observed.

    Args:
        weight: [n, M].
        end: [n, M] see :func:`final_distance` (m).
        error: [n, M] what is given of the best mode: ``end`` for brier-minFDE,
            :func:`average_distance` for brier-minADE (m).
    """
    known = np.isfinite(end).all(axis=1)
    row = np.arange(len(weight))
    best = np.where(np.isfinite(end), end, np.inf).argmin(axis=1)
    probability = (weight / weight.sum(axis=1, keepdims=True))[row, best]
    return np.where(known, error[row, best] + (1.0 - probability) ** 2, np.nan)


def weight_bins(weight: Array, event: Array) -> tuple[Array, Array, Array]:
    """Return number of modes, sum of their weights and of their events in each bin, [n, BINS].

    A weight of 1 is in the last bin. Agents without an event count nowhere (NaN).
    """
    place = np.minimum((weight * BINS).astype(int), BINS - 1)
    member = (place[..., None] == np.arange(BINS)).astype(float)  # [n, M, BINS]
    known = np.asarray(np.isfinite(event).all(axis=1, keepdims=True))
    parts = (np.ones_like(weight), weight, np.nan_to_num(event))
    count, weights, events = (
        np.where(known, np.einsum("nm,nmb->nb", part, member), np.nan) for part in parts
    )
    return count, weights, events


def calibration_error(count: Array, weights: Array, events: Array) -> float:
    """Expected calibration error of weights, from the sums [BINS] of :func:`weight_bins`.

    The difference of mean weight and share of events in each bin, averaged over all modes; NaN
    without any.
    """
    total = count.sum()
    return float(np.abs(weights - events).sum() / total) if total > 0 else float("nan")
