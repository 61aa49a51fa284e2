# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Selection of moments for pictures: a road user leaves its straight path.

Selected among the model's predictions by what happened, never by how well it was predicted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mtpgo_core.prediction.output_assembly import delay_ns, time_grid
from mtpgo_core.schema import Float64Array, Prediction, Source
from mtpgo_training.data.ground_truth import FutureTable
from mtpgo_training.data.recording import Recording

MIN_SPEED_MPS = 3.0
"""A focal road user moves at least this fast at t (m/s); chosen."""

ASIDE_WEIGHT, ALONG_WEIGHT = 3.0, 0.3
"""Weights of a metre across and of a metre along the straight path; chosen: braking is common."""

LARGEST_INTEREST_M = 60.0
"""Upper limit of the interest (m); chosen: more may be a tracker's error."""

BEGUN_S = 1.0
"""The straight path begins this long before the moment (s); chosen: the manoeuvre has just begun
then, and can be seen."""

NEAR_M, NEIGHBOUR_M = 40.0, 0.3
"""Each road user closer than the first (m) adds the second to the interest (m), up to ten;
chosen."""

APART_S = 4.0
"""Two moments of a recording are at least this far apart (s); chosen."""


@dataclass(frozen=True)
class Moment:
    """One prediction and the road user in its focus.

    Attributes:
        recording: what was played.
        prediction: what was predicted then.
        agent: row of the road user in focus.
        interest: by which it was selected (m).
        note: addition to its title.
        site: where it was, the recording's location by default.
    """

    recording: Recording
    prediction: Prediction
    agent: int
    interest: float
    note: str = ""
    site: str = ""


def choose_moments(
    played: Sequence[tuple[Recording, Sequence[Prediction]]], count: int, past_s: float = 3.0
) -> list[Moment]:
    """Select up to ``count`` moments, of different sites and road users as far as possible.

    Args:
        played: each recording with its predictions.
        count: how many.
        past_s: the focal road user has been observed for this long (s).
    """
    candidates = [
        moment
        for recording, predictions in played
        for moment in _best_moments(recording, predictions, past_s)
    ]
    return choose(candidates, count)


def choose(candidates: Sequence[Moment], count: int) -> list[Moment]:
    """Return the most interesting moments, of different sites and road users if possible."""
    left = sorted(candidates, key=lambda moment: -moment.interest)
    chosen: list[Moment] = []
    while left and len(chosen) < count:
        # The sites shown least often so far come first; the sort is stable.
        shown = [_site(moment) for moment in chosen]
        left.sort(key=lambda moment: shown.count(_site(moment)))
        best = left[0]
        chosen.append(best)
        left = [moment for moment in left[1:] if _differs(moment, best)]
    return chosen


def _site(moment: Moment) -> str:
    return moment.site or moment.recording.location


def _differs(one: Moment, other: Moment) -> bool:
    if one.recording is not other.recording:
        return True
    apart_s = abs(one.prediction.stamp_ns - other.prediction.stamp_ns) * 1e-9
    same = np.array_equal(one.prediction.key[one.agent], other.prediction.key[other.agent])
    return not same and apart_s >= APART_S


def _best_moments(
    recording: Recording, predictions: Sequence[Prediction], past_s: float
) -> list[Moment]:
    """Return the most interesting road user of every prediction."""
    future = FutureTable(recording)
    frame = np.full(len(recording.track_id), np.iinfo(np.int64).max)
    np.minimum.at(frame, recording.track, recording.frame)
    moments = []
    for prediction in predictions:
        if not len(prediction):
            continue
        track = recording.find_tracks(prediction.key)
        delay_s, dt_s = time_grid(prediction.time_s)
        ahead_s = delay_s + len(prediction.time_s) * dt_s
        start_ns = prediction.stamp_ns + delay_ns(prediction)
        truth = future.at(track, start_ns, len(prediction.time_s), dt_s)
        before = _state_at(recording, prediction.stamp_ns - round(BEGUN_S * 1e9), track)
        now_frame = (prediction.stamp_ns - recording.start_time_ns) * 1e-9 * recording.frame_rate
        by_model = prediction.source == Source.MODEL
        old = by_model & (track >= 0) & (frame[track] <= now_frame - past_s * recording.frame_rate)
        departure = _interest(before, truth.position[:, -1], BEGUN_S + ahead_s)
        interest = np.where(old & truth.known[:, -1], departure, -1.0)
        agent = int(np.nanargmax(interest)) if np.isfinite(interest).any() else 0
        if interest[agent] > 0.0:
            moments.append(Moment(recording, prediction, agent, float(interest[agent])))
    return moments


def _state_at(recording: Recording, stamp_ns: int, track: np.ndarray) -> Float64Array:
    """[n, 4] position and velocity of tracks at the stamp, NaN where not observed (m, m/s)."""
    frame = round((stamp_ns - recording.start_time_ns) * 1e-9 * recording.frame_rate)
    left, right = np.searchsorted(recording.frame, [frame, frame + 1])
    rows = np.full(len(recording.track_id) + 1, -1)  # row of each track; the last is for -1
    rows[recording.track[left:right]] = np.arange(left, right)
    index = rows[track]
    state = np.concatenate([recording.position, recording.velocity], axis=1)[index]
    state[index < 0] = np.nan
    return state


def _interest(now: Float64Array, end: Float64Array, time_s: float) -> Float64Array:
    """[n] distance from the straight path (m), weighted more across than along it, plus crowding.

    Args:
        now: [n, 4] position and velocity at the start of the straight path (m, m/s).
        end: [n, 2] position after ``time_s`` seconds (m).
        time_s: time between the two (s).
    """
    speed = np.linalg.norm(now[:, 2:], axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        along = now[:, 2:] / speed[:, None]
        offset = end - (now[:, :2] + now[:, 2:] * time_s)
        forward = np.abs(np.sum(offset * along, axis=1))
        aside = np.abs(along[:, 0] * offset[:, 1] - along[:, 1] * offset[:, 0])
        distance = np.linalg.norm(now[:, None, :2] - now[None, :, :2], axis=-1)
        near = np.minimum((distance < NEAR_M).sum(axis=1), 10)
        interest = np.minimum(ASIDE_WEIGHT * aside + ALONG_WEIGHT * forward, LARGEST_INTEREST_M)
        return np.where(speed >= MIN_SPEED_MPS, interest + NEIGHBOUR_M * near, -1.0)
