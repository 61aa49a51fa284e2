# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Scores of any predictions on the recording they were made on: online, offline or from a bag.

Tracks are matched by key and stamp. The baselines are scored at the same instants for the same
agents, from the history that the node would have had.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mtpgo_core.prediction.output_assembly import delay_ns, from_horizon_start, time_grid
from mtpgo_core.schema import BoolArray, Float64Array, HistoryWindow, KeyArray, Prediction
from mtpgo_core.task.task_description import HistoryConfig
from mtpgo_training.data.ground_truth import FutureTable
from mtpgo_training.data.manoeuvres import label
from mtpgo_training.data.recording import Recording
from mtpgo_training.evaluation.scores.agent_scores import (
    AgentScores,
    ScoredAgents,
    score_agents,
    score_paths,
)
from mtpgo_training.evaluation.scores.score_table import ScoreTable
from mtpgo_training.scenes.history_replay import replay
from mtpgo_training.scenes.kinematic_baselines import BaselinePath, predict_baselines

IntArray = NDArray[np.int64]


@dataclass(frozen=True)
class GroundTruth:
    """What n predicted agents did.

    Attributes:
        agents: who they are; their track is -1 where the recording has none.
        position: [n, H, 2] (m), zero where not known.
        mask: [n, H] which positions are known.
    """

    agents: ScoredAgents
    position: Float64Array
    mask: BoolArray

    def select(self, rows: BoolArray) -> GroundTruth:
        """Return some of the agents."""
        return GroundTruth(self.agents.select(rows), self.position[rows], self.mask[rows])


@dataclass(frozen=True)
class ScoredPrediction:
    """The scores of one prediction.

    Attributes:
        rows: [agents of the prediction] which of them are scored.
        truth: what those did.
        scores: of those.
    """

    rows: BoolArray
    truth: GroundTruth
    scores: AgentScores


@dataclass(frozen=True)
class ScoredBaselines:
    """The scores of the baselines for the agents of a prediction.

    Attributes:
        rows: [scored agents] which of them were in the history.
        truth: what those did.
        scores: of those, by the baseline's name.
        paths: of those, by the baseline's name.
    """

    rows: BoolArray
    truth: GroundTruth
    scores: dict[str, AgentScores]
    paths: dict[str, BaselinePath]

    @property
    def cv_ade(self) -> Float64Array:
        """[scored agents] ADE of constant velocity (m), NaN for those not in the history."""
        ade = np.full(len(self.rows), np.nan)
        ade[self.rows] = self.scores["cv"].values["ade"]
        return ade

    def add_to(self, table: ScoreTable, protocol: str) -> None:
        """Add the scores of all baselines to a table."""
        for name, scores in self.scores.items():
            table.add(name, protocol, scores, self.truth.agents)


