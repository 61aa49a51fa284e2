# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Scores the node's predictions by the observations that follow them. No ROS in here."""

from __future__ import annotations

import threading

import numpy as np

from mtpgo_core.history.stream_guard import UpdateReport
from mtpgo_core.history.track_history import TrackHistory
from mtpgo_core.quality.outcome_matcher import OutcomeMatcher
from mtpgo_core.quality.outcomes import Outcomes
from mtpgo_core.quality.quality_report import QualityReport
from mtpgo_core.quality.rolling_scores import RollingScores
from mtpgo_core.schema import HistoryWindow, Prediction
from mtpgo_core.task.task_description import HistoryConfig


class LiveQuality:
    """Rolling scores of what was published; thread-safe.

    Args:
        config: of the history.

    Attributes:
        frame_id: frame of the last prediction, empty before.
        place: x, y of the middle of its agents (m).
    """

    def __init__(self, config: HistoryConfig) -> None:
        self._config = config
        self._lock = threading.Lock()
        self.start_anew()
        self.frame_id = ""
        self.place = (0.0, 0.0)

    def start_anew(self) -> None:
        """Forget all predictions and scores: another model predicts from now on."""
        with self._lock:
            self._matcher = OutcomeMatcher(self._config)
            self._scores = RollingScores(self._config.dt_s)

    def published(
        self, prediction: Prediction, window: HistoryWindow, max_modes: int | None
    ) -> None:
        """Keep a prediction that was published; any thread.

        Args:
            prediction: all of its modes.
            window: that it was made of.
            max_modes: most modes that are published.
        """
        self._matcher.add(prediction, window, max_modes)
        self.frame_id = prediction.frame_id
        middle = prediction.initial[:, :2].mean(axis=0) if len(prediction) else np.zeros(2)
        self.place = (float(middle[0]), float(middle[1]))

    def observed(self, history: TrackHistory, report: UpdateReport) -> Outcomes:
        """Score the earlier predictions whose truth this observation gives, and return them.

        Args:
            history: after the observation.
            report: on it.
        """
        with self._lock:
            outcomes = self._matcher.update(history, report)
            self._scores.update(outcomes)
        return outcomes

    def clear(self) -> None:
        """Forget the predictions in flight: the clock was set back."""
        with self._lock:
            self._matcher.clear("clock_reset")

    def report(self) -> QualityReport:
        """Return the scores of the last minutes; any thread."""
        with self._lock:
            return self._scores.report(self._matcher.unknown)
