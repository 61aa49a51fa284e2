# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What is viewed: a recording, the predictions made on it, and what became of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mtpgo_core.identity import key_to_text
from mtpgo_core.prediction.prediction_queries import without_missing_steps
from mtpgo_core.quality.metrics import ade, fde, is_inside, nees, top_mode
from mtpgo_core.schema import MOVING_MPS, BoolArray, Float64Array, KeyArray, Prediction
from mtpgo_training.data.ground_truth import FutureTable
from mtpgo_training.data.recording import Int64Array, Recording

ELLIPSE_LEVEL = 0.9
"""Share of the truths that a drawn ellipse should hold: the one that calibration is judged by."""

ELLIPSE_TIMES_S = (1.0, 3.0, 5.0)
"""Times ahead at which ellipses are drawn (s): those of the headline scores."""

FRAME_S = 0.09
"""Frames closer to the one before are left out (s); chosen: the page draws between frames of 10 Hz
without a visible difference."""

PAST_S, STALE_S = 3.0, 1.0
"""Length of the past that is drawn, and longest time for which a prediction is (s); chosen."""

APART_M, APART_RANGES = 200.0, 10.0
"""A position this far (m) and so many interquartile ranges from the median is not what the picture
is made for; chosen beyond every site: a road user that a tracker has far away would empty it."""


@dataclass(frozen=True)
class SeenPrediction:
    """A prediction and what became of it.

    Attributes:
        prediction: of n agents, as published.
        track: [n] index of each agent's track in the recording, -1 for none.
        ade_m: [n] mean displacement of the heaviest mode over the observed steps (m), NaN where
            none was observed.
        final_m: [n] displacement at the last step (m), NaN where it was not observed.
        inside: [n] 1 where the truth of the last step is inside the heaviest mode's ellipse, 0
            where it is not, NaN where it was not observed or there is no covariance.
    """

    prediction: Prediction
    track: Int64Array
    ade_m: Float64Array
    final_m: Float64Array
    inside: Float64Array


@dataclass(frozen=True)
class ViewScene:
    """Everything that a viewer shows.

    Attributes:
        name: of the bag or recording.
        model: name of the model, empty if it is not known.
        frame_id: frame of all positions.
        recording: what was observed, cut to the time that is shown.
        predictions: ascending in time.
        offset_s: time from the beginning of the whole recording to what is shown (s).
    """

    name: str
    model: str
    frame_id: str
    recording: Recording
    predictions: tuple[SeenPrediction, ...] = ()
    offset_s: float = 0.0

    @property
    def start_ns(self) -> int:
        """Stamp of the first frame shown (ns)."""
        return self.recording.span_ns[0]

    def since_start_s(self, stamp_ns: int) -> float:
        """Return the time of a stamp after the first frame (s)."""
        return (stamp_ns - self.start_ns) * 1e-9

    @property
    def horizon_s(self) -> float:
        """Farthest time ahead of the predictions (s), 0 without any."""
        times = [
            float(p.prediction.time_s[-1]) for p in self.predictions if len(p.prediction.time_s)
        ]
        return max(times, default=0.0)


def view_scene(
    recording: Recording,
    predictions: Sequence[Prediction],
    *,
    name: str,
    model: str = "",
    frame_id: str = "",
    start_s: float | None = None,
    end_s: float | None = None,
) -> ViewScene:
    """Return what is to be viewed of a recording.

    Args:
        recording: all that was observed; what happened after the end is used for the scores.
        predictions: made on it, ascending in time.
        name: of the bag or recording.
        model: name of the model.
        frame_id: frame of the positions; by default that of the predictions.
        start_s: begin, from the recording's first frame (s).
        end_s: end, from the recording's first frame (s).
    """
    first_ns, last_ns = recording.span_ns
    begin_ns = first_ns + round(1e9 * (start_s or 0.0))
    end_ns = last_ns if end_s is None else first_ns + round(1e9 * end_s)
    shown = recording.between(start_s, end_s)
    future = FutureTable(recording)
    seen = tuple(
        _seen(prediction, recording, shown, future)
        for prediction in predictions
        if begin_ns <= prediction.stamp_ns <= end_ns and len(prediction)
    )
    frames = [one.prediction.frame_id for one in seen]
    return ViewScene(
        name=name,
        model=model,
        frame_id=frame_id or next(iter(frames), "map"),
        recording=shown,
        predictions=seen,
        offset_s=(shown.span_ns[0] - first_ns) * 1e-9 if len(shown) else 0.0,
    )


def _seen(
    prediction: Prediction, recording: Recording, shown: Recording, future: FutureTable
) -> SeenPrediction:
    """Return a prediction with its scores; points that are missing in it count in none."""
    prediction = without_missing_steps(prediction)
    tracks = recording.find_tracks(prediction.key)
    time_s = np.round(prediction.time_s, 6)  # float32 in messages
    truth = future.at_times(tracks, prediction.stamp_ns, time_s)
    mean = prediction.mean[..., :2]
    there = np.isfinite(top_mode(mean, prediction.weight)).all(axis=-1)
    with np.errstate(invalid="ignore"):
        squared = nees(mean, prediction.weight, prediction.covariance, truth.position)[:, -1:]
        inside = is_inside(squared, ELLIPSE_LEVEL, prediction.sigma_factor_50[:, -1:])[:, 0]
    tested = truth.known[:, -1] & np.isfinite(squared[:, 0])
    return SeenPrediction(
        prediction=prediction,
        track=shown.find_tracks(prediction.key),
        ade_m=np.asarray(
            ade(mean, prediction.weight, truth.position, truth.known & there), np.float64
        ),
        final_m=np.asarray(fde(mean, prediction.weight, truth.position, truth.known), np.float64),
        inside=np.where(tested, inside, np.nan),
    )


