# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Recordings as a tracker would have reported them, from noisy measurements and a causal filter.

Recordings have smooth velocities that centred filters have taken from past and future. A model
that is trained on them trusts its input more than it should. Here the recorded positions are
measured with noise and gaps, and position, velocity, acceleration and yaw come from a Kalman
filter over the measurements so far, with its lag (docs/design.md, "Simulated trackers").
"""

from __future__ import annotations

import dataclasses
import zlib

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.frames import wrap
from mtpgo_core.schema import AgentClass, BoolArray, Float64Array
from mtpgo_core.task.task_description import HistoryConfig
from mtpgo_training.data.recording import Columns, Recording
from mtpgo_training.scenes.track_samples import take_in
from mtpgo_training.scenes.tracker.kalman_scan import (
    FilterModel,
    correlated_noise,
    filter_tracks,
)
from mtpgo_training.scenes.tracker.tracker_config import Tracker, TrackerConfig
from mtpgo_training.scenes.windows import cut_tracks

IntArray = NDArray[np.int64]

_PARAMETERS, _ATTRIBUTES, _ROWS, _RESTARTS = range(4)
"""Independent streams of random numbers, so that one can be drawn without the others."""


@dataclasses.dataclass(frozen=True)
class SimulatedTracker:
    """One tracker watching one recording.

    Attributes:
        tracker: its parameters.
        seed: numbers from which all its random numbers follow.
        restarts: it loses all tracks again and again, for scenes with short pasts.
    """

    tracker: Tracker
    seed: tuple[int, ...]
    restarts: bool = False

    def attributes(self, recording: Recording) -> Recording:
        """Return the recording with the classes and sizes that the tracker reports.

        The rows are unchanged; this is cheap.
        """
        rng = self._stream(_ATTRIBUTES)
        tracks = len(recording.track_id)
        unknown = rng.random(tracks) < self.tracker.unknown_class_share
        scale = np.exp(rng.normal(0.0, 1.0, (tracks, 2)) * self.tracker.size_std)
        size = recording.size * scale if self.tracker.gives_size else np.full((tracks, 2), np.nan)
        known = np.where(unknown, AgentClass.UNKNOWN, recording.agent_class).astype(np.uint8)
        return dataclasses.replace(recording, agent_class=known, size=size)

    def observe(self, recording: Recording) -> Recording:
        """Return the recording as the tracker reports it.

        Tracks, identities and frame numbers are kept; rows that it does not report are left out,
        and a track may have no row at all.
        """
        tracker, rng = self.tracker, self._stream(_ROWS)
        rows = np.lexsort((recording.frame, recording.track))
        rows = rows[np.isfinite(recording.position[rows]).all(axis=1)]
        rows = rows[_on_time(recording, tracker.rate_hz)[rows]]
        rows = rows[~_dropped(recording, rows, tracker, rng)]
        track, time_s = recording.track[rows], recording.frame[rows] / recording.frame_rate
        measured = _measure(recording, rows, time_s, tracker, rng)
        model = FilterModel(tracker.order, tracker.process_noise, tracker.assumed_std_m)
        states, count = filter_tracks(track, time_s, measured, model)
        velocity = states[:, 1]
        yaw = _yaw(recording.yaw[rows], track, velocity, tracker, rng)
        # A velocity needs two measurements.
        told = tracker.gives_velocity & (count > 1)
        velocity = np.where(told[:, None], velocity, np.nan)
        accelerating = told & (tracker.order > 2) & (count > 2)
        acceleration = np.where(accelerating[:, None], states[:, -1], np.nan)
        reported = _age_s(track, time_s) >= _birth_s(tracker, rng, recording)[track] - 1e-9
        order = np.lexsort((track, recording.frame[rows]))
        order = order[reported[order]]
        kept = rows[order]
        return dataclasses.replace(
            self.attributes(recording),
            frame=recording.frame[kept],
            track=recording.track[kept],
            position=states[order, 0],
            velocity=velocity[order],
            acceleration=acceleration[order],
            yaw=yaw[order],
        )

    def pieces(self, recording: Recording, within_s: float) -> tuple[Recording, IntArray]:
        """Return what :func:`~mtpgo_training.scenes.windows.cut_tracks` makes of the reports."""
        return cut_tracks(self.observe(recording), within_s, self._stream(_RESTARTS))

    def _stream(self, number: int) -> np.random.Generator:
        return np.random.default_rng([*self.seed, number])


def draw_tracker(
    recording: Recording,
    seed: int,
    number: int = 0,
    config: TrackerConfig = TrackerConfig(),  # noqa: B008  frozen
    *,
    restart_share: float = 0.0,
) -> SimulatedTracker:
    """Return the tracker with a number that watches a recording.

    Args:
        recording: by its name and size, another tracker is drawn for another recording.
        seed: seed of the draw.
        number: number of the tracker, from 0.
        config: the ranges of its parameters.
        restart_share: share of the trackers that restart.
    """
    numbers = (seed, number, len(recording), zlib.crc32(recording.name.encode()))
    rng = np.random.default_rng([*numbers, _PARAMETERS])
    restarts = bool(rng.random() < restart_share)
    return SimulatedTracker(config.draw(rng), numbers, restarts)


def tracked_columns(
    recording: Recording,
    tracker: SimulatedTracker,
    history: HistoryConfig,
    within_s: float | None = None,
) -> Columns:
    """Return the history's samples of a tracker's reports, and the track of each piece.

    Args:
        recording: what the tracker watches.
        tracker: the tracker.
        history: estimators of the history.
        within_s: length of the pieces into which tracks are cut (s), None for whole tracks.

    Returns:
        The columns of :func:`~mtpgo_training.scenes.track_samples.take_in` and ``owner`` [pieces],
        the recording's track of each piece.
    """
    if within_s is None:
        owner = np.arange(len(recording.track_id), dtype=np.int64)
        return {**take_in(tracker.observe(recording), history), "owner": owner}
    pieces, owner = tracker.pieces(recording, within_s)
    return {**take_in(pieces, history), "owner": owner}


def _on_time(recording: Recording, rate_hz: float) -> BoolArray:
    """Return [rows] whether the row's frame is measured: every k-th from the first frame on."""
    frames = recording.frames
    if len(frames) < 2:
        return np.ones(len(recording), dtype=np.bool_)
    recorded_hz = recording.frame_rate / float(np.median(np.diff(frames)))
    every = max(1, round(recorded_hz / rate_hz))
    return np.asarray(np.searchsorted(frames, recording.frame) % every == 0)


