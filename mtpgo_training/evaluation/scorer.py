# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Any predictions against the recording they were made on: online, offline or from a bag.

Tracks are matched by key and stamp. Beside the predictions stand the baselines at the same
instants for the same agents, from the history that the node would have had.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.prediction.constant_velocity import predict_constant_velocity
from mtpgo_core.schema import BoolArray, Float64Array, HistoryWindow, KeyArray, Prediction
from mtpgo_core.task.task_description import HistoryConfig
from mtpgo_training.data.ground_truth import FutureTable
from mtpgo_training.data.manoeuvres import label
from mtpgo_training.data.recording import Recording
from mtpgo_training.evaluation.scorebook import ScoreBook, ScoreTable
from mtpgo_training.evaluation.scorepage import AgentScores
from mtpgo_training.scenes.history_replay import replay
from mtpgo_training.scenes.kinematic_baselines import BASELINES

IntArray = NDArray[np.int64]


@dataclass(frozen=True)
class Observed:
    """What became of n predicted agents.

    Attributes:
        track: [n] index in the recording, -1 where it has no such track.
        truth: [n, H, 2] positions (m), zero where not known.
        mask: [n, H] which are known.
        agent_class: [n] the recording's.
        manoeuvres: [n] see :func:`mtpgo_training.data.manoeuvres.label`.
        dt_s: horizon step (s).
    """

    track: IntArray
    truth: Float64Array
    mask: BoolArray
    agent_class: NDArray[np.uint8]
    manoeuvres: NDArray[np.uint8]
    dt_s: float

    def select(self, rows: BoolArray | IntArray) -> Observed:
        """Some of the agents."""
        return Observed(
            self.track[rows],
            self.truth[rows],
            self.mask[rows],
            self.agent_class[rows],
            self.manoeuvres[rows],
            self.dt_s,
        )


class Judge:
    """Scores predictions on one recording, in any order.

    Args:
        recording: what happened.
        max_gap_s: longest gap within a track that is bridged (s).
        min_future_s: agents observed for a shorter time afterwards are left out (s).
        name: of the recording in the book, its own by default.
    """

    def __init__(
        self,
        recording: Recording,
        *,
        max_gap_s: float = 0.5,
        min_future_s: float = 0.0,
        name: str | None = None,
    ) -> None:
        self.recording = recording
        self.name = recording.name if name is None else name
        self._future = FutureTable(recording, max_gap_s=max_gap_s)
        self._min_future_s = min_future_s
        self._first: IntArray | None = None
        self._tracks = {key.tobytes(): i for i, key in enumerate(recording.key)}

    def age_s(self, track: IntArray, stamp_ns: int) -> Float64Array:
        """[n] time since the recording first shows each track (s)."""
        if self._first is None:
            self._first = np.full(len(self.recording.track_id), np.iinfo(np.int64).max)
            np.minimum.at(self._first, self.recording.track, self.recording.frame)
        now_s = (stamp_ns - self.recording.start_time_ns) * 1e-9
        return np.asarray(now_s - self._first[track] / self.recording.frame_rate)

    def tracks(self, key: KeyArray) -> IntArray:
        """[n] track of each key, -1 where the recording has none."""
        return np.array([self._tracks.get(row.tobytes(), -1) for row in key], dtype=np.int64)

    def observed(self, key: KeyArray, stamp_ns: int, horizon: int, dt_s: float) -> Observed:
        """What became of the agents after ``stamp_ns``, over ``horizon`` steps of ``dt_s``."""
        track = self.tracks(key)
        now_too = self._future.at(track, stamp_ns - round(dt_s * 1e9), horizon + 1, dt_s)
        # Only tracks that exist have a class; the others are nowhere known.
        agent_class = np.where(track >= 0, self.recording.agent_class[track], 0).astype(np.uint8)
        return Observed(
            track=track,
            truth=now_too.position[:, 1:],
            mask=now_too.known[:, 1:],
            agent_class=agent_class,
            manoeuvres=label(
                now_too.position, now_too.known, dt_s, agent_class, self.recording.lanes
            ),
            dt_s=dt_s,
        )

    def add(
        self, book: ScoreBook, prediction: Prediction, name: str, protocol: str
    ) -> tuple[BoolArray, Observed, AgentScores]:
        """Score a prediction.

        Returns:
            Which of its agents count, what became of these, and their scores.
        """
        horizon = len(prediction.time_s)
        dt_s = float(prediction.time_s[0]) if horizon else float("nan")
        seen = self.observed(prediction.key, prediction.stamp_ns, horizon, dt_s)
        least = max(1, round(min(self._min_future_s / dt_s, horizon)))
        rows = seen.mask.sum(axis=1) >= least
        seen = seen.select(rows)
        book.step_s = dt_s
        scores = book.add(
            name,
            protocol,
            mean=prediction.mean[rows][..., :2],
            weight=prediction.weight[rows],
            covariance=prediction.covariance[rows],
            truth=seen.truth,
            mask=seen.mask,
            recording=self.name,
            agent_class=seen.agent_class,
            manoeuvres=seen.manoeuvres,
        )
        return rows, seen, scores

    def add_baselines(
        self, book: ScoreBook, window: HistoryWindow, seen: Observed, protocol: str
    ) -> Float64Array:
        """Score the baselines for those agents that the window holds at its time.

        Returns:
            [n] ADE of constant velocity for the agents of ``seen``, NaN where there is none (m).
        """
        held = self.tracks(window.key)
        held[~window.valid[:, -1]] = -1
        at = {int(t): i for i, t in enumerate(held) if t >= 0}
        index = np.array([at.get(int(t), -1) for t in seen.track], dtype=np.int64)
        there = index >= 0
        past, seen = window.select(index[there]), seen.select(there)
        horizon, dt_s = seen.mask.shape[1], seen.dt_s
        constant = predict_constant_velocity(past, horizon_steps=horizon, dt_s=dt_s, modes=1)
        ade = np.full(len(there), np.nan)
        for name, baseline in BASELINES.items():
            scores = book.add_path(
                name,
                protocol,
                path=baseline(past, horizon, dt_s),
                covariance=constant.covariance[:, 0] if name == "cv" else None,
                truth=seen.truth,
                mask=seen.mask,
                recording=self.name,
                agent_class=seen.agent_class,
                manoeuvres=seen.manoeuvres,
            )
            if name == "cv":
                ade[there] = scores.values["ade"]
        return ade