def shown_frames(scene: ViewScene) -> Int64Array:
    """Return the frames that are drawn, at most one in ``FRAME_S``."""
    frames, rate = scene.recording.frames, scene.recording.frame_rate
    chosen: list[int] = []
    for frame in frames.tolist():
        if not chosen or (frame - chosen[-1]) / rate >= FRAME_S:
            chosen.append(frame)
    return np.array(chosen, dtype=np.int64)


def ellipse_indices(time_s: Float64Array) -> Int64Array:
    """Return the steps with ellipses: those nearest to ELLIPSE_TIMES_S, else the last one."""
    known = np.flatnonzero(np.isfinite(time_s))
    if not len(known):
        return np.empty(0, dtype=np.int64)
    last_s = float(time_s[known[-1]])
    wanted = [t for t in ELLIPSE_TIMES_S if t <= last_s + 1e-6] or [last_s]
    return np.unique([int(known[np.argmin(np.abs(time_s[known] - t))]) for t in wanted])


def positions_together(position: Float64Array) -> BoolArray:
    """Return [rows] which of [rows, 2] positions (m) lie where most of them do."""
    low, middle, high = np.nanquantile(position, [0.25, 0.5, 0.75], axis=0)
    with np.errstate(invalid="ignore"):
        near = np.abs(position - middle) <= APART_M + APART_RANGES * (high - low)
    return np.asarray(near.all(axis=1))


def drawn_speeds(recording: Recording) -> Float64Array:
    """[rows] speed (m/s): observed, or of the way between neighbouring rows of a track."""
    speed = np.linalg.norm(recording.velocity, axis=1)
    return np.where(np.isfinite(speed), speed, np.linalg.norm(_way(recording), axis=1))


def drawn_yaws(recording: Recording) -> Float64Array:
    """[rows] heading (rad): observed, or the direction of motion, or 0 where nothing tells."""
    velocity = np.where(np.isfinite(recording.velocity), recording.velocity, _way(recording))
    moving = np.linalg.norm(velocity, axis=1) > MOVING_MPS
    course = np.where(moving, np.arctan2(velocity[:, 1], velocity[:, 0]), np.nan)
    yaw = np.where(np.isfinite(recording.yaw), recording.yaw, course)
    return _filled(yaw, recording)


def identity_texts(key: KeyArray) -> list[str]:
    """Return [n, 4] identities as users know them: numbers, or UUIDs."""
    return [key_to_text(one) for one in key]


class TrackWays:
    """Where each track of a scene was over time.

    Args:
        scene: the scene.
    """

    def __init__(self, scene: ViewScene) -> None:
        recording = scene.recording
        self._order, self._starts = rows_by_track(recording)
        self._position = recording.position[self._order]
        passed = recording.frame[self._order] - recording.frames[0]
        self._time_s = passed / recording.frame_rate

    def between(self, track: int, from_s: float, to_s: float) -> Float64Array:
        """Return [k, 2] the positions of a track from one time to another (m)."""
        mine = slice(self._starts[track], self._starts[track + 1])
        begin, end = np.searchsorted(self._time_s[mine], [from_s - 1e-4, to_s + 1e-4])
        return self._position[mine][begin:end]

    def all(self) -> list[Float64Array]:
        """Return [k, 2] the whole way of each track with two positions or more (m)."""
        parts = np.split(self._position, self._starts[1:-1])
        return [part for part in parts if len(part) > 1]


def rows_by_track(recording: Recording) -> tuple[Int64Array, Int64Array]:
    """Return the rows in order of track and time, and [tracks + 1] where each track begins."""
    order = np.lexsort((recording.frame, recording.track))
    starts = np.searchsorted(recording.track[order], np.arange(len(recording.track_id) + 1))
    return order, starts.astype(np.int64)


def _way(recording: Recording) -> Float64Array:
    """[rows, 2] velocity from the positions before and after (m/s), 0 where there are none."""
    order, starts = rows_by_track(recording)
    way = np.zeros((len(recording), 2))
    time_s = recording.frame / recording.frame_rate
    for begin, end in zip(starts[:-1].tolist(), starts[1:].tolist(), strict=True):
        rows = order[begin:end]
        if len(rows) > 1:
            way[rows] = np.gradient(recording.position[rows], time_s[rows], axis=0)
    return way


def _filled(values: Float64Array, recording: Recording) -> Float64Array:
    """[rows] values whose gaps have the nearest known value of the track before, or after."""
    order, starts = rows_by_track(recording)
    filled = np.zeros(len(values))
    for begin, end in zip(starts[:-1].tolist(), starts[1:].tolist(), strict=True):
        rows = order[begin:end]
        known = np.flatnonzero(np.isfinite(values[rows]))
        if len(known):
            before = np.searchsorted(known, np.arange(len(rows)), side="right") - 1
            filled[rows] = values[rows][known[np.maximum(before, 0)]]
    return filled