def _dropped(
    recording: Recording, rows: IntArray, tracker: Tracker, rng: np.random.Generator
) -> BoolArray:
    """Return [rows] whether the measurement is missing, in bursts of geometric lengths."""
    count = len(rows)
    if tracker.dropout_share <= 0.0 or count == 0:
        return np.zeros(count, dtype=np.bool_)
    track, frame = recording.track[rows], recording.frame[rows]
    follows = np.append(track[1:] == track[:-1], False)
    steps = np.diff(frame, append=frame[-1])[follows]
    step_s = float(np.median(steps)) / recording.frame_rate if len(steps) else 1.0
    mean = max(1.0, tracker.dropout_s / step_s)
    starts = np.flatnonzero(rng.random(count) < tracker.dropout_share / mean)
    length = rng.geometric(1.0 / mean, size=len(starts))
    end = np.searchsorted(track, track[starts], side="right")
    change = np.zeros(count + 1, dtype=np.int64)
    np.add.at(change, starts, 1)
    np.add.at(change, np.minimum(starts + length, end), -1)
    return np.asarray(np.cumsum(change)[:count] > 0)


def _measure(
    recording: Recording,
    rows: IntArray,
    time_s: Float64Array,
    tracker: Tracker,
    rng: np.random.Generator,
) -> Float64Array:
    """Return [rows, 2] measured positions (m)."""
    track, position = recording.track[rows], recording.position[rows]
    if tracker.position_std_m <= 0.0 and tracker.drift_std_m <= 0.0:
        return position
    worse = np.exp(rng.normal(size=len(recording.track_id)) * tracker.agent_spread)[track, None]
    white = rng.normal(size=position.shape) * tracker.position_std_m
    drift = correlated_noise(track, time_s, tracker.drift_time_s, rng) * tracker.drift_std_m
    return position + worse * (white + drift)


def _yaw(
    recorded: Float64Array,
    track: IntArray,
    velocity: Float64Array,
    tracker: Tracker,
    rng: np.random.Generator,
) -> Float64Array:
    """Return [rows] reported yaw (rad), NaN where there is none.

    Args:
        recorded: [rows] the box's yaw (rad).
        track: [rows] ascending.
        velocity: [rows, 2] filtered (m/s).
        tracker: source and noise.
        rng: source of the noise.
    """
    if tracker.yaw_source == "none" or not len(track):
        return np.full(len(track), np.nan)
    yaw = recorded
    if tracker.yaw_source == "course":
        moving = np.hypot(velocity[:, 0], velocity[:, 1]) > tracker.moving_mps
        course = np.arctan2(velocity[:, 1], velocity[:, 0])
        # The last course of the track; before it ever moved, the box's yaw.
        last = np.maximum.accumulate(np.where(moving, np.arange(len(track)), -1))
        mine = (last >= 0) & (track[last] == track)
        yaw = np.where(mine, course[last], recorded)
    return wrap(yaw + rng.normal(size=len(yaw)) * tracker.yaw_std_rad)


def _age_s(track: IntArray, time_s: Float64Array) -> Float64Array:
    """Return [rows] the time since the first measurement of the row's track (s)."""
    return time_s - time_s[np.searchsorted(track, track, side="left")]


def _birth_s(tracker: Tracker, rng: np.random.Generator, recording: Recording) -> Float64Array:
    """Return [tracks] the time until each track is reported (s): half to one and a half of it."""
    return tracker.birth_s * rng.uniform(0.5, 1.5, len(recording.track_id))