class Scorer:
    """Scores predictions on one recording, in any order.

    Args:
        recording: what happened.
        max_gap_s: longest gap within a track that is bridged (s).
        min_future_s: agents observed for a shorter time afterwards are left out (s).
        name: of the recording in the table, its own by default.
        site: of the recording in the table, its location by default.
        kde_samples: see :func:`.scores.agent_scores.score_agents`.
    """

    def __init__(
        self,
        recording: Recording,
        *,
        max_gap_s: float = 0.5,
        min_future_s: float = 0.0,
        name: str | None = None,
        site: str | None = None,
        kde_samples: int = 0,
    ) -> None:
        self._kde_samples = kde_samples
        self.recording = recording
        self.name = recording.name if name is None else name
        self.site = recording.location if site is None else site
        self._future = FutureTable(recording, max_gap_s=max_gap_s)
        self._min_future_s = min_future_s

    @cached_property
    def _first_frame(self) -> IntArray:
        """[tracks] frame at which each track begins."""
        first = np.full(len(self.recording.track_id), np.iinfo(np.int64).max)
        np.minimum.at(first, self.recording.track, self.recording.frame)
        return first

    def age_s(self, track: IntArray, stamp_ns: int) -> Float64Array:
        """[n] time since the recording first shows each track (s)."""
        now_s = (stamp_ns - self.recording.start_time_ns) * 1e-9
        return np.asarray(now_s - self._first_frame[track] / self.recording.frame_rate)

    def ground_truth(
        self, key: KeyArray, stamp_ns: int, horizon_steps: int, dt_s: float
    ) -> GroundTruth:
        """Return what the agents did after ``stamp_ns``, over steps of ``dt_s``."""
        track = self.recording.find_tracks(key)
        now = stamp_ns - round(dt_s * 1e9)  # so that the first of H + 1 steps is the present
        path = self._future.at(track, now, horizon_steps + 1, dt_s)
        # Only tracks that exist have a class; the others are nowhere known.
        agent_class = np.where(track >= 0, self.recording.agent_class[track], 0).astype(np.uint8)
        speed = np.linalg.norm(path.velocity[:, 0], axis=-1)
        agents = ScoredAgents(
            recording=self.name,
            site=self.site,
            stamp_ns=stamp_ns,
            step_s=dt_s,
            track=track,
            agent_class=agent_class,
            manoeuvres=label(path.position, path.known, dt_s, agent_class, self.recording.lanes),
            speed_mps=np.where(path.known[:, 0], speed, np.nan),
            since_start_s=1e-9 * (stamp_ns - self.recording.span_ns[0]),
        )
        return GroundTruth(agents, path.position[:, 1:], path.known[:, 1:])

    def score(self, prediction: Prediction) -> ScoredPrediction:
        """Score the agents of a prediction that were observed for long enough afterwards.

        The instant that counts is the one at which its horizon begins.
        """
        prediction = from_horizon_start(prediction)
        horizon, (_, dt_s) = len(prediction.time_s), time_grid(prediction.time_s)
        truth = self.ground_truth(prediction.key, prediction.stamp_ns, horizon, dt_s)
        least = max(1, round(min(self._min_future_s / dt_s, horizon)))
        rows = truth.mask.sum(axis=1) >= least
        truth = truth.select(rows)
        scores = score_agents(
            prediction.mean[rows][..., :2],
            prediction.weight[rows],
            prediction.covariance[rows],
            truth.position,
            truth.mask,
            prediction.sigma_factor_50[rows],
            self._kde_samples,
        )
        return ScoredPrediction(rows, truth, scores)

    def score_baselines(self, window: HistoryWindow, truth: GroundTruth) -> ScoredBaselines:
        """Score the baselines for those agents that the window holds at its time."""
        held = self.recording.find_tracks(window.key)
        held[~window.valid[:, -1]] = -1
        row = np.full(len(self.recording.track_id) + 1, -1)  # of each track; the last is for -1
        row[held] = np.arange(len(held))
        row[-1] = -1
        index = row[truth.agents.track]
        rows = index >= 0
        truth = truth.select(rows)
        paths = predict_baselines(
            window.select(index[rows]), truth.mask.shape[1], truth.agents.step_s
        )
        scores = {
            name: score_paths(path.position, truth.position, truth.mask, path.covariance)
            for name, path in paths.items()
        }
        return ScoredBaselines(rows, truth, scores, paths)


def add_scores(
    table: ScoreTable,
    predictions: Iterable[Prediction],
    recording: Recording,
    *,
    history: HistoryConfig = HistoryConfig(),  # noqa: B008  frozen
    name: str = "model",
    protocol: str = "all",
    min_future_s: float = 0.0,
) -> None:
    """Add the scores of predictions and of the baselines at the same instants to a table.

    Args:
        table: may span recordings and models.
        predictions: in the recording's frame and clock, in any order of time.
        recording: what happened.
        history: for the baselines' last observed states.
        name: of the predictions in the table.
        protocol: of the predictions.
        min_future_s: agents observed for a shorter time afterwards are left out (s).
    """
    scorer = Scorer(recording, max_gap_s=history.max_gap_s, min_future_s=min_future_s)
    ordered = sorted(predictions, key=lambda p: p.stamp_ns)
    windows = replay(
        recording, history, [p.stamp_ns for p in ordered], ahead_ns=map(delay_ns, ordered)
    )
    for prediction, window in zip(ordered, windows, strict=True):
        if len(prediction):
            found = scorer.score(prediction)
            table.add(name, protocol, found.scores, found.truth.agents)
            scorer.score_baselines(window, found.truth).add_to(table, protocol)