def score(
    predictions: Iterable[Prediction],
    recording: Recording,
    *,
    history: HistoryConfig = HistoryConfig(),  # noqa: B008  frozen
    name: str = "model",
    protocol: str = "all",
) -> ScoreTable:
    """Scores of predictions and of the baselines beside them.

    Args:
        predictions: in the recording's frame and clock, in any order of time.
        recording: what happened.
        history: for the baselines' last observed states.
        name: what the predictions are called in the table.
        protocol: under which protocol they stand in the table.
    """
    book = ScoreBook()
    add_scores(book, predictions, recording, history=history, name=name, protocol=protocol)
    return book.table()


def add_scores(
    book: ScoreBook,
    predictions: Iterable[Prediction],
    recording: Recording,
    *,
    history: HistoryConfig = HistoryConfig(),  # noqa: B008  frozen
    name: str = "model",
    protocol: str = "all",
    baselines: bool = True,
    min_future_s: float = 0.0,
) -> None:
    """Like :func:`score`, into a book that may span recordings and models.

    Args:
        book: where the scores go.
        predictions: see :func:`score`, like the rest.
        recording: what happened.
        history: for the baselines.
        name: of the predictions.
        protocol: of the predictions.
        baselines: score the baselines too; only once for several models on the same instants.
        min_future_s: agents observed for a shorter time afterwards are left out (s).
    """
    judge = Judge(recording, max_gap_s=history.max_gap_s, min_future_s=min_future_s)
    ordered = sorted(predictions, key=lambda p: p.stamp_ns)
    windows = replay(recording, history, [p.stamp_ns for p in ordered])
    for prediction, window in zip(ordered, windows, strict=True):
        if len(prediction):
            _, seen, _ = judge.add(book, prediction, name, protocol)
            if baselines:
                judge.add_baselines(book, window, seen, protocol)
